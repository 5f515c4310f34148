"""Counterparts in HRIC of the interfaces, topics and calls of ros_control and franka_ros."""

from collections.abc import Iterator
from dataclasses import dataclass, fields

from roslib.message import get_message_class, get_service_class

from franka_hw_interface import interfaces  # noqa: F401  # defines the subclasses that `here` looks for
from franka_hw_interface.robot_state import RobotState
from hric_control.hardware_interface import HardwareInterface
from hric_controllers.porting.reading import Use

AT = "; for another configuration or load, call at(q, dq) or with_load(mass, com, inertia) before"
"""Calls for the model at another configuration or load."""
CALLS = {
    "getRobotState": "robot_state",
    "getMass": f"mass(){AT}",
    "getCoriolis": f"coriolis(){AT}",
    "getGravity": f"gravity(){AT}",
    "getPose": f"pose(frame){AT}",
    "getZeroJacobian": f"zero_jacobian(frame){AT}",
    "getBodyJacobian": f"body_jacobian(frame){AT}",
    "getForce": "force",
    "getTorque": "torque",
    "getFrameId": "frame_id",
    "getPosition": "position",
    "getVelocity": "velocity",
    "getEffort": "effort",
    "setCommand": "command = values; Cartesian: set_command()",
    "getCommand": "command",
    "getName": "name of a handle, names of a group",
}
"""Attribute or method of HRIC's handle, by method of the C++ handle."""
ELSEWHERE = {
    "franka_hw::FrankaModelHandle": "use FrankaModelInterface",
}
"""Replacements for interfaces that HRIC does not have."""
LIBRARIES = {
    "control_toolbox": "write the PID law in update()",
    "tf": "listen in a node, and send the controller poses in its base frame",
    "tf2_ros": "listen in a node, and send the controller poses in its base frame",
    "message_filters": "subscribe to each topic, and match the newest messages in update()",
    "KDL": "use the model interface, or franka_hw_interface.kdl_chain",
    "urdf": "use hric_core.urdf.read",
    "ros": "count the time in update()",
}
"""Replacements for libraries that HRIC does not offer to controllers, by namespace."""


@dataclass(frozen=True)
class Counterpart:
    """Counterpart of a `Use`.

    Attributes:
        exists: True if a controller can use it in HRIC.
        text: its name in HRIC; if it does not exist, what is missing and what to use instead.
        module: module that defines the class to import; empty: nothing is imported.
    """

    exists: bool
    text: str
    module: str = ""


def counterpart(use: Use) -> Counterpart:
    """Return the counterpart in HRIC of something that a controller uses."""
    if use.kind == "interface":
        return _interface(use.name)
    if use.kind == "parameter":
        text = f'{use.node}.param("{use.name.removeprefix("~")}")'
        return Counterpart(True, text if use.is_literal else "a computed name: write it out by hand")
    if use.kind in {"subscriber", "publisher", "service"}:
        return _message(use)
    if use.kind == "service client" or (use.kind, use.type) == ("action", "client"):
        return Counterpart(False, "not in a controller: call it from a node")
    if use.kind == "action":
        return Counterpart(True, f"{use.node}.action_server")
    if use.kind == "live parameters":
        return Counterpart(True, "controller_node.live_parameters, or Settings.offer of hric_core.parameters")
    if use.kind == "call":
        return _call(use)
    if use.kind == "library":
        instead = LIBRARIES.get(use.name.split("::")[0], "use a Python library of the same purpose")
        return Counterpart(False, f"not in HRIC: {instead}")
    if use.kind == "module":
        return Counterpart(False, "cannot be imported here: install it, or add its package to the workspace")
    names = [one.name for one in fields(RobotState)]
    return Counterpart(use.name in names, use.name if use.name in names else "not a field of RobotState")


def _interfaces(base: type[HardwareInterface]) -> Iterator[type[HardwareInterface]]:
    for kind in base.__subclasses__():
        yield kind
        yield from _interfaces(kind)


def _interface(name: str) -> Counterpart:
    """Return HRIC's interface class with this name in ros_control, e.g. hardware_interface::EffortJointInterface."""
    for kind in _interfaces(HardwareInterface):
        if kind.cpp_name == name:
            return Counterpart(True, kind.__name__, kind.__module__)
    instead = ELSEWHERE.get(name, "no robot has it")
    return Counterpart(False, f"not in HRIC: {instead}")


def _message(use: Use) -> Counterpart:
    """Return the Python class of a topic's or service's type."""
    if not use.type:
        return Counterpart(False, "type is not in the source: add it by hand")
    if "/" not in use.type:
        return Counterpart(False, f"{use.type}: its package is not in the source: add it by hand")
    lookup = get_service_class if use.kind == "service" else get_message_class
    kind = lookup(use.type)
    if kind is None:
        return Counterpart(False, f"{use.type} is not built: add its package to the workspace")
    package, name = use.type.split("/")
    return Counterpart(True, name, f"{package}.{'srv' if use.kind == 'service' else 'msg'}")


def _call(use: Use) -> Counterpart:
    if use.name not in CALLS:
        return Counterpart(False, f"{use.type} has no such method in HRIC")
    return Counterpart(True, CALLS[use.name])
