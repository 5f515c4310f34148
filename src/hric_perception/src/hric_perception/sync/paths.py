"""Paths to values of a message: `position[panda_joint1]`, `rigid_bodies[hand].pose`, `wrench.force`. No ROS.

A path names a field; if the field has further fields, the path means all numbers below it. Brackets choose elements of
an array by index or name, several with commas. Names of elements are their fields `name` in a list of messages, and the
message's list of names for a list of numbers.
"""

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hric_core.errors import HricError, UnknownNameError

FLOATS = ("float32", "float64")
WHOLES = ("bool", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "byte", "char")
QUATERNION = "geometry_msgs/Quaternion"
NAME_FIELDS = ("name", "names", "joint_names", "channels", "labelled_marker_names")
"""Fields with a list of strings that names the elements of other lists in the message."""
_PART = re.compile(r"(?P<field>[A-Za-z_]\w*)(?:\[(?P<chosen>[^\[\]]*)\])?$")
_ARRAY = re.compile(r"(?P<element>[^\[]+)\[(?P<length>\d*)\]$")


class PathError(HricError):
    """Error of a path that cannot be read; the message says what is wrong and shows a valid one."""


@dataclass(frozen=True)
class PathStep:
    """Step from a message to one of its fields.

    Attributes:
        field: name of the field.
        element: element of an array field, by index or name; None: the field is not an array.
        names: list in the same message in which a name is looked up; empty: the elements have a field `name`.
    """

    field: str
    element: int | str | None = None
    names: str = ""

    def __str__(self) -> str:
        return self.field if self.element is None else f"{self.field}[{self.element}]"


@dataclass(frozen=True)
class Leaf:
    """Number in a message, and the path to it.

    Attributes:
        steps: steps from the message to the number.
        kind: ROS type of the number.
        quaternion: True if it belongs to a quaternion of which all components are chosen.
        part: True if it belongs to a quaternion of which other components are left out.
        unit: unit that the message type prescribes; empty: not known.
    """

    steps: tuple[PathStep, ...]
    kind: str
    quaternion: bool = False
    part: bool = False
    unit: str = ""

    def __str__(self) -> str:
        return ".".join(map(str, self.steps))


def message_class(name: str, where: str) -> Any:
    """Return the class of a message type, which must have a header.

    Raises:
        PathError: there is no such type, or it has no header with the time of measurement.
    """
    try:
        message_type = _class_of(name)
    except Exception as error:
        raise PathError(
            f"{where} is {name!r}: {error}; valid: a message type that is built, such as sensor_msgs/JointState"
        ) from None
    if message_type is None:
        raise PathError(f"{where} is {name!r}; valid: a message type that is built, such as sensor_msgs/JointState")
    if "header" not in message_type.__slots__:
        raise PathError(
            f"{where} is {name!r}, which has no header and so no time of measurement; valid: a type with a header"
        )
    return message_type


def _class_of(name: str) -> Any:
    from roslib.message import get_message_class  # imported here: tools without ROS use `UNITS`

    return get_message_class(name)


def leaves(message_type: Any, path: str, where: str) -> list[Leaf]:
    """Return the numbers that a path names, in the order of the message's definition.

    Args:
        message_type: class of the message.
        path: path, such as "rigid_bodies[hand].pose".
        where: name of the path, for error messages.

    Raises:
        HricError: the path names no field, or a field that is not numeric.
    """
    parts = [_PART.match(part.strip()) for part in re.split(r"\.(?![^\[]*\])", path)]
    if not all(parts):
        raise PathError(
            f"{where} is {path!r}; valid: fields with dots in between and elements in brackets, such as "
            "rigid_bodies[hand].pose"
        )
    alternatives: list[list[tuple[str, str | None]]] = []
    for part in parts:
        assert part is not None
        chosen = part["chosen"]
        names = [None] if chosen is None else [name.strip() for name in chosen.split(",")]
        alternatives.append([(part["field"], name) for name in names])
    numbers: list[Leaf] = []
    for choice in itertools.product(*alternatives):
        numbers += _walk(message_type, list(choice), (), f"{where}, {path!r}", "")
    return numbers


def _walk(
    message_type: Any, choice: list[tuple[str, str | None]], steps: tuple[PathStep, ...], where: str, unit: str
) -> Iterator[Leaf]:
    (field, chosen), rest = choice[0], choice[1:]
    if field not in message_type.__slots__:
        raise UnknownNameError("field", field, message_type.__slots__, f"{message_type._type} ({where})")
    kind = message_type._slot_types[message_type.__slots__.index(field)]
    unit = UNITS.get((message_type._type, field), unit)
    array = _ARRAY.match(kind)
    if array is None:
        if chosen is not None:
            raise PathError(f"{where}: {field} of {message_type._type} is not a list; valid: {field} without brackets")
        yield from _down(kind, message_type, rest, (*steps, PathStep(field)), where, unit)
        return
    for element in [chosen] if chosen is not None else _all(array, field, message_type, where):
        step = _element(field, element, array, message_type, where)
        yield from _down(array["element"], message_type, rest, (*steps, step), where, unit)


