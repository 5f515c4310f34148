"""Hand that a person jerks away, without wanting to, if the robot is faster than they expect at its distance.

That involuntary motion depends on speed and distance is the result of an experiment with 29 persons (Kirschner et al.,
IEEE RA-L 2022, arXiv 2109.07201, whose abstract was read). Its figures were not available here, so there is no default
for the speed that a person expects.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray, Pose, Vector
from hric_core.parameters import Settings, flag, listing, number, numbers
from hric_human.hand.program import Program
from hric_human.hand.reactive import Piece

STARTLED = "startled"
REST_STATE = np.zeros((3, 3))
"""Displacement, velocity and acceleration of a hand that is not startled."""


def expected_rows(text: str) -> Any:
    """Return the declaration of a parameter with the speeds that a person expects; text: its description."""
    return listing(numbers(2, minimum=0.0), default=(), unit="m, m/s", text=text)


def check_expected(rows: Sequence[Sequence[float]], where: str) -> None:
    """Raise ParameterError unless the distances of the rows increase. where: name of the parameter."""
    distances = [distance for distance, _ in rows]
    if any(b <= a for a, b in pairwise(distances)):
        raise ParameterError(f"{where}: the distances must increase from row to row")


def expected_speed(rows: Sequence[Sequence[float]], distance: FloatArray | float) -> FloatArray:
    """Return the highest speeds that a person expects of the robot [m/s], interpolated between the rows.

    Args:
        rows: rows of distance [m] and speed [m/s]; below the first distance its speed holds, beyond the last one the
            person expects any speed.
        distance: distances of the robot from the person [m].
    """
    distances, speeds = np.array(rows).T
    return np.asarray(np.interp(distance, distances, speeds, right=math.inf))


@dataclass(frozen=True)
class Startle(Settings):
    """Parameters of a startled hand; defaults without a source are project defaults, unconfirmed."""

    expected: tuple[tuple[float, ...], ...] = expected_rows(
        "rows [distance of the end effector from the hand, highest speed that the person expects there]; beyond the "
        "last distance any speed is expected"
    )
    probability: float = number(1.0, minimum=0.0, maximum=1.0, text="share of the unexpected approaches that startle")
    latency: float = number(
        0.1, minimum=0.05, maximum=1.0, unit="s", text="from the unexpected motion to the start of the hand's motion"
    )
    distance: float = number(0.15, above=0.0, maximum=0.5, unit="m", text="length of the hand's motion")
    jerk_time: float = number(0.25, minimum=0.1, maximum=2.0, unit="s", text="duration of the hand's motion")
    recovery: float = number(1.0, minimum=0.1, maximum=10.0, unit="s", text="duration of the way back")
    towards: bool = flag(False, text="true: the hand moves towards the end effector, the worst case; false: away")

    def check(self, where: str) -> None:
        """Check that there are rows, and that their distances increase. Raises ParameterError."""
        super().check(where)
        if not self.expected:
            raise ParameterError(f"{where}expected must have one row or more, [distance in m, speed in m/s]")
        check_expected(self.expected, f"{where}expected")


class StartledHand(Program):
    """Program of a hand that follows a motion and is startled by a robot that is faster than expected.

    Each unexpected approach startles once at most. During a startle and the way back the hand is not startled again.

    Args:
        motion: motion without a startle.
        startle: parameters of the startle.
        random: generator that decides which unexpected approaches startle.
    """

    def __init__(self, motion: Program, startle: Startle, random: np.random.Generator) -> None:
        self._motion, self._how, self._random = motion, startle, random
        self._pieces = [Piece(-1.0, 1.0, REST_STATE, np.zeros(3))]
        self._seen = -math.inf, np.zeros(3)
        self._unexpected = False

    @property
    def span(self) -> tuple[float, float]:
        """Start of the motion and an infinite end, since the motion depends on the robot."""
        return self._motion.span[0], math.inf

    def pose(self, time: float) -> Pose:
        """Return the pose on the motion, displaced by the startle."""
        pose = self._motion.pose(time)
        x, y, z = (pose.position + self._piece(time).state(time)[0]).tolist()
        return Pose((x, y, z), pose.orientation)

    def phase(self, time: float) -> str:
        """Return the phase of the motion, or "startled" until the hand is back."""
        piece = self._piece(time)
        startled = piece is not self._pieces[0] and time < piece.begin + piece.duration
        return STARTLED if startled else self._motion.phase(time)

    def see(self, time: float, position: Vector) -> None:
        """Start a startle when the end effector, at `position` [m], becomes faster than expected at its distance."""
        (last_time, last), arm = self._seen, np.array(position)
        if time <= last_time:
            return
        self._seen = time, arm
        offset = np.array(self.pose(time).position) - arm
        distance = float(np.linalg.norm(offset))
        speed = float(np.linalg.norm(arm - last)) / (time - last_time)
        unexpected = speed > float(expected_speed(self._how.expected, distance))
        new, self._unexpected = unexpected and not self._unexpected, unexpected
        at_rest = time >= self._pieces[-1].begin + self._pieces[-1].duration
        if new and self._random.random() < self._how.probability and at_rest:
            self._start(time + self._how.latency, offset / max(distance, 1e-9))

    def _start(self, begin: float, away: FloatArray) -> None:
        how = self._how
        goal = (-how.distance if how.towards else how.distance) * away
        there = np.array([goal, np.zeros(3), np.zeros(3)])
        self._pieces += [
            Piece(begin, how.jerk_time, REST_STATE, goal),
            Piece(begin + how.jerk_time, how.recovery, there, np.zeros(3)),
        ]

    def _piece(self, time: float) -> Piece:
        return self._pieces[max(0, bisect_right(self._pieces, time, key=lambda piece: piece.begin) - 1)]
