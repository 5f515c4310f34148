"""Plugins: classes found by name through the `<hric_core plugin="..."/>` export in package.xml, like pluginlib."""

import functools
import importlib
import os
import sys
import threading
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from hric_core.errors import HricError, UnknownNameError, check_known

CONTROLLER = "hric_control::Controller"
ROBOT_HW = "hric_control::RobotHW"
PLANT = "hric_control::Plant"
PARTICIPANT = "hric_control::Participant"
HUMAN_CONTROLLER = "hric_human::HumanController"
SENSOR = "hric_perception::Sensor"
POSTURE_METHOD = "hric_assessment::PostureMethod"
TASK_METHOD = "hric_assessment::TaskMethod"
EXPORT = "hric_bags::Export"
SECTION = "hric_run::Section"
COMMAND = "hric_core::Command"
EXPORTS = ("hric_core", "hric_control")
"""Export elements of package.xml that name a plugins.xml file, which may declare plugins of any base class."""
_BASES = {
    CONTROLLER: "hric_control.controller:Controller",
    ROBOT_HW: "hric_control.robot_hw:RobotHW",
    PLANT: "hric_control.plant:Plant",
    PARTICIPANT: "hric_control.sim.participants:Participant",
    HUMAN_CONTROLLER: "hric_human.control.controller:HumanController",
    SENSOR: "hric_perception.section:SensorSection",
    POSTURE_METHOD: "hric_assessment.ergonomics.scoring:PostureMethod",
    TASK_METHOD: "hric_assessment.verdict.tasks:TaskMethod",
    EXPORT: "hric_bags.export.table:Export",
    SECTION: "hric_run.definition.sections:ExperimentSection",
    COMMAND: "hric_core.command:Command",
}


@dataclass(frozen=True)
class PluginInfo:
    """Entry of a plugins.xml file: a class that a package exports as a plugin.

    Attributes:
        name: lookup name, e.g. "hric_controllers/JointPDController".
        type: module and class, "module:Class".
        base: name of the base class, e.g. "hric_control::Controller".
        description: one sentence.
        package: exporting package.
        source: path of the plugins.xml file.
        library: folder of the Python module; added to the import path unless it is the folder of plugins.xml.
    """

    name: str
    type: str
    base: str
    description: str
    package: str
    source: Path
    library: Path


@dataclass
class _Index:
    plugins: dict[str, dict[str, PluginInfo]] = field(default_factory=lambda: {base: {} for base in _BASES})
    problems: list[str] = field(default_factory=list)


def names(base: str, search_path: str = "") -> dict[str, PluginInfo]:
    """Return all plugins with a base class by their lookup name.

    Args:
        base: name of the base class, one of the constants of this module: CONTROLLER, ROBOT_HW, PLANT, ...
        search_path: folders to search for packages, separated by colons; ROS_PACKAGE_PATH by default.
    """
    check_known("plugin base", [base], _BASES)
    return dict(_index(search_path or packages_path()).plugins[base])


def engines(search_path: str = "") -> dict[str, PluginInfo]:
    """Return the plant plugins by the short name of their physics engine, e.g. "pybullet".

    It is the name of the exporting package without `_ros_control`. If a Python distribution of this name exists, it is
    the engine's own."""
    return {info.package.removesuffix("_ros_control"): info for info in names(PLANT, search_path).values()}


def find(base: str, name: str) -> type:
    """Import and return the plugin class exported under `name`.

    Raises:
        UnknownNameError: no such name; the message lists the valid ones and the plugin files that could not be read.
        HricError: the module cannot be imported, lacks the class, or the class has another base.
    """
    info = names(base).get(name)
    if info is None:
        clear_cache()  # a package may have been added since the last search
        info = names(base).get(name)
    if info is None:
        raise _not_found(base, name)
    module_name, _, class_name = info.type.partition(":")
    module = _import(info, module_name)
    plugin_class = getattr(module, class_name, None)
    if not isinstance(plugin_class, type):
        raise HricError(f"plugin {name}: {module_name} has no class {class_name!r} (declared in {info.source})")
    if not issubclass(plugin_class, _base_class(base)):
        raise HricError(f"plugin {name}: {info.type} is not a {base} (declared in {info.source})")
    return plugin_class


def reload(base: str = CONTROLLER) -> list[str]:
    """Read the plugin files again and reload those imported modules that export plugins of this base class.

    Returns:
        the names of the reloaded modules.
    """
    clear_cache()
    modules = {info.type.partition(":")[0]: info for info in names(base).values()}
    reloaded = [name for name in modules if name in sys.modules]
    for name in reloaded:
        try:
            importlib.reload(sys.modules[name])
        except Exception as error:
            raise HricError(
                f"cannot reload module {name} of package {modules[name].package}: {_reason(error)}"
            ) from error
    return reloaded