def _all(array: re.Match[str], field: str, message_type: Any, where: str) -> list[str]:
    if not array["length"]:
        raise PathError(
            f"{where}: {field} of {message_type._type} is a list of any length; valid: its elements in brackets, "
            f"such as {field}[0]"
        )
    return [str(index) for index in range(int(array["length"]))]


def _element(field: str, chosen: str, array: re.Match[str], message_type: Any, where: str) -> PathStep:
    if chosen.isdigit():
        if array["length"] and int(chosen) >= int(array["length"]):
            raise PathError(
                f"{where}: {field} of {message_type._type} has {array['length']} elements; valid: 0 to "
                f"{int(array['length']) - 1}"
            )
        return PathStep(field, int(chosen))
    if not chosen:
        raise PathError(f"{where}: empty brackets after {field}; valid: indices or names, separated by commas")
    if "/" in array["element"] and "name" in _class_of(array["element"]).__slots__:
        return PathStep(field, chosen)
    for name, kind in zip(message_type.__slots__, message_type._slot_types, strict=True):
        if name in NAME_FIELDS and kind == "string[]" and name != field:
            return PathStep(field, chosen, name)
    raise PathError(f"{where}: {message_type._type} has no names for the elements of {field}; valid: indices from 0")


def _down(
    kind: str, parent: Any, rest: list[tuple[str, str | None]], steps: tuple[PathStep, ...], where: str, unit: str
) -> Iterator[Leaf]:
    if kind in FLOATS or kind in WHOLES:
        if rest:
            raise PathError(
                f"{where}: {steps[-1].field} of {parent._type} is a number, which has no field {rest[0][0]!r}"
            )
        yield Leaf(steps, kind, part=parent._type == QUATERNION, unit=unit)
        return
    inner = _class_of(kind) if "/" in kind else None
    if inner is None:
        raise PathError(f"{where}: {steps[-1].field} of {parent._type} is a {kind}, not a number")
    if rest:
        yield from _walk(inner, rest, steps, where, unit)
    elif kind == QUATERNION:
        yield from (Leaf((*steps, PathStep(name)), "float64", quaternion=True, unit="1") for name in inner.__slots__)
    else:
        for field in inner.__slots__:
            yield from _walk(inner, [(field, None)], steps, where, unit)


_JOINTS = {"position": "rad", "velocity": "rad/s", "effort": "N m"}
_FRANKA = {
    **dict.fromkeys(("q", "q_d", "theta"), "rad"),
    **dict.fromkeys(("dq", "dq_d", "dtheta"), "rad/s"),
    **dict.fromkeys(("tau_J", "tau_J_d", "tau_ext_hat_filtered"), "N m"),
    "ddq_d": "rad/s^2",
    "dtau_J": "N m/s",
}

UNITS: dict[tuple[str, str], str] = {
    **{("sensor_msgs/JointState", field): unit for field, unit in _JOINTS.items()},
    **{("hric_msgs/ControlLog", field): unit for field, unit in _JOINTS.items()},
    **{("franka_msgs/FrankaState", field): unit for field, unit in _FRANKA.items()},
    ("geometry_msgs/Pose", "position"): "m",
    ("geometry_msgs/Pose", "orientation"): "1",
    ("geometry_msgs/Transform", "translation"): "m",
    ("geometry_msgs/Transform", "rotation"): "1",
    ("geometry_msgs/PointStamped", "point"): "m",
    ("geometry_msgs/Wrench", "force"): "N",
    ("geometry_msgs/Wrench", "torque"): "N m",
    ("geometry_msgs/Twist", "linear"): "m/s",
    ("geometry_msgs/Twist", "angular"): "rad/s",
    ("sensor_msgs/Imu", "orientation"): "1",
    ("sensor_msgs/Imu", "angular_velocity"): "rad/s",
    ("sensor_msgs/Imu", "linear_acceleration"): "m/s^2",
    ("hric_msgs/MocapData", "labelled_markers"): "m",
    ("hric_msgs/MocapData", "marker_sizes"): "m",
    ("hric_msgs/MocapData", "latency"): "s",
    ("hric_msgs/RigidBodyState", "mean_error"): "m",
}
"""(message type, field) -> unit of the field and of all numbers below it, unless a nested type overrides it."""
