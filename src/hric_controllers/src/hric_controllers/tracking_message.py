"""What a tracking controller does, as a message."""

from __future__ import annotations

from typing import Any

from hric_controllers.cartesian_law import Pose
from hric_controllers.equilibrium import fill_pose
from hric_msgs.msg import MarkerTrackingState

Numbers = tuple[int, int, int, dict[str, int]]
"""Losses, ignored, clamped, refused by reason."""


def tracking_state(
    stamp: Any, frame: str, tracking: str, target: Pose, desired: Pose, twist: list[float], measured: Pose, numbers: Numbers
) -> MarkerTrackingState:
    """hric_msgs/MarkerTrackingState of plain values; the arguments are its fields in their order."""
    message = MarkerTrackingState()
    message.header.stamp, message.header.frame_id = stamp, frame
    message.tracking = tracking
    fill_pose(message.target, target)
    fill_pose(message.desired, desired)
    linear, angular = message.desired_twist.linear, message.desired_twist.angular
    linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = twist
    fill_pose(message.measured, measured)
    message.losses, message.ignored, message.clamped, refused = numbers
    message.refused_reasons, message.refused_counts = list(refused), list(refused.values())
    return message
