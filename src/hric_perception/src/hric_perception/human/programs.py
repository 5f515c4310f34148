"""What moves the emulated hand. No ROS.

A program tells a pose at each time since its start, in the robot's base, z up; it is continuous up to the acceleration, and at rest before 0 and
after its end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hric_control.errors import ParameterError, UnknownNameError
from hric_perception.human.reactive import Reactive, read_reactive
from hric_perception.section import Section, Vector
from mocap_natnet.poses import ORIGIN, Pose, from_rotation_vector
from mocap_natnet.server.sources import Track
from mocap_natnet.trial import PROGRAM

REST, MOVING, DONE = "rest", "moving", "done"
_PROGRAM_SEED = 1
"""Tells the seeds of programs from those of the cameras."""


class Program(Protocol):
    """A motion of the hand."""

    def pose(self, time: float) -> Pose:
        """Where the hand is `time` seconds after the start; times may come out of order, by a second at most."""

    def phase(self, time: float) -> str:
        """What it does then: a word."""

    def see(self, time: float, position: Vector) -> None:
        """The robot's end effector was at `position` [m] at `time` [s]; only a program that reacts to the robot heeds it."""


@dataclass(frozen=True)
class Sinusoid:
    """p(t) = centre + amplitude sin(2 pi frequency s(t)), with s' going smoothly from 0 to 1 at the beginning and back at the end:
    s' = 3 u^2 - 2 u^3, u = t / ramp, so that the amplitude is full from the first swing on and the acceleration has no step.

    Args:
        centre: where it begins and ends [m].
        amplitude: [m].
        frequency: [Hz].
        cycles: swings; a multiple of a half.
        ramp: how long it takes to set off, and to come to rest [s].
        rotation: rotation vector of the same sine [rad].
    """

    centre: Vector
    amplitude: Vector
    frequency: float
    cycles: float
    ramp: float
    rotation: Vector = ORIGIN

    def __post_init__(self) -> None:
        if (2 * self.cycles) % 1:
            raise ParameterError(f"cycles is {self.cycles:g}; valid: a multiple of 0.5, at which the hand comes back to its centre")
        if self.ramp > self.cycles / self.frequency:
            raise ParameterError(f"ramp is {self.ramp:g}; valid: at most the duration of all cycles, {self.cycles / self.frequency:g} s")

    @property
    def duration(self) -> float:
        """From the start to rest [s]."""
        return self.cycles / self.frequency + self.ramp

    def pose(self, time: float) -> Pose:
        """See Program."""
        sine = math.sin(2 * math.pi * self.frequency * self._progress(time))
        (x, y, z), (ax, ay, az), (rx, ry, rz) = self.centre, self.amplitude, self.rotation
        return Pose((x + ax * sine, y + ay * sine, z + az * sine), from_rotation_vector((rx * sine, ry * sine, rz * sine)))

    def _progress(self, time: float) -> float:
        """s(t) [s]."""
        since, left = max(0.0, time), max(0.0, self.duration - time)
        if since < self.ramp:
            return self.ramp * _eased(since / self.ramp)
        if left < self.ramp:
            return self.duration - self.ramp - self.ramp * _eased(left / self.ramp)
        return since - self.ramp / 2

    def phase(self, time: float) -> str:
        """See Program."""
        return REST if time < 0 else MOVING if time < self.duration else DONE

    def see(self, time: float, position: Vector) -> None:
        """Heeds nothing."""


def _eased(u: float) -> float:
    """Integral of 3 u^2 - 2 u^3."""
    return u * u * u * (1 - u / 2)


class MinimumJerk:
    """From point to point along straight lines with least jerk, each at rest when it is reached (Flash and Hogan 1985).

    Args:
        times: rising [s].
        poses: as many.
    """

    def __init__(self, times: Sequence[float], poses: Sequence[Pose]) -> None:
        self._track, self._begin, self.duration = Track(times, poses, minimum_jerk=True), times[0], times[-1]

    def pose(self, time: float) -> Pose:
        """See Program."""
        return self._track(time)

    def phase(self, time: float) -> str:
        """See Program."""
        return REST if time < self._begin else MOVING if time < self.duration else DONE

    def see(self, time: float, position: Vector) -> None:
        """Heeds nothing."""


def read_program(section: Section, seed: int) -> Program:
    """The program of a mapping; INTERFACE.md lists the keys.

    Args:
        section: what stands in the experiment file or on the parameter server.
        seed: of what varies.

    Raises:
        HricError: no such program, or a value that it cannot have; names the key.
    """
    name = section.text("program", "sinusoid")
    if name not in PROGRAMS:
        raise UnknownNameError("program", name, [*PROGRAMS, PROGRAM], section.where)
    keys, read = PROGRAMS[name]
    section.only(*COMMON_KEYS, *keys)
    try:
        return read(section, np.random.default_rng((seed, _PROGRAM_SEED)))
    except ParameterError as error:
        text = str(error)
        raise ParameterError(text if text.startswith(section.where) else f"{section.where}: {text}") from error


def _sinusoid(section: Section, random: np.random.Generator) -> Program:
    frequency = section.number("frequency", 0.25, 0.0, 10.0, above=True)
    return Sinusoid(
        section.vector("centre", (0.6, 0.0, 0.4)),
        section.vector("amplitude", (0.0, 0.1, 0.0)),
        frequency,
        section.number("cycles", 3.0, 0.5),
        section.number("ramp", 1.0, 0.0, above=True),
        section.vector("rotation", ORIGIN),
    )


def _minimum_jerk(section: Section, random: np.random.Generator) -> Program:
    rows = section.rows("points", 4, 7)
    if not rows or rows[0][0] < 0:
        raise ParameterError(f"{section.where}.points must have one row or more, [time from 0 s on, x, y, z] or with a rotation vector besides")
    spread = section.section("variation")
    spread.only("position", "time")
    far, long = spread.number("position", 0.0, 0.0, 1.0), spread.number("time", 0.0, 0.0, 0.3)
    drawn = random.standard_normal((len(rows), 4))
    poses: list[Pose] = []
    times: list[float] = []
    for index, row in enumerate(rows):
        moved = np.asarray(row[1:4]) + (far * drawn[index, :3] if index else 0.0)
        poses.append(Pose((float(moved[0]), float(moved[1]), float(moved[2])), from_rotation_vector(row[4:] or [0.0, 0.0, 0.0])))
        piece = (row[0] - rows[index - 1][0]) * math.exp(long * drawn[index, 3]) if index else row[0]
        times.append((times[-1] if times else 0.0) + float(piece))
    return MinimumJerk(times, poses)


COMMON_KEYS = ("program", "begin", "name", "markers", "still")
"""Keys of each program: see `motion_capture`."""
PROGRAMS: dict[str, tuple[tuple[str, ...], Callable[[Section, np.random.Generator], Program]]] = {
    "sinusoid": (("centre", "amplitude", "frequency", "cycles", "ramp", "rotation"), _sinusoid),
    "minimum_jerk": (("points", "variation"), _minimum_jerk),
    "reactive": (Reactive.KEYS, read_reactive),
}
"""Keys and maker of each program."""
