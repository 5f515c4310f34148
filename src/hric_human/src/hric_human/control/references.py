"""References of the joints of a human: at rest, from point to point, or computed from a motion of the hand."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from hric_core.errors import ParameterError
from hric_core.geometry import Pose, Vector, compose
from hric_core.geometry.poses import inverse
from hric_core.parameters import Mistakes, Settings, flag, listing, mapping, number, refused, unknown
from hric_human.control.controller import Person
from hric_human.control.inverse_kinematics import HandSolver, OutOfReachError
from hric_human.hand import Hand, Motion, program_of
from hric_human.hand.programs import with_programs
from hric_human.signals import RestToRest

KNOT = 0.02
"""Time between two hand poses for which joint angles are computed [s] (project default, unconfirmed)."""
Joints = list[float]


class Reference:
    """Joint positions and velocities over time; a subclass overrides what it needs."""

    end = math.inf
    """Time at which the motion has come to rest, after its start [s]; infinite: unknown."""

    def start(self, time: float) -> None:
        """Start the motion at a time [s]."""

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return positions [rad] and velocities [rad/s], n floats each, read-only; called with increasing times [s]."""
        raise NotImplementedError

    def see(self, time: float, position: Vector) -> None:
        """Receive the position [m] of the robot's end effector at `time`."""

    def feel(self, time: float, force: Vector) -> None:
        """Receive the force [N] on the hand."""


class ReferenceSettings(Settings):
    """Settings of a reference."""

    def reference(self, person: Person) -> Reference:
        """Return the reference of these settings. Raises ParameterError."""
        raise NotImplementedError


class Still(Reference):
    """Constant reference; q: n floats [rad]."""

    def __init__(self, q: Sequence[float]) -> None:
        self._at = list(q), [0.0] * len(q)

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return the constant positions and zero velocities."""
        return self._at


@dataclass(frozen=True)
class Rest(ReferenceSettings):
    """Reference that stays in the resting posture."""

    def reference(self, person: Person) -> Reference:
        """Return the constant reference at rest."""
        return Still(person.rest)


class JointPoints(Reference):
    """Minimum-jerk motion from point to point, at rest at each.

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
    """Point-to-point motion of the joints."""

    points: tuple[Mapping[str, float], ...] = listing(
        mapping(number()),
        unit="s, rad",
        text="each with `time` since the start and angles by joint; joints not named stay. Before the first point the "
        "body is at it",
    )

    def check(self, where: str) -> None:
        """Check that all points have a time and that times increase. Raises ParameterError."""
        if not self.points or any("time" not in row for row in self.points):
            raise ParameterError(f"{where}points must have one row or more, each with time and angles by joint")
        if self.points[0]["time"] < 0 or any(b["time"] <= a["time"] for a, b in pairwise(self.points)):
            raise ParameterError(f"{where}points: the times must rise, from 0 s on")

    def reference(self, person: Person) -> Reference:
        """Return the reference through the points."""
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
    """Joint angles at even times, joined by cubics with continuous velocity (Catmull and Rom).

    Args:
        interval: time between two rows [s].
        rows: rows from the time 0 on, n floats each [rad]; before and after them the body rests.
        more: function that returns the row after the last; None: there is none.
    """

    def __init__(self, interval: float, rows: list[Joints], more: Callable[[], Joints] | None = None) -> None:
        self._interval, self._rows, self._more = interval, rows, more
        self._still, self._piece = [0.0] * len(rows[0]), -1
        self._cubics: list[tuple[float, float, float, float]] = []
        self._zero = math.inf
        self.end = math.inf if more else (len(rows) - 1) * interval

    def start(self, time: float) -> None:
        """Set the start time of the motion [s]."""
        self._zero = time

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return the interpolated positions and velocities."""
        return self.since(time - self._zero)

    def since(self, time: float) -> tuple[Joints, Joints]:
        """Return positions and velocities at a time since the first row [s]."""
        if time <= 0.0:
            return self._rows[0], self._still
        steps = time / self._interval
        piece = int(steps)
        if piece != self._piece:
            while self._more is not None and len(self._rows) < piece + 3:
                self._rows.append(self._more())
            if piece >= len(self._rows) - 1:
                return self._rows[-1], self._still
            self._piece, self._cubics = piece, _cubics(self._rows, piece)
        u, rate = steps - piece, 1.0 / self._interval
        return (
            [a + u * (b + u * (c + u * d)) for a, b, c, d in self._cubics],
            [rate * (b + u * (2.0 * c + 3.0 * u * d)) for _, b, c, d in self._cubics],
        )


def _cubics(rows: Sequence[Joints], piece: int) -> list[tuple[float, float, float, float]]:
    """Return the cubic's coefficients per joint after a row; end velocities are chords over two pieces."""
    before, start = rows[max(piece - 1, 0)], rows[piece]
    goal, after = rows[piece + 1], rows[min(piece + 2, len(rows) - 1)]
    coefficients = []
    for p, a, b, n in zip(before, start, goal, after, strict=True):
        v, w = 0.5 * (b - p), 0.5 * (n - a)
        coefficients.append((a, v, 3.0 * (b - a) - 2.0 * v - w, 2.0 * (a - b) + v + w))
    return coefficients


