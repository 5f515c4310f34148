"""URDF of the Panda, expanded from xacro within this process without a ROS master; and the command `urdf`."""

import argparse
import logging
import re
import sys
import threading
import types
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache, partial
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import Any
from xml.dom import Node, minidom

from hric_core import resources
from hric_core.command import Argument, Command
from hric_core.errors import DescriptionError, HricError, ParameterError, UnknownNameError
from hric_core.kept import CacheEntry, cache_folder
from hric_core.parameters import Parameter, Settings, choice, declared, flag, number, numbers, refused, text
from panda_description.inertial_sets import INERTIAL_SETS, unphysical
from panda_description.parameters import LIMIT_SETS, LOG, PACKAGE, find_package, folder_uri, share

_BOOLS = {"true": True, "1": True, "false": False, "0": False}
INTERFACES = ("EffortJointInterface", "PositionJointInterface", "VelocityJointInterface")
_XACRO_LOCK = threading.Lock()  # xacro has its state in module variables


def _vector(unit: str, description: str) -> Any:
    """Return a parameter of three numbers; a list or a text is accepted, the value is a text such as "0 0 0"."""

    def convert(value: Any, where: str, joints: Sequence[str]) -> str:
        parts = value.split() if isinstance(value, str) else value
        if not isinstance(parts, list | tuple) or len(parts) != 3 or not all(isfinite(float(part)) for part in parts):
            raise ValueError
        numbers(3, unit=unit).checked([float(part) for part in parts], where)
        return value if isinstance(value, str) else " ".join(map(str, value))

    return Parameter("three floats", "three numbers", convert, "0 0 0", unit=unit, text=description)


def _matching(pattern: str, name: str) -> str:
    if not re.fullmatch(pattern, name, re.ASCII):
        raise ValueError
    return name


def _interfaces(words: str) -> str:
    if not words.split() or not set(words.split()) <= set(INTERFACES):
        raise ValueError
    return words


@dataclass(frozen=True)
class Arguments(Settings):
    """Arguments of the Panda's robot description, e.g. for `load` and the command `urdf`."""

    arm_id: str = text(
        "panda",
        valid="a letter, then letters, digits, _",
        made=partial(_matching, r"[A-Za-z]\w*"),
        text="prefix of all link and joint names",
    )
    hand: bool = flag(True, text="with the Franka hand")
    inertials: str = choice(
        *INERTIAL_SETS,
        text="inertial set. `barycentric`: identified and published values, with tensors about the centres of mass "
        "(Gaz et al., RA-L 2019). `fr3`: links of the Franka Research 3 as published by its maker. `thesis`: not "
        "physical, only for reproducing the figures of the thesis; loading it warns link by link "
        "(logger `hric.panda_description`)",
    )
    limits: str = choice(
        *LIMIT_SETS, text="position range, velocity and effort of the joints: those of the Panda, or of the FR3"
    )
    damping: float = number(0.0, minimum=0.0, unit="N m s/rad", text="viscous damping, the same on each joint")
    friction: str = choice(
        "none",
        "identified",
        text="`identified` writes the published Coulomb friction into `<dynamics friction>`; a plant with the "
        "identified sigmoid friction law, `friction_parameters()`, uses this law instead",
    )
    fingers: str = choice("fixed", "prismatic", text="type of the finger joints; they have no transmission")
    xyz: str = _vector("m", "position of the base in `world`")
    rpy: str = _vector("rad", "roll, pitch, yaw of the base in `world`")
    robot_sim_type: str = text(
        "franka_sim/FrankaHWSim",
        valid="package/Class",
        made=partial(_matching, r"[\w/]+"),
        text="RobotHW that runs this robot in simulation",
    )
    meshes: bool = flag(
        True,
        text="draw the meshes of the installed pybullet_data (Apache License 2.0); `false`, or where it is "
        "missing: the capsules",
    )
    collision: bool = flag(True, text="with collision capsules")
    hardware_interface: str = text(
        "EffortJointInterface",
        valid=f"{', '.join(INTERFACES)} (several: separated by spaces)",
        made=_interfaces,
        text="hardware interfaces of the transmissions, several separated by spaces",
    )

    def check(self, where: str) -> None:
        """Raise an error for movable fingers without a hand."""
        if not self.hand and self.fingers == "prismatic":
            raise refused(f"{where}fingers", self.fingers, "fixed, as it needs hand:=true")


@dataclass(frozen=True)
class DescriptionArgument:
    """Argument of the robot description: default, valid values, and meaning."""

    default: str | bool | float
    valid: str
    description: str


def load(**arguments: Any) -> str:
    """Return the Panda as URDF, expanded from xacro; `arguments()` describes the arguments.

    Raises:
        UnknownNameError: an argument does not exist; the text lists the existing ones.
        ParameterError: a value is not valid; the text has the argument and its valid values.
    """
    values = Arguments.of(arguments, PACKAGE)
    _warn_unphysical(values.inertials)
    return _described(values, folder_uri() if values.meshes else "")


@cache
def _described(values: Arguments, mesh_folder: str) -> str:
    mappings = {name: _text(value) for name, value in asdict(values).items() if name != "meshes"}
    mappings["mesh_folder"] = mesh_folder
    entry = CacheEntry(cache_folder("descriptions"), _sources(mappings), ".urdf")
    if (kept := entry.read()) is not None:
        return kept.decode()
    described = _pure(process_xacro(share() / "urdf" / "panda.urdf.xacro", mappings), values.arm_id)
    entry.write(described.encode())
    return described


