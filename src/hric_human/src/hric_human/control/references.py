"""Reference motions of a human's joints: at rest, from point to point, or computed from a motion of the hand."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from hric_core.errors import ParameterError
from hric_core.geometry import Pose, Vector, compose
from hric_core.geometry.poses import inverse
from hric_core.native import load
from hric_core.parameters import Mistakes, Settings, flag, listing, mapping, number, refused, unknown
from hric_human.control.controller import Person
from hric_human.control.inverse_kinematics import HandSolver, OutOfReachError
from hric_human.hand import Hand, Motion, program_of
from hric_human.hand.programs import with_programs
from hric_human.signals import RestToRest

_compiled = load("hric_human_impedance")
_cubics: Callable[..., bytes] = _compiled.cubics
_cubic: Callable[[bytes, float, float], tuple[list[float], list[float]]] = _compiled.cubic
KNOT = 0.02
"""Time between two hand poses for which joint angles are computed [s] (project default, unconfirmed)."""
Joints = list[float]


class Reference:
    """Desired joint positions and velocities over time; a subclass overrides what it needs."""

    end = math.inf
    """Time from the start of the motion to rest [s]; infinite if unknown."""
    feels = True
    """False if `feel` has no effect and need not be called."""

    def start(self, time: float) -> None:
        """Start the motion at a time [s]."""

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return positions [rad] and velocities [rad/s], n floats each, read-only; called with increasing times [s]."""
        raise NotImplementedError

    def see(self, time: float, position: Vector) -> None:
        """Receive the position [m] of the robot's end effector at `time`."""

    def feel(self, time: float, force: Vector) -> None:
        """Receive the force [N] on the hand at `time`."""


class ReferenceSettings(Settings):
    """Settings of a reference motion of the joints."""

    def reference(self, person: Person) -> Reference:
        """Return the reference motion of these settings for a person. Raises ParameterError."""
        raise NotImplementedError


class Still(Reference):
    """Reference that stays at joint positions q, n floats [rad]."""

    def __init__(self, q: Sequence[float]) -> None:
        self._at = list(q), [0.0] * len(q)

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return the constant positions and zero velocities."""
        return self._at


@dataclass(frozen=True)
class Rest(ReferenceSettings):
    """Settings of a reference that stays in the resting posture."""

    def reference(self, person: Person) -> Reference:
        """Return a reference that stays in the person's resting posture."""
        return Still(person.rest)


class JointPoints(Reference):
    """Minimum-jerk motion of the joints from point to point, at rest at each.

    Args:
        times: increasing times since the start [s].
        rows: joint angles at each time, n floats [rad].
    """

    def __init__(self, times: Sequence[float], rows: Sequence[Joints]) -> None:
        self._path, self._zero, self.end = RestToRest(times, rows), math.inf, times[-1]

    def start(self, time: float) -> None:
        """Set the start time of the motion [s]."""
        self._zero = time

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return the positions and velocities of the minimum-jerk motion."""
        return self._path.at(time - self._zero)


@dataclass(frozen=True)
class JointMotion(ReferenceSettings):
    """Settings of a point-to-point motion of the joints."""

    points: tuple[Mapping[str, float], ...] = listing(
        mapping(number()),
        unit="s, rad",
        text="each with `time` since the start and angles by joint; joints not named keep their angle. Before the "
        "first point's time the body is at the first point",
    )

    def check(self, where: str) -> None:
        """Check that all points have a time and that times increase. Raises ParameterError."""
        if not self.points or any("time" not in row for row in self.points):
            raise ParameterError(f"{where}points must have one row or more, each with time and angles by joint")
        if self.points[0]["time"] < 0 or any(b["time"] <= a["time"] for a, b in pairwise(self.points)):
            raise ParameterError(f"{where}points: the times must increase, and be 0 s or later")

    def reference(self, person: Person) -> Reference:
        """Return the reference motion through the points."""
        mistakes, rows, q = Mistakes(), [], list(person.rest)
        for count, point in enumerate(self.points):
            where = f"{self.prefix}points[{count}]"
            for name, angle in point.items():
                with mistakes.noted():
                    if name != "time":
                        q[_index(name, angle, person, where)] = angle
            rows.append(q.copy())
        mistakes.raise_all()
        return JointPoints([row["time"] for row in self.points], rows)


def _index(name: str, angle: float, person: Person, where: str) -> int:
    """Return the index of a joint whose range contains the angle. Raises ParameterError."""
    if name not in person.joints:
        raise unknown("joint", name, ("time", *person.joints), where)
    index = person.joints.index(name)
    low, high = person.lower[index], person.upper[index]
    if not low <= angle <= high:
        raise refused(f"{where}.{name}", angle, f"from {low:.3f} to {high:.3f} [rad]")
    return index


class AngleRows(Reference):
    """Joint angles at equal intervals, interpolated by cubics with continuous velocity (Catmull-Rom spline).

    Args:
        interval: time between two rows [s].
        rows: joint angles from time 0 on, n floats each [rad]; before and after them the body is at rest.
        more: function that computes the next row when it is needed; None: the motion ends with the last row.
    """

    def __init__(self, interval: float, rows: list[Joints], more: Callable[[], Joints] | None = None) -> None:
        self._interval, self._rows, self._more = interval, rows, more
        self._still, self._piece, self._cubics = [0.0] * len(rows[0]), -1, b""
        self._zero = math.inf
        self.end = math.inf if more else (len(rows) - 1) * interval

    def start(self, time: float) -> None:
        """Set the start time of the motion [s]."""
        self._zero = time

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return the interpolated positions and velocities."""
        since = time - self._zero
        if since <= 0.0:
            return self._rows[0], self._still
        steps = since / self._interval
        piece = int(steps)
        if piece != self._piece:
            while self._more is not None and len(self._rows) < piece + 3:
                self._rows.append(self._more())
            if piece >= len(self._rows) - 1:
                return self._rows[-1], self._still
            self._piece, self._cubics = piece, self._new_cubics(piece)
        return _cubic(self._cubics, steps - piece, 1.0 / self._interval)

    def _new_cubics(self, piece: int) -> bytes:
        """Return the cubics between row `piece` and the next; velocities at rows are central differences."""
        rows = self._rows
        return _cubics(rows[max(piece - 1, 0)], *rows[piece : piece + 2], rows[min(piece + 2, len(rows) - 1)])