def clear_cache() -> None:
    """Discard the cached contents of package.xml and plugins.xml files, so that they are read again."""
    _index.cache_clear()


def _base_class(base: str) -> type:
    module_name, _, class_name = _BASES[base].partition(":")
    base_class: type = getattr(importlib.import_module(module_name), class_name)
    return base_class


_importing = threading.RLock()
"""Lock for imports: of two threads that import from one package, each may see a half-imported module of the other.

This happens if a controller is loaded while the robot is still starting."""


def _import(info: PluginInfo, module_name: str) -> ModuleType:
    library = str(info.library)
    if info.library != info.source.parent and info.library.is_dir() and library not in sys.path:
        sys.path.append(library)
    try:
        with _importing:
            return importlib.import_module(module_name)
    except Exception as error:
        raise HricError(
            f"plugin {info.name}: cannot import module {module_name} of package {info.package}: {_reason(error)}"
            + (f"; installed engines: {', '.join(filter(find_spec, engines()))}" if info.base == PLANT else "")
        ) from error


def _reason(error: Exception) -> str:
    if isinstance(error, ModuleNotFoundError):
        return f"the Python package {error.name} is not installed"
    return f"{type(error).__name__}: {error}"


def _not_found(base: str, name: str) -> UnknownNameError:
    index = _index(packages_path())
    where = "the packages that export hric_control plugins"
    if index.problems:
        where += f" (could not be read: {'; '.join(index.problems)})"
    return UnknownNameError(base, name, index.plugins[base], where)


def packages_path() -> str:
    """Return the folders of ROS packages, separated by colons: ROS_PACKAGE_PATH, or if unset this workspace's src."""
    path = os.environ.get("ROS_PACKAGE_PATH", "")
    return path if path else str(Path(__file__).resolve().parents[3])


@functools.lru_cache(maxsize=4)
def _index(search_path: str) -> _Index:
    index = _Index()
    seen: set[str] = set()
    for root in search_path.split(os.pathsep):
        for package_xml in _packages(root) if root else ():
            _read_package(package_xml, seen, index)
    return index


def _packages(root: str) -> Iterator[Path]:
    """Yield the package.xml files below `root`, but not below packages or folders with CATKIN_IGNORE."""
    try:
        entries = {entry.name: entry for entry in os.scandir(root)}
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return  # ROS_PACKAGE_PATH may name folders that do not exist (yet); rospack skips them as well
    if "CATKIN_IGNORE" in entries:
        return
    if "package.xml" in entries:
        yield Path(root, "package.xml")
        return
    for name in sorted(entries):
        if not name.startswith(".") and entries[name].is_dir():
            yield from _packages(entries[name].path)


def _read_package(package_xml: Path, seen: set[str], index: _Index) -> None:
    try:
        text = package_xml.read_text(encoding="utf-8")
        if not any(f"<{tag} " in text for tag in EXPORTS):
            return
        root = ET.fromstring(text)
    except (OSError, UnicodeDecodeError, ET.ParseError) as error:
        index.problems.append(f"{package_xml}: {error}")
        return
    package = (root.findtext("name") or package_xml.parent.name).strip()
    if package in seen:  # the first in ROS_PACKAGE_PATH overlays the others
        return
    seen.add(package)
    for export in (export for tag in EXPORTS for export in root.iterfind(f"export/{tag}")):
        source = Path((export.get("plugin") or "").replace("${prefix}", str(package_xml.parent)))
        try:
            _read_plugins(package, source, index)
        except (OSError, ET.ParseError, HricError) as error:
            text = str(error)
            index.problems.append(text if str(source) in text else f"{source}: {text}")


def _read_plugins(package: str, source: Path, index: _Index) -> None:
    root = ET.parse(source).getroot()
    for library in [root] if root.tag == "library" else root.iterfind("library"):
        folder = (source.parent / library.get("path", ".")).resolve()
        for entry in library.iterfind("class"):
            info = _plugin(entry, package, source, folder)
            known = index.plugins[info.base].setdefault(info.name, info)
            if known is not info:
                index.problems.append(f"{source}: {info.name} is exported by {known.source} already")


def _plugin(entry: ET.Element, package: str, source: Path, folder: Path) -> PluginInfo:
    kind, base = entry.get("type", ""), entry.get("base_class_type", "")
    name = entry.get("name", kind)
    if ":" not in kind or base not in _BASES:
        raise HricError(
            f'{source}: class {name!r} needs type="module:Class" and base_class_type, one of {", ".join(_BASES)}'
        )
    description = " ".join((entry.findtext("description") or "").split())
    return PluginInfo(name, kind, base, description, package, source, folder)
