"""Trajectory following in the control loop: switch to new trajectories, desired state, tolerances. No ROS."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hric_controllers.trajectory.message import GOAL_TOLERANCE_VIOLATED, PATH_TOLERANCE_VIOLATED, SUCCESSFUL, Waypoints
from hric_controllers.trajectory.spline import SplineTrack, follow, hold, stop
from hric_core.errors import CommandError


@dataclass(frozen=True)
class Tolerance:
    """Maximum allowed errors of one joint; zero means no limit.

    Attributes:
        position: maximum position error [rad or m].
        velocity: maximum velocity error [rad/s or m/s].
    """

    position: float = 0.0
    velocity: float = 0.0

    def violation(self, position_error: float, velocity_error: float) -> str:
        """Return an error that exceeds its maximum as a text, with both values; empty if no error does."""
        if self.position > 0.0 and abs(position_error) > self.position:
            return f"position error {position_error:.6g} exceeds {self.position:.6g}"
        if self.velocity > 0.0 and abs(velocity_error) > self.velocity:
            return f"velocity error {velocity_error:.6g} exceeds {self.velocity:.6g}"
        return ""


@dataclass(frozen=True)
class GoalTolerances:
    """Tolerances of one goal of FollowJointTrajectory.

    Attributes:
        path: tolerance of each joint during the motion.
        goal: tolerance of each joint after the end of the trajectory.
        goal_time: time after the end of the trajectory in which the joints may still come within `goal` [s]; negative
            means no limit.
    """

    path: tuple[Tolerance, ...]
    goal: tuple[Tolerance, ...]
    goal_time: float = 0.0

    def overridden(
        self,
        joints: Sequence[str],
        path: Sequence[Any],
        goal: Sequence[Any],
        goal_time: float,
    ) -> "GoalTolerances":
        """Return these tolerances, replaced where a goal message gives values.

        A value of 0 in the message keeps the present tolerance, a negative value removes the limit.

        Args:
            joints: joint names, in the order of the tolerances.
            path: field `path_tolerance` of the message.
            goal: field `goal_tolerance` of the message.
            goal_time: field `goal_time_tolerance` of the message [s].

        Raises:
            CommandError: a tolerance for a joint that the controller does not have.
        """
        return GoalTolerances(
            _override(joints, self.path, path, "path_tolerance"),
            _override(joints, self.goal, goal, "goal_tolerance"),
            self.goal_time if goal_time == 0.0 else goal_time,
        )

    def only(self, named: Sequence[bool]) -> "GoalTolerances":
        """Return these tolerances, without limits for the joints whose element of `named` is False."""
        path, goal = (
            tuple(item if is_named else Tolerance() for item, is_named in zip(items, named, strict=True))
            for items in (self.path, self.goal)
        )
        return GoalTolerances(path, goal, self.goal_time)


def _override(
    joints: Sequence[str], defaults: Sequence[Tolerance], tolerances: Sequence[Any], field: str
) -> tuple[Tolerance, ...]:
    by_name = {item.name: item for item in tolerances}
    unknown = sorted(set(by_name) - set(joints))
    if unknown:
        raise CommandError(f"{field} names {', '.join(unknown)}; valid: {', '.join(joints)}")
    return tuple(
        Tolerance(_pick(by_name[joint].position, default.position), _pick(by_name[joint].velocity, default.velocity))
        if joint in by_name
        else default
        for joint, default in zip(joints, defaults, strict=True)
    )


def _pick(value: float, default: float) -> float:
    return default if value == 0.0 else max(value, 0.0)


def first_violation(
    joints: Sequence[str],
    tolerances: Sequence[Tolerance],
    position_errors: Sequence[float],
    velocity_errors: Sequence[float],
) -> str:
    """Return the first joint that violates its tolerance as a text with its error, empty if there is none."""
    for joint, tolerance, position, velocity in zip(joints, tolerances, position_errors, velocity_errors, strict=True):
        text = tolerance.violation(position, velocity)
        if text:
            return f"{joint}: {text}"
    return ""


@dataclass(frozen=True)
class Order:
    """Order to follow a trajectory or to stop.

    Attributes:
        waypoints: waypoints per joint; None: order to stop.
        start: robot time at which the trajectory starts [s]; None: as soon as the loop gets the order.
        goal: goal whose outcome is to be reported; None for a trajectory of the topic `command`.
        tolerances: tolerances of the goal; None: none are checked.
    """

    waypoints: Waypoints | None
    start: float | None = None
    goal: object | None = None
    tolerances: GoalTolerances | None = None


@dataclass(frozen=True)
class GoalOutcome:
    """Outcome of a goal.

    Attributes:
        goal: goal that has ended.
        code: error code of FollowJointTrajectoryResult.
        text: reason of a failure, for the client; empty on success.
    """

    goal: object
    code: int
    text: str


class Follower:
    """Follower of trajectories: computes the desired state of n joints and checks tolerances, cycle by cycle.

    Only the control loop may call the methods, except `look`.

    Args:
        joints: joint names.
        stop_duration: time in which an order to stop brings the joints to rest [s].
        continuous: True for each joint that rotates without end, whose waypoints are shifted by whole revolutions so
            that the first one is nearest; None: there is no such joint.

    Attributes:
        position, velocity, acceleration: desired state of the joints after the last `update`, n floats each.
        position_error, velocity_error: desired minus measured state after the last `update`, n floats each.
    """

    def __init__(self, joints: Sequence[str], stop_duration: float, continuous: Sequence[bool] | None = None) -> None:
        self._joints, self._stop_duration = list(joints), stop_duration
        self._continuous = list(continuous) if continuous is not None else [False] * len(self._joints)
        self._tracks: list[SplineTrack] = []
        self._settled = False  # every track has ended: the desired state no longer changes
        self._pending: Order | None = None
        self._goal: object | None = None
        self._goal_end = 0.0
        self._tolerances: GoalTolerances | None = None
        zero = [0.0] * len(self._joints)
        self.position = self.velocity = self.acceleration = self.position_error = self.velocity_error = zero

    def rest(self, time: float, position: Sequence[float]) -> None:
        """Discard all orders and hold the desired state at rest at `position` [rad] from `time` [s] on."""
        self._take([hold(time, value) for value in position])
        self._pending = self._goal = self._tolerances = None

    def order(self, order: Order) -> None:
        """Set the next order, which replaces an earlier one that has not started yet.

        The present motion goes on until the order starts, but the outcome of its goal is no longer reported.
        """
        self._pending = order
        self._goal = self._tolerances = None

    def look(self, time: float) -> tuple[list[float], list[float], list[float]]:
        """Return desired position, velocity and acceleration at any robot time [s]; from any thread."""
        p, v, a = zip(*(track.look(time) for track in tuple(self._tracks)), strict=True)
        return list(p), list(v), list(a)

    def update(self, time: float, q: Sequence[float], dq: Sequence[float], scale: float = 1.0) -> GoalOutcome | None:
        """Compute the desired state and errors of a cycle; return the outcome of the goal if it ends in this cycle.

        Args:
            time: time of the motion [s]; it passes more slowly than robot time if the motion is slowed down.
            q: measured positions, n floats [rad].
            dq: measured velocities, n floats [rad/s].
            scale: present rate of the motion's time relative to robot time, 0 to 1.
        """
        pending = self._pending
        if pending is not None and (pending.start is None or time >= pending.start):
            self._pending = None
            self._begin(time, pending)
        self._sample(time, scale)
        self.position_error = [d - x for d, x in zip(self.position, q, strict=True)]
        self.velocity_error = [d - x for d, x in zip(self.velocity, dq, strict=True)]
        return self._judge(time, scale, self._tolerances) if self._tolerances is not None else None

    def fail(self, time: float, reason: str) -> GoalOutcome | None:
        """End a goal because the robot has stopped by itself, and bring the desired state to rest.

        Return the outcome of the goal with `reason` as its text, None without a goal; `time`: time of the motion [s].
        """
        if self._goal is None:
            return None
        self._stop(time)
        return self._end(PATH_TOLERANCE_VIOLATED, reason)

    def _sample(self, time: float, scale: float) -> None:
        if self._settled:
            return
        self._settled = time >= max(track.end for track in self._tracks)
        samples = [track.sample(time) for track in self._tracks]
        self.position = [sample[0] for sample in samples]
        self.velocity = [sample[1] for sample in samples]
        self.acceleration = [sample[2] for sample in samples]
        if scale != 1.0:
            self.velocity = [scale * velocity for velocity in self.velocity]
            self.acceleration = [scale * scale * acceleration for acceleration in self.acceleration]

    def _begin(self, time: float, order: Order) -> None:
        if order.waypoints is None:
            self._stop(time)
            return
        start = time if order.start is None else order.start
        tracks = self._tracks[:]
        self._goal_end = time
        for index, points in enumerate(order.waypoints):
            if points is not None:
                state = tracks[index].sample(time)
                shift = self._whole_revolutions(index, state[0], points[0].position)
                tracks[index] = follow(time, state, [point.shifted(start, shift) for point in points])
                self._goal_end = max(self._goal_end, tracks[index].end)
        self._take(tracks)
        self._goal, self._tolerances = order.goal, order.tolerances

    def _take(self, tracks: list[SplineTrack]) -> None:
        self._tracks, self._settled = tracks, False

    def _whole_revolutions(self, index: int, here: float, there: float) -> float:
        return 2.0 * math.pi * round((here - there) / (2.0 * math.pi)) if self._continuous[index] else 0.0

    def _stop(self, time: float) -> None:
        """Make the desired state of every joint come to rest, from `time` [s] on."""
        states = [track.sample(time) for track in self._tracks]
        self._take([stop(time, position, velocity, self._stop_duration) for position, velocity, _ in states])

    def _judge(self, time: float, scale: float, tolerances: GoalTolerances) -> GoalOutcome | None:
        if time < self._goal_end:
            text = first_violation(self._joints, tolerances.path, self.position_error, self.velocity_error)
            if not text:
                return None
            self._stop(time)
            self._sample(time, scale)
            return self._end(PATH_TOLERANCE_VIOLATED, f"path tolerance: {text}")
        text = first_violation(self._joints, tolerances.goal, self.position_error, self.velocity_error)
        if not text:
            return self._end(SUCCESSFUL, "")
        allowed = tolerances.goal_time
        if allowed < 0.0 or time < self._goal_end + allowed:
            return None
        return self._end(
            GOAL_TOLERANCE_VIOLATED,
            f"goal tolerance: {text}, {time - self._goal_end:.3g} s after the end (allowed {allowed:g} s)",
        )

    def _end(self, code: int, text: str) -> GoalOutcome | None:
        goal, self._goal, self._tolerances = self._goal, None, None
        return None if goal is None else GoalOutcome(goal, code, text)
