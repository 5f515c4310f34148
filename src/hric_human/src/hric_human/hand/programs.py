"""Motion programs of a human hand.

A program returns the hand's pose at each time since its start, in the robot's base frame, z up. The motion is
continuous up to the acceleration, and at rest before time 0 and after its end.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, make_dataclass
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import ORIGIN, Pose, Track, Vector, from_rotation_vector
from hric_core.parameters import Settings, listing, number, numbers, refused, section, variant
from hric_human.hand.program import Program
from hric_human.hand.reactive import Reaction, Reactive
from hric_human.hand.startle import Startle, StartledHand

Base = TypeVar("Base", bound=Settings)
_PROGRAM_SEED = 1
"""Second part of a program's seed, so that its variation is independent of the noise of cameras and senses."""


@dataclass(frozen=True)
class Motion(Settings):
    """Settings that all motion programs of a hand share."""

    begin: float = number(0.0, minimum=0.0, maximum=3600.0, unit="s", text="rest after the start")

    def program(self, random: np.random.Generator) -> Program:
        """Return the motion program of these settings; random: generator of all random variation."""
        raise NotImplementedError


@dataclass(frozen=True)
class Sinusoid(Motion, Program):
    """Sinusoidal motion with a smooth start and stop.

    p(t) = centre + amplitude sin(2 pi frequency s(t)); s' rises smoothly from 0 to 1 at the start and falls back at the
    end: s' = 3 u^2 - 2 u^3, u = t / ramp, so that the first swing has full amplitude and the acceleration has no step.
    """

    centre: Vector = numbers(3, (0.6, 0.0, 0.4), unit="m", text="position at the begin and the end of the motion")
    amplitude: Vector = numbers(3, (0.0, 0.1, 0.0), minimum=-2.0, maximum=2.0, unit="m")
    frequency: float = number(0.25, above=0.0, maximum=10.0, unit="Hz")
    cycles: float = number(3.0, minimum=0.5, text="number of swings; a multiple of 0.5")
    ramp: float = number(1.0, above=0.0, unit="s", text="duration of the smooth start, and of the smooth stop")
    rotation: Vector = numbers(3, ORIGIN, unit="rad", text="rotation vector, multiplied by the same sine")

    def check(self, where: str) -> None:
        """Check that the swings end at the centre and last at least as long as the ramp. Raises ParameterError."""
        super().check(where)
        if (2 * self.cycles) % 1:
            raise refused(f"{where}cycles", self.cycles, "a multiple of 0.5, so that the hand ends at the centre")
        if self.ramp > self.cycles / self.frequency:
            valid = f"at most the duration of all cycles, {self.cycles / self.frequency:g} s"
            raise refused(f"{where}ramp", self.ramp, valid)

    def program(self, random: np.random.Generator) -> Program:
        """Return this object, which is its own program."""
        return self

    @property
    def duration(self) -> float:
        """Time from the start to rest [s]."""
        return self.cycles / self.frequency + self.ramp

    @property
    def span(self) -> tuple[float, float]:
        """Start of the motion and its duration [s]."""
        return 0.0, self.duration

    def pose(self, time: float) -> Pose:
        """Return the pose on the sine at a time since the start [s]."""
        sine = math.sin(2 * math.pi * self.frequency * self._progress(time))
        (x, y, z), (ax, ay, az), (rx, ry, rz) = self.centre, self.amplitude, self.rotation
        return Pose(
            (x + ax * sine, y + ay * sine, z + az * sine), from_rotation_vector((rx * sine, ry * sine, rz * sine))
        )

    def _progress(self, time: float) -> float:
        """Return s(t) [s], the time whose sine is the motion: it runs slower during the ramps."""
        since, left = max(0.0, time), max(0.0, self.duration - time)
        if since < self.ramp:
            return self.ramp * _eased(since / self.ramp)
        if left < self.ramp:
            return self.duration - self.ramp - self.ramp * _eased(left / self.ramp)
        return since - self.ramp / 2


def _eased(u: float) -> float:
    """Return the integral of the smooth step 3 x^2 - 2 x^3 from x = 0 to u."""
    return u * u * u * (1 - u / 2)


