"""Conversion of trajectory_msgs/JointTrajectory to checked waypoints, in the controller's order of joints. No ROS."""

import math
from collections.abc import Sequence
from typing import Any

from hric_controllers.trajectory.spline import Waypoint
from hric_core.errors import CommandError

SUCCESSFUL = 0
INVALID_GOAL = -1
INVALID_JOINTS = -2
OLD_HEADER_TIMESTAMP = -3
PATH_TOLERANCE_VIOLATED = -4
GOAL_TOLERANCE_VIOLATED = -5


class TrajectoryError(CommandError):
    """Error of a trajectory that cannot be followed.

    Args:
        code: error code of control_msgs/FollowJointTrajectoryResult.
        text: the problem and valid values.
    """

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


Waypoints = tuple[tuple[Waypoint, ...] | None, ...]
"""Waypoints of each joint of the controller, with times relative to the trajectory's start [s].

None for a joint that the trajectory does not name.
"""


def read_waypoints(trajectory: Any, joints: Sequence[str], allow_partial: bool) -> Waypoints:
    """Check a trajectory with at least one point and return its waypoints.

    Args:
        trajectory: trajectory_msgs/JointTrajectory, or any object with its fields.
        joints: names of the controller's joints.
        allow_partial: True if the trajectory may omit joints.

    Raises:
        TrajectoryError: wrong joint names, times that do not increase, points with a wrong number of values, or values
            that are not finite.
    """
    names = list(trajectory.joint_names)
    _check_joints(names, joints, allow_partial)
    times = [point.time_from_start.to_sec() for point in trajectory.points]
    _check_times(times)
    for number, point in enumerate(trajectory.points):
        _check_point(number, point, names)
    column = {name: k for k, name in enumerate(names)}
    return tuple(
        tuple(_waypoint(time, point, column[joint]) for time, point in zip(times, trajectory.points, strict=True))
        if joint in column
        else None
        for joint in joints
    )


def _check_joints(names: list[str], joints: Sequence[str], allow_partial: bool) -> None:
    unknown = [name for name in names if name not in joints]
    missing = [] if allow_partial else [joint for joint in joints if joint not in names]
    wrong = [f"unknown {', '.join(unknown)}"] if unknown else []
    wrong += [f"missing {', '.join(missing)}"] if missing else []
    wrong += ["a joint named twice"] if len(set(names)) != len(names) else []
    wrong += ["no joint named"] if not names else []
    if wrong:
        raise TrajectoryError(INVALID_JOINTS, f"joint_names: {'; '.join(wrong)}; valid: {', '.join(joints)}")


def _check_times(times: list[float]) -> None:
    before = -math.inf
    for number, time in enumerate(times):
        if time < 0.0 or time <= before:
            at_least = f"after {before:g} s" if number else "0 s or later"
            raise TrajectoryError(
                INVALID_GOAL, f"points[{number}].time_from_start is {time:g} s; valid: {at_least} (times must increase)"
            )
        before = time


def _check_point(number: int, point: Any, names: list[str]) -> None:
    for field in ("positions", "velocities", "accelerations"):
        values = getattr(point, field)
        if len(values) != len(names) and (values or field == "positions"):
            choice = f"{len(names)} values, one for each joint" + ("" if field == "positions" else ", or none")
            raise TrajectoryError(INVALID_GOAL, f"points[{number}].{field} has {len(values)} values; valid: {choice}")
        bad = [f"{name} {value}" for name, value in zip(names, values, strict=False) if not math.isfinite(value)]
        if bad:
            raise TrajectoryError(INVALID_GOAL, f"points[{number}].{field} has {', '.join(bad)}; valid: finite numbers")


def _waypoint(time: float, point: Any, column: int) -> Waypoint:
    velocity = float(point.velocities[column]) if point.velocities else None
    # A spline can match accelerations only where it matches velocities.
    acceleration = float(point.accelerations[column]) if point.accelerations and velocity is not None else None
    return Waypoint(time, float(point.positions[column]), velocity, acceleration)
