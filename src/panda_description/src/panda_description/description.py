"""Builds the Panda's URDF from xacro, in process and without a ROS master."""

from __future__ import annotations

import inspect
import logging
import re
import sys
import threading
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from math import isfinite
from pathlib import Path
from typing import Any, ParamSpec
from xml.dom import Node, minidom
from xml.parsers.expat import ExpatError

from hric_control.errors import DescriptionError, ParameterError, UnknownNameError
from panda_description import meshes as mesh_files
from panda_description.files import PACKAGE, find_package, share
from panda_description.parameters import INERTIAL_SETS, unphysical

LOG = logging.getLogger("hric.panda_description")
P = ParamSpec("P")
INTERFACES = ("EffortJointInterface", "PositionJointInterface", "VelocityJointInterface")
_XACRO_LOCK = threading.Lock()  # xacro keeps its state in module variables


@dataclass(frozen=True)
class Argument:
    """One argument of `load`: default, what is valid, what it does."""

    default: str | bool | float
    valid: str
    description: str


_DOCS = {
    "arm_id": ("a letter, then letters, digits, _", "prefix of all link and joint names"),
    "hand": ("true, false", "with the Franka hand"),
    "inertials": (", ".join(INERTIAL_SETS), "inertial set; thesis is not physical and for reproducing its figures only"),
    "damping": ("number >= 0 [N m s/rad]", "viscous damping of each joint"),
    "friction": ("none, identified", "Coulomb friction of each joint; a plant that knows the identified sigmoid puts that in its place"),
    "fingers": ("fixed, prismatic", "whether the fingers can move"),
    "xyz": ("three numbers [m]", "position of the base in the world"),
    "rpy": ("three numbers [rad]", "roll, pitch, yaw of the base in the world"),
    "robot_sim_type": ("package/Class", "RobotHW that runs this robot in simulation"),
    "meshes": ("true, false", "draw meshes; false draws the collision primitives"),
    "collision": ("true, false", "with collision capsules"),
    "hardware_interface": (", ".join(INTERFACES) + " (several: separated by spaces)", "hardware interfaces of the transmissions"),
}


def _known_arguments(function: Callable[P, str]) -> Callable[P, str]:
    """Arguments come from files and command lines: one that does not exist gets an error that lists those that do."""

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> str:
        for name in kwargs:
            if name not in _DOCS:
                raise UnknownNameError("argument", name, _DOCS, PACKAGE)
        return function(*args, **kwargs)

    return checked


@_known_arguments
def load(
    *,
    arm_id: str = "panda",
    hand: bool = True,
    inertials: str = "barycentric",
    damping: float = 0.0,
    friction: str = "none",
    fingers: str = "fixed",
    xyz: str | Sequence[float] = "0 0 0",
    rpy: str | Sequence[float] = "0 0 0",
    robot_sim_type: str = "franka_sim/FrankaHWSim",
    meshes: bool = True,
    collision: bool = True,
    hardware_interface: str = "EffortJointInterface",
) -> str:
    """The robot as pure URDF; `arguments()` says what each argument does and accepts.

    Raises:
        UnknownNameError: an argument that does not exist; lists those that do.
        ParameterError: a value that is not valid; names the argument and the valid values.
    """
    given = dict(locals())
    for name, value in given.items():
        _check(name, value)
    if hand is False and fingers == "prismatic":
        raise ParameterError("fingers:=prismatic needs hand:=true")
    _warn_unphysical(inertials)
    del given["meshes"]
    mappings = {name: _text(value) for name, value in given.items()} | {"mesh_folder": mesh_files.folder_uri() if meshes else ""}
    return _pure(process_xacro(share() / "urdf" / "panda.urdf.xacro", mappings), arm_id)


def arguments() -> dict[str, Argument]:
    """The arguments of `load` in order."""
    return {name: Argument(parameter.default, *_DOCS[name]) for name, parameter in inspect.signature(load).parameters.items()}


def _vector(value: Any) -> bool:
    try:
        numbers = [float(part) for part in (value.split() if isinstance(value, str) else value)]
    except (TypeError, ValueError):
        return False
    return len(numbers) == 3 and all(map(isfinite, numbers))


def _amount(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value) and value >= 0.0


_TESTS: dict[str, Callable[[Any], bool]] = {
    "arm_id": lambda value: re.fullmatch(r"[A-Za-z]\w*", str(value), re.ASCII) is not None,
    "hand": lambda value: isinstance(value, bool),
    "inertials": lambda value: value in INERTIAL_SETS,
    "damping": _amount,
    "friction": lambda value: value in ("none", "identified"),
    "fingers": lambda value: value in ("fixed", "prismatic"),
    "xyz": _vector,
    "rpy": _vector,
    "robot_sim_type": lambda value: re.fullmatch(r"[\w/]+", str(value)) is not None,
    "meshes": lambda value: isinstance(value, bool),
    "collision": lambda value: isinstance(value, bool),
    "hardware_interface": lambda value: bool(str(value).split()) and set(str(value).split()) <= set(INTERFACES),
}


def _check(name: str, value: object) -> None:
    if not _TESTS[name](value):
        raise ParameterError(f"argument {name} of the Panda's description is {value!r}; valid: {_DOCS[name][0]}")


def _text(value: object) -> str:
    if isinstance(value, list | tuple):
        return " ".join(map(str, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _warn_unphysical(name: str) -> None:
    broken = unphysical(name)
    if broken:
        lines = "; ".join(f"{part} {' and '.join(reasons)}" for part, reasons in broken.items())
        LOG.warning("inertials '%s' are not physical: %s. Use them to reproduce the thesis only; the default is 'barycentric'.", name, lines)


def xacro_module() -> Any:
    """xacro 2, whose $(find) asks ROS 2's index: answer it with this package's folder or ROS 1's packages."""
    if "ament_index_python.packages" not in sys.modules:
        packages = types.ModuleType("ament_index_python.packages")
        packages.get_package_share_directory = lambda name: str(share()) if name == PACKAGE else find_package(name)  # type: ignore[attr-defined]
        index = types.ModuleType("ament_index_python")
        index.packages = packages  # type: ignore[attr-defined]
        sys.modules |= {"ament_index_python": index, "ament_index_python.packages": packages}
    import xacro

    return xacro


def process_xacro(path: Path, mappings: dict[str, str]) -> minidom.Document:
    """Any xacro file, in process; its $(find) knows ROS 1's packages.

    Args:
        path: the file.
        mappings: its arguments.

    Raises:
        DescriptionError: what xacro says, with the name of the file.
    """
    with _XACRO_LOCK:
        xacro = xacro_module()
        try:
            document: minidom.Document = xacro.process_file(str(path), mappings=mappings)
        except (xacro.XacroException, ExpatError) as error:
            raise DescriptionError(f"{path.name}: {error}") from error
    return document


def _pure(document: minidom.Document, name: str) -> str:
    """Pure URDF text: the robot named, without the comments and the namespace of the xacro files."""
    _drop_comments(document)
    root: Any = document.documentElement
    root.setAttribute("name", name)
    for attribute in [name for name in root.attributes.keys() if name.startswith("xmlns:")]:  # noqa: SIM118 - a NamedNodeMap is no dict
        root.removeAttribute(attribute)
    return str(document.toprettyxml(indent="  "))


def _drop_comments(node: Any) -> None:
    for child in list(node.childNodes):
        if child.nodeType == Node.COMMENT_NODE:
            node.removeChild(child)
        else:
            _drop_comments(child)
