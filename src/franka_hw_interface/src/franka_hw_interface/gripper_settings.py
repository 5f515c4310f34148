"""Parameters of the gripper's node, with the names and defaults of franka_ros's franka_gripper."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from hric_control.errors import ParameterError
from hric_control.node import Node


@dataclass(frozen=True)
class GripperSettings:
    """What the actions need to know; defaults of franka_gripper 0.10.1.

    Attributes:
        joint_names: of the two fingers.
        publish_rate: of the joint states [Hz].
        default_speed: of `gripper_action` [m/s].
        epsilon_inner, epsilon_outer: of `gripper_action`: how much narrower and wider than expected an object may be [m].
        robot_joint_states: topic that gets the fingers' joint states as well, e.g. that of the whole robot; empty: none.
    """

    joint_names: tuple[str, str] = ("panda_finger_joint1", "panda_finger_joint2")
    publish_rate: float = 30.0
    default_speed: float = 0.1
    epsilon_inner: float = 0.005
    epsilon_outer: float = 0.005
    robot_joint_states: str = ""


def read_settings(node: Node) -> GripperSettings:
    """`joint_names` (else those of `arm_id`), `publish_rate`, `default_speed`, `default_grasp_epsilon/inner` and `/outer`, `robot_joint_states`.

    Raises:
        ParameterError: one is not valid; the message gives its name and what would be.
    """
    rule = GripperSettings()
    arm_id = node.param("arm_id", "panda")
    if not isinstance(arm_id, str) or not arm_id:
        raise ParameterError(f"{node.resolve('arm_id')} is {arm_id!r}; valid: the arm's name, e.g. panda")
    names = node.param("joint_names", [f"{arm_id}_finger_joint1", f"{arm_id}_finger_joint2"])
    if not isinstance(names, list | tuple) or len(names) != 2 or not all(isinstance(name, str) and name for name in names):
        raise ParameterError(f"{node.resolve('joint_names')} is {names!r}; valid: the names of the two finger joints")
    topic = node.param("robot_joint_states", rule.robot_joint_states)
    if not isinstance(topic, str):
        raise ParameterError(f"{node.resolve('robot_joint_states')} is {topic!r}; valid: a topic, e.g. /joint_states, or an empty text")
    return GripperSettings(
        (names[0], names[1]),
        _number(node, "publish_rate", rule.publish_rate, positive=True),
        _number(node, "default_speed", rule.default_speed, positive=True),
        _number(node, "default_grasp_epsilon/inner", rule.epsilon_inner),
        _number(node, "default_grasp_epsilon/outer", rule.epsilon_outer),
        topic,
    )


def _number(node: Node, name: str, default: float, positive: bool = False) -> float:
    value: Any = node.param(name, default)
    valid = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value >= 0.0
    if not valid or (positive and value == 0.0):
        raise ParameterError(f"{node.resolve(name)} is {value!r}; valid: a finite number {'above 0' if positive else 'not below 0'}")
    return float(value)
