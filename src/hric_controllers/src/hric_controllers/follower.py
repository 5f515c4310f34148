"""Following trajectories in the control loop: when a new one takes over, where the joints should be now, and whether the goal is kept. No ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hric_controllers.spline import Track, follow, hold, stop
from hric_controllers.tolerances import GoalTolerances, first_violation
from hric_controllers.trajectory_message import GOAL_TOLERANCE_VIOLATED, PATH_TOLERANCE_VIOLATED, SUCCESSFUL, Waypoints


@dataclass(frozen=True)
class Order:
    """What the joints shall do next.

    Attributes:
        waypoints: per joint; None: stop.
        start: run time of the trajectory's start [s]; None: when it is taken over.
        goal: whose trajectory it is, reported back when it ends; None for the command topic.
        tolerances: of the goal, None if it has none to keep.
    """

    waypoints: Waypoints | None
    start: float | None = None
    goal: object | None = None
    tolerances: GoalTolerances | None = None


@dataclass(frozen=True)
class Outcome:
    """How a goal ended: error code of FollowJointTrajectoryResult and what to tell the client."""

    goal: object
    code: int
    text: str


class Follower:
    """The desired state of n joints over time; used by the loop alone, except `look`.

    Args:
        joints: names.
        stop_duration: time in which the joints come to rest when told to stop [s].
        continuous: per joint, whether it may turn without end: goals then mean the nearest turn.

    Attributes:
        position, velocity, acceleration: desired, n floats each, of the last `update`.
        position_error, velocity_error: desired minus measured, n floats each.
    """

    def __init__(self, joints: Sequence[str], stop_duration: float, continuous: Sequence[bool] | None = None) -> None:
        self._joints, self._stop_duration = list(joints), stop_duration
        self._continuous = list(continuous) if continuous is not None else [False] * len(self._joints)
        self._tracks: list[Track] = []
        self._settled = False  # every track has ended: the desired state does not change any more
        self._pending: Order | None = None
        self._goal: object | None = None
        self._goal_end = 0.0
        self._tolerances: GoalTolerances | None = None
        zero = [0.0] * len(self._joints)
        self.position, self.velocity, self.acceleration, self.position_error, self.velocity_error = zero, zero, zero, zero, zero

    def rest(self, time: float, position: Sequence[float]) -> None:
        """Forget everything and rest at `position` [rad] from `time` [s] on."""
        self._take([hold(time, value) for value in position])
        self._pending = self._goal = self._tolerances = None

    def order(self, order: Order) -> None:
        """Take an order; it replaces one that has not started yet. The joints go on as before until it starts."""
        self._pending = order
        self._goal = self._tolerances = None

    def look(self, time: float) -> tuple[list[float], list[float], list[float]]:
        """Desired position, velocity and acceleration at any run time [s]; from any thread."""
        p, v, a = zip(*(track.look(time) for track in tuple(self._tracks)), strict=True)
        return list(p), list(v), list(a)

    def update(self, time: float, q: Sequence[float], dq: Sequence[float]) -> Outcome | None:
        """Advance to run time `time` [s].

        Args:
            q, dq: measured position [rad] and velocity [rad/s], n floats each.

        Returns:
            the outcome of a goal that ended in this cycle.
        """
        pending = self._pending
        if pending is not None and (pending.start is None or time >= pending.start):
            self._pending = None
            self._begin(time, pending)
        self._sample(time)
        self.position_error = [d - x for d, x in zip(self.position, q, strict=True)]
        self.velocity_error = [d - x for d, x in zip(self.velocity, dq, strict=True)]
        return self._judge(time, self._tolerances) if self._tolerances is not None else None

    def _sample(self, time: float) -> None:
        if self._settled:
            return
        self._settled = time >= max(track.end for track in self._tracks)
        samples = [track.sample(time) for track in self._tracks]
        self.position = [sample[0] for sample in samples]
        self.velocity = [sample[1] for sample in samples]
        self.acceleration = [sample[2] for sample in samples]

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
                turn = self._turn(index, state[0], points[0].position)
                tracks[index] = follow(time, state, [point.shifted(start, turn) for point in points])
                self._goal_end = max(self._goal_end, tracks[index].end)
        self._take(tracks)
        self._goal, self._tolerances = order.goal, order.tolerances

    def _take(self, tracks: list[Track]) -> None:
        self._tracks, self._settled = tracks, False

    def _turn(self, index: int, here: float, there: float) -> float:
        if not self._continuous[index]:
            return 0.0
        return 2.0 * math.pi * round((here - there) / (2.0 * math.pi))

    def _stop(self, time: float) -> None:
        """Bring every joint to rest from its desired state."""
        states = [track.sample(time) for track in self._tracks]
        self._take([stop(time, position, velocity, self._stop_duration) for position, velocity, _ in states])

    def _judge(self, time: float, tolerances: GoalTolerances) -> Outcome | None:
        if time < self._goal_end:
            text = first_violation(self._joints, tolerances.path, self.position_error, self.velocity_error)
            if not text:
                return None
            self._stop(time)
            self._sample(time)
            return self._end(PATH_TOLERANCE_VIOLATED, f"path tolerance: {text}")
        text = first_violation(self._joints, tolerances.goal, self.position_error, self.velocity_error)
        if not text:
            return self._end(SUCCESSFUL, "")
        allowed = tolerances.goal_time
        if allowed < 0.0 or time < self._goal_end + allowed:
            return None
        return self._end(GOAL_TOLERANCE_VIOLATED, f"goal tolerance: {text}, {time - self._goal_end:.3g} s after the end (allowed {allowed:g} s)")

    def _end(self, code: int, text: str) -> Outcome | None:
        goal, self._goal, self._tolerances = self._goal, None, None
        return None if goal is None else Outcome(goal, code, text)