def _sources(mappings: Mapping[str, str]) -> Iterator[bytes]:
    """Yield everything on which the description depends: arguments, xacro files, their YAML files, and the programs."""
    yield repr([sys.version_info[:2], sorted(mappings.items())]).encode()
    found = find_spec("xacro")
    programs = [Path(__file__), *([Path(found.origin)] if found and found.origin else [])]
    for path in [*programs, *sorted(share().glob("urdf/*")), *sorted(share().glob("config/*.yaml"))]:
        yield path.read_bytes()


def arguments() -> dict[str, DescriptionArgument]:
    """Return the arguments of `load` by name, with default, valid values and meaning."""
    return {
        name: DescriptionArgument(item.default, item.valid, item.text) for name, item in declared(Arguments).items()
    }


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _warn_unphysical(name: str) -> None:
    broken = unphysical(name)
    if broken:
        lines = "; ".join(f"{part} {' and '.join(reasons)}" for part, reasons in broken.items())
        LOG.warning(
            "inertials '%s' are not physical: %s. Use them to reproduce the thesis only; the default is 'barycentric'.",
            name,
            lines,
        )


def xacro_module() -> Any:
    """Import xacro 2 so that its $(find PACKAGE) finds ROS 1 packages and this one; return the module.

    xacro 2 is made for ROS 2 and would search the ROS 2 package index.
    """
    if "ament_index_python.packages" not in sys.modules:
        packages = types.ModuleType("ament_index_python.packages")
        packages.get_package_share_directory = lambda name: str(share()) if name == PACKAGE else find_package(name)  # type: ignore[attr-defined]
        index = types.ModuleType("ament_index_python")
        index.packages = packages  # type: ignore[attr-defined]
        sys.modules |= {"ament_index_python": index, "ament_index_python.packages": packages}
    import xacro

    return xacro


def process_xacro(path: Path, mappings: dict[str, str]) -> minidom.Document:
    """Expand a xacro file within this process and return the document; $(find PACKAGE) finds ROS 1 packages.

    Args:
        path: xacro file.
        mappings: values of the file's xacro arguments.

    Raises:
        DescriptionError: xacro cannot expand the file; the text has the file's name and the reason.
    """
    with _XACRO_LOCK:
        xacro = xacro_module()
        try:
            document: minidom.Document = xacro.process_file(str(path), mappings=mappings)
        except RecursionError as error:
            raise DescriptionError(f"{path.name}: a file includes itself or a macro calls itself") from error
        except Exception as error:  # xacro raises errors of any type, e.g. UnicodeDecodeError
            raise DescriptionError(f"{path.name}: {'; '.join(str(error).splitlines())}") from error
    return document


def load_file(address: str) -> str:
    """Return the URDF in another robot's file, expanded if it is a xacro file; `address`: a path or package://...

    Raises:
        DescriptionError: the file is not usable.
    """
    try:
        path = resources.resolve(address)
        if path.suffix == ".xacro":
            return resources.anchored(str(process_xacro(path, {}).toxml()), path.parent)
        return resources.read_description(path)
    except HricError as error:
        raise DescriptionError(f"cannot read the robot description {address}: {error}") from error


def _pure(document: minidom.Document, name: str) -> str:
    """Return the URDF text with the robot's name, without the comments and the namespace of the xacro files."""
    _drop_comments(document)
    root: Any = document.documentElement
    root.setAttribute("name", name)
    if root.hasAttribute("xmlns:xacro"):  # from an included file
        root.removeAttribute("xmlns:xacro")
    return str(document.toprettyxml(indent="  "))


def _drop_comments(node: Any) -> None:
    for child in list(node.childNodes):
        if child.nodeType == Node.COMMENT_NODE:
            node.removeChild(child)
        else:
            _drop_comments(child)


def parse(words: Sequence[str]) -> dict[str, object]:
    """Return arguments for `load`, parsed from command-line words such as `hand:=false`.

    Raises:
        UnknownNameError: an argument does not exist; the text lists the existing ones.
        ParameterError: a word has no :=, an argument is given twice, or a value is not valid.
    """
    valid = declared(Arguments)
    values: dict[str, object] = {}
    for word in words:
        name, separator, value = word.partition(":=")
        if not separator:
            raise ParameterError(f"{word!r} is not of the form ARG:=VALUE; arguments: {', '.join(valid)}")
        if name not in valid:
            raise UnknownNameError("argument", name, valid)
        if name in values:
            raise ParameterError(f"argument {name} is given more than once; valid: each once")
        values[name] = valid[name].checked(_value(value, valid[name].kind), f"argument {name}")
    return values


def _value(word: str, kind: str) -> Any:
    if kind == "bool":
        return _BOOLS.get(word.strip().lower(), word)
    with suppress(ValueError):
        return float(word) if kind == "float" else word
    return word


class UrdfCommand(Command):
    """Print the Panda's robot description as URDF (expanded xacro)."""

    epilog = "arguments:\n" + "\n".join(
        f"  {name}:={_text(parameter.default)}\n      {parameter.text}; {parameter.valid}"
        for name, parameter in declared(Arguments).items()
    )

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        names = [f"{name}:=" for name in declared(Arguments)]
        return [Argument("arguments", nargs="*", metavar="ARG:=VALUE", help="listed below", complete=lambda: names)]

    def run(self, arguments: argparse.Namespace) -> None:
        """Print the URDF; warnings go to stderr."""
        logging.basicConfig(format="%(levelname)s: %(message)s")
        print(load(**parse(arguments.arguments)))
