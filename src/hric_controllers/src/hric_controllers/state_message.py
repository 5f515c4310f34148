"""Desired, actual and error of n joints as control_msgs/JointTrajectoryControllerState; the action's feedback has the same fields."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectoryPoint

Point = tuple[Sequence[float], Sequence[float], Sequence[float], Sequence[float]]
"""Positions [rad or m], velocities, accelerations, efforts [N m or N]; empty where there is nothing to say."""


def build_state(message_type: Any, stamp: Any, joints: Sequence[str], desired: Point, actual: Point) -> Any:
    """The message; error = desired - actual in position and velocity.

    Args:
        message_type: JointTrajectoryControllerState or FollowJointTrajectoryFeedback.
        stamp: time of measurement (genpy.Time).
    """
    error = tuple([d - a for d, a in zip(wanted, measured, strict=True)] for wanted, measured in zip(desired[:2], actual[:2], strict=True))
    return message_type(
        header=Header(stamp=stamp),
        joint_names=list(joints),
        desired=_point(*desired),
        actual=_point(*actual),
        error=JointTrajectoryPoint(positions=error[0], velocities=error[1]),
    )


def _point(positions: Sequence[float], velocities: Sequence[float], accelerations: Sequence[float], effort: Sequence[float]) -> Any:
    return JointTrajectoryPoint(positions=positions, velocities=velocities, accelerations=accelerations, effort=effort)
