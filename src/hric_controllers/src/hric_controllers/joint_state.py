"""Publishes the state of all joints on `joint_states`, as ros_control's joint_state_controller does."""

from __future__ import annotations

from typing import Any

from sensor_msgs.msg import JointState

from hric_control import realtime
from hric_control.controller import Controller
from hric_control.errors import ParameterError
from hric_control.hardware_interface import JointStateInterface
from hric_control.node import Node
from hric_control.robot_hw import RobotHW
from hric_controllers.parameters import Every, is_number, number


class JointStateController(Controller):
    """sensor_msgs/JointState of every joint of the robot, on `joint_states` of the robot's namespace."""

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Parameters: `publish_rate` (required) and `extra_joints`."""
        self._node = controller_node
        self._group = robot_hw.get(JointStateInterface).group()
        self._time = Every(number(controller_node, "publish_rate", above=0.0))
        extra = [_extra(item, controller_node.resolve("extra_joints"), self._group.names) for item in _list(controller_node)]
        self._names = [*self._group.names, *(name for name, *_ in extra)]
        self._extra = [item[1] for item in extra], [item[2] for item in extra], [item[3] for item in extra]
        self._publisher = realtime.publisher(root_node, "joint_states", JointState)

    def starting(self, time: float) -> None:
        """Publish in the first cycle."""
        self._time.restart()

    def update(self, time: float, period: float) -> None:
        """Publish at the rate."""
        if self._time.due(time):
            stamp, group = self._node.now(), self._group
            position, velocity, effort = group.positions(), group.velocities(), group.efforts()
            more = self._extra
            self._publisher.publish(joint_state, stamp, self._names, position + more[0], velocity + more[1], effort + more[2])

    def shutdown(self) -> None:
        """Stop advertising."""
        self._publisher.unregister()


def joint_state(stamp: Any, names: list[str], position: list[float], velocity: list[float], effort: list[float]) -> JointState:
    """sensor_msgs/JointState; stamp: genpy.Time, the rest as in the message."""
    message = JointState()
    message.header.stamp, message.name = stamp, names
    message.position, message.velocity, message.effort = position, velocity, effort
    return message


def _list(node: Node) -> list[Any]:
    value = node.param("extra_joints", [])
    if not isinstance(value, list):
        raise ParameterError(f"{node.resolve('extra_joints')} is {value!r}; valid: a list of {{name, position, velocity, effort}}")
    return value


def _extra(item: Any, where: str, taken: tuple[str, ...]) -> tuple[str, float, float, float]:
    """One joint that the robot does not measure: name and constant position, velocity, effort (0 by default)."""
    if not isinstance(item, dict) or not isinstance(item.get("name"), str) or item["name"] in taken:
        raise ParameterError(f"{where} has {item!r}; valid: {{name, position, velocity, effort}} with a name that the robot does not have")
    values = [item.get(key, 0.0) for key in ("position", "velocity", "effort")]
    if not all(is_number(value) for value in values):
        raise ParameterError(f"{where} of {item['name']} has {values!r}; valid: finite numbers for position, velocity, effort")
    return item["name"], float(values[0]), float(values[1]), float(values[2])