class MinimumJerk(Program):
    """Minimum-jerk motion along straight lines, at rest at each point (Flash and Hogan 1985).

    Args:
        times: increasing times [s].
        poses: pose at each time.
    """

    def __init__(self, times: Sequence[float], poses: Sequence[Pose]) -> None:
        self._track, self._span = Track(times, poses, minimum_jerk=True), (times[0], times[-1])

    def pose(self, time: float) -> Pose:
        """Return the pose on the track at a time since the start [s]."""
        return self._track(time)

    @property
    def span(self) -> tuple[float, float]:
        """First and last time of the track [s]."""
        return self._span


@dataclass(frozen=True)
class Variation(Settings):
    """Standard deviations of the random variation of a point-to-point motion."""

    position: float = number(0.0, minimum=0.0, maximum=1.0, unit="m", text="of each point, per axis")
    time: float = number(0.0, minimum=0.0, maximum=0.3, text="of the logarithm of durations")


@dataclass(frozen=True)
class PointToPoint(Motion):
    """Settings of a point-to-point motion of the hand."""

    points: tuple[tuple[float, ...], ...] = listing(
        numbers((4, 7)),
        default=(),
        unit="s, m, rad",
        text="[time from 0 s on, x, y, z], or the same followed by a rotation vector",
    )
    variation: Variation = section(Variation)

    def check(self, where: str) -> None:
        """Check that the times increase. Raises ParameterError."""
        super().check(where)
        times = [row[0] for row in self.points]
        if not times or times[0] < 0:
            raise ParameterError(
                f"{where}points must have one row or more, [time from 0 s on, x, y, z] or the same followed by a "
                "rotation vector"
            )
        if any(b <= a for a, b in pairwise(times)):
            raise ParameterError(f"{where}points: the times must increase from row to row")

    def program(self, random: np.random.Generator) -> Program:
        """Return the minimum-jerk motion with randomly varied points and durations."""
        far, long, rows = self.variation.position, self.variation.time, self.points
        drawn = random.standard_normal((len(rows), 4))
        poses: list[Pose] = []
        times: list[float] = []
        for index, row in enumerate(rows):
            moved = np.asarray(row[1:4]) + (far * drawn[index, :3] if index else 0.0)
            rotation = from_rotation_vector(row[4:] or [0.0, 0.0, 0.0])
            poses.append(Pose((float(moved[0]), float(moved[1]), float(moved[2])), rotation))
            piece = (row[0] - rows[index - 1][0]) * math.exp(long * drawn[index, 3]) if index else row[0]
            times.append((times[-1] if times else 0.0) + float(piece))
        return MinimumJerk(times, poses)


@dataclass(frozen=True)
class TakeOver(Motion, Reaction):
    """Settings of a hand that takes objects over from the robot's arm, and reacts to it."""

    def program(self, random: np.random.Generator) -> Program:
        """Return the program of a hand that waits for the robot's arm and reacts to it."""
        return Reactive(self, random)


@dataclass(frozen=True)
class StartledMotion(PointToPoint, Startle):
    """Settings of a point-to-point motion of a hand that a robot may startle."""

    def program(self, random: np.random.Generator) -> Program:
        """Return the point-to-point motion, which the robot may startle."""
        return StartledHand(super().program(random), self, random)


PROGRAMS: dict[str, type[Motion]] = {
    "sinusoid": Sinusoid,
    "minimum_jerk": PointToPoint,
    "reactive": TakeOver,
    "startled": StartledMotion,
}


def with_programs(base: type[Base]) -> dict[str, type[Base]]:
    """Return a settings class for each program, by its name, that joins the fields of `base` and of the program."""
    return {
        name: make_dataclass(f"{base.__name__}{kind.__name__}", (), bases=(base, kind), frozen=True)
        for name, kind in PROGRAMS.items()
    }


def read_program(content: Any, seed: int, where: str = "human") -> Program:
    """Return the motion program that a mapping of settings describes; INTERFACE.md lists the keys.

    Args:
        content: mapping from the experiment file or the parameter server.
        seed: seed of all random variation.
        where: name of the mapping, for error messages.

    Raises:
        ParameterError: an unknown program, or an invalid value; names the key.
    """
    return program_of(variant("program", PROGRAMS, "sinusoid").checked(content, where), seed)


def program_of(motion: Motion, seed: int) -> Program:
    """Return the motion program of checked settings; seed: seed of all random variation."""
    return motion.program(np.random.default_rng((seed, _PROGRAM_SEED)))