class HandReference(Reference):
    """Joint angles for a motion of the hand, by inverse kinematics at knots.

    For a program of known duration all knots are computed at once, so that an unreachable pose is detected before the
    run.

    Args:
        person: person whose hand moves.
        motion: motion in the frame of the world.
        oriented: True if the orientation is tracked.

    Raises:
        OutOfReachError: the hand cannot reach a pose of the motion.
    """

    def __init__(self, person: Person, motion: Motion, oriented: bool) -> None:
        self._program = program_of(motion, person.seed)
        self._hand, self._where = Hand(self._program, motion.begin), motion.prefix
        self._solver = HandSolver(person.hand, person.lower, person.upper, person.rest, oriented)
        self._T_root_world, self._knots = inverse(person.T_world_root), 0
        self._target, self._last = self._pose(0), list[float]()
        self._last = self._reached(lambda: self._solver.first(self._target))
        self._rows = AngleRows(KNOT, [self._last], self._next)
        _, end = self._program.span
        self.end = motion.begin + end
        if math.isfinite(end):
            self._rows = AngleRows(KNOT, [self._last, *(self._next() for _ in range(math.ceil(end / KNOT)))])

    def start(self, time: float) -> None:
        """Start the program of the hand."""
        self._hand.start(time)

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return the interpolated positions and velocities of the knots."""
        return self._rows.since(self._hand.since(time))

    def see(self, time: float, position: Vector) -> None:
        """Pass the observation to the hand."""
        self._hand.see(time, position)

    def feel(self, time: float, force: Vector) -> None:
        """Pass the force to the hand."""
        self._hand.feel(time, force)

    def _pose(self, knot: int) -> Pose:
        return compose(self._T_root_world, self._program.pose(knot * KNOT))

    def _next(self) -> Joints:
        self._knots += 1
        target = self._pose(self._knots)
        if target != self._target:  # a hand at rest rests in the same posture
            self._target = target
            self._last = self._reached(lambda: self._solver.next(target, self._last))
        return self._last

    def _reached(self, solved: Callable[[], Joints]) -> Joints:
        try:
            return solved()
        except OutOfReachError as error:
            where = self._where.rstrip("./")
            raise OutOfReachError(f"{where}: {self._knots * KNOT:.2f} s after the motion's start {error}") from None


@dataclass(frozen=True)
class FollowedHand(Motion, ReferenceSettings):
    """Hand motion as a reference of the joints."""

    oriented: bool = flag(False, text="whether the hand's orientation follows, too")

    def reference(self, person: Person) -> Reference:
        """Return the reference by inverse kinematics."""
        return HandReference(person, self, self.oriented)


REFERENCES: dict[str, type[ReferenceSettings]] = {"rest": Rest, "joints": JointMotion, **with_programs(FollowedHand)}
"""Settings classes of references, by the value of `program`."""