class HandReference(Reference):
    """Joint angles for a motion of the hand, by inverse kinematics at knots of equal time interval.

    For a program of known duration all knots are computed at once, so that an unreachable pose is detected before the
    run.

    Args:
        person: person whose hand moves.
        motion: motion of the hand in the world frame.
        oriented: True if the orientation is tracked.

    Raises:
        OutOfReachError: the hand cannot reach a pose of the motion.
    """

    def __init__(self, person: Person, motion: Motion, oriented: bool) -> None:
        self._program = program_of(motion, person.seed)
        self._hand, self._where = Hand(self._program, motion.begin), motion.prefix
        self.feels = self._hand.feels
        self._solver = HandSolver(person.hand, person.lower, person.upper, person.rest, oriented)
        self._T_root_world, self._knots = inverse(person.T_world_root), 0
        self._target, end = self._pose(0), self._program.span[1]
        self.end = motion.begin + end
        if motion not in person.solved:
            self._last = self._first(person.starts, oriented)
            later = range(math.ceil(end / KNOT) if math.isfinite(end) else 0)
            person.solved[motion] = [self._last, *(self._next() for _ in later)]
        rows = person.solved[motion]
        self._last = rows[0]
        self._rows = AngleRows(KNOT, rows.copy(), None if math.isfinite(end) else self._next)

    def start(self, time: float) -> None:
        """Start the program of the hand."""
        self._rows.start(self._hand.start(time))

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return joint positions and velocities, interpolated between the knots."""
        return self._rows.at(time)

    def see(self, time: float, position: Vector) -> None:
        """Pass the position [m] of the robot's end effector to the hand's program."""
        self._hand.see(time, position)

    def feel(self, time: float, force: Vector) -> None:
        """Pass the force [N] on the hand to the hand's program."""
        self._hand.feel(time, force)

    def _pose(self, knot: int) -> Pose:
        return compose(self._T_root_world, self._program.pose(knot * KNOT))

    def _next(self) -> Joints:
        self._knots += 1
        target = self._pose(self._knots)
        if target != self._target:  # the posture of a resting hand must not drift in the null space
            self._target = target
            self._last = self._reached(lambda: self._solver.next(target, self._last))
        return self._last

    def _first(self, starts: dict[object, Joints], oriented: bool) -> Joints:
        if (key := (self._target, oriented)) not in starts:
            posture = self._reached(lambda: self._solver.first(self._target))
            starts.clear()
            starts[key] = posture
        return starts[key]

    def _reached(self, solved: Callable[[], Joints]) -> Joints:
        try:
            return solved()
        except OutOfReachError as error:
            where = self._where.rstrip("./")
            raise OutOfReachError(f"{where}: {self._knots * KNOT:.2f} s after the motion's start, {error}") from None


@dataclass(frozen=True)
class FollowedHand(Motion, ReferenceSettings):
    """Settings of a joint reference that follows a motion program of the hand."""

    oriented: bool = flag(False, text="true: the hand's orientation follows, too")

    def reference(self, person: Person) -> Reference:
        """Return the joint reference that inverse kinematics computes from the hand's motion."""
        return HandReference(person, self, self.oriented)


REFERENCES: dict[str, type[ReferenceSettings]] = {"rest": Rest, "joints": JointMotion, **with_programs(FollowedHand)}
"""Settings classes of references, by the value of `program`."""
