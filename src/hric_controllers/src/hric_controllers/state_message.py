"""Desired, actual and error of n joints as control_msgs/JointTrajectoryControllerState; the action's feedback has the same fields."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

Point = tuple[Sequence[float], Sequence[float], Sequence[float], Sequence[float]]
"""Positions [rad or m], velocities, accelerations, efforts [N m or N]; empty where there is nothing to say."""


def build_state(message_type: Any, stamp: Any, joints: Sequence[str], desired: Point, actual: Point) -> Any:
    """The message; error = desired - actual in position and velocity.

    Args:
        message_type: JointTrajectoryControllerState or FollowJointTrajectoryFeedback.
        stamp: time of measurement (genpy.Time).
        joints: names.
        desired, actual: n values in each part that is not empty.
    """
    # Fields are set one by one: constructors with arguments check them all and cost four times as much.
    message = message_type()
    message.header.stamp = stamp
    message.joint_names = list(joints)
    _fill(message.desired, desired)
    _fill(message.actual, actual)
    message.error.positions = [d - a for d, a in zip(desired[0], actual[0], strict=True)]
    message.error.velocities = [d - a for d, a in zip(desired[1], actual[1], strict=True)]
    return message


def _fill(point: Any, values: Point) -> None:
    point.positions, point.velocities, point.accelerations, point.effort = values
