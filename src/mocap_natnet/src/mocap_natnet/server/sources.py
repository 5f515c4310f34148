"""What moves a body of the emulated Motive. A source tells the pose at a time of the stream; positions and orientations are z up."""

from __future__ import annotations

import csv
import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from hric_control.errors import ParameterError
from mocap_natnet.codec.types import Quaternion, Vector
from mocap_natnet.poses import IDENTITY, ORIGIN, Pose, from_rotation_vector, multiply, normalized

Source = Callable[[float], Pose | None]
"""Time of the stream [s] -> pose of the body (z up), None: it is not seen. Called once per frame, with rising times; it must not block."""


@dataclass(frozen=True)
class Sinusoid:
    """p(t) = centre + amplitude sin(2 pi frequency (t - begin)); orientation turned by the rotation vector `rotation` times the same sine.

    Before `begin` the body stands at the centre.

    Args:
        centre, amplitude: [m].
        frequency: [Hz].
        begin: [s].
        rotation: [rad].
        orientation: about which it turns.
    """

    centre: Vector = (0.0, 0.0, 1.0)
    amplitude: Vector = (0.1, 0.0, 0.0)
    frequency: float = 0.25
    begin: float = 0.0
    rotation: Vector = ORIGIN
    orientation: Quaternion = IDENTITY

    def __call__(self, time: float) -> Pose:
        """The pose."""
        sine = math.sin(2 * math.pi * self.frequency * max(0.0, time - self.begin))
        x, y, z = (centre + amplitude * sine for centre, amplitude in zip(self.centre, self.amplitude, strict=True))
        turn = from_rotation_vector([part * sine for part in self.rotation])
        return Pose((x, y, z), multiply(turn, self.orientation))


class Track:
    """Poses at given times; between them along a straight line, the orientation along the shortest arc; outside them at rest.

    Args:
        times: rising [s].
        poses: as many.
        minimum_jerk: whether each piece begins and ends at rest: s = 10 u^3 - 15 u^4 + 6 u^5 (Flash and Hogan 1985), instead of s = u.

    Raises:
        ParameterError: no poses, another number of times, times that do not rise, or numbers that are not finite.
    """

    def __init__(self, times: Sequence[float], poses: Sequence[Pose], minimum_jerk: bool = False) -> None:
        if not times or len(times) != len(poses):
            raise ParameterError(f"a track needs as many times as poses and one at least; got {len(times)} and {len(poses)}")
        if any(b <= a for a, b in pairwise(times)):
            raise ParameterError("the times of a track must rise")
        if not all(math.isfinite(number) for pose in poses for number in (*pose.position, *pose.orientation)):
            raise ParameterError("the poses of a track must be finite numbers")
        self._times, self._poses, self._minimum_jerk = list(times), list(poses), minimum_jerk

    def __call__(self, time: float) -> Pose:
        """The pose."""
        after = bisect_right(self._times, time)
        if after == 0 or after == len(self._times):
            return self._poses[min(after, len(self._times) - 1)]
        begin, end = self._times[after - 1], self._times[after]
        u = (time - begin) / (end - begin)
        s = u * u * u * (10 - 15 * u + 6 * u * u) if self._minimum_jerk else u
        return between(self._poses[after - 1], self._poses[after], s)


def between(a: Pose, b: Pose, share: float) -> Pose:
    """The pose at `share` of the way from a (0) to b (1): straight line, shortest arc at constant rate."""
    x, y, z = (p + share * (q - p) for p, q in zip(a.position, b.position, strict=True))
    back = (-a.orientation[0], -a.orientation[1], -a.orientation[2], a.orientation[3])
    turn = multiply(b.orientation, back)
    if turn[3] < 0:
        turn = (-turn[0], -turn[1], -turn[2], -turn[3])
    sine = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    factor = 2 * math.atan2(sine, turn[3]) / sine if sine > 1e-12 else 2.0
    part = from_rotation_vector([share * factor * turn[0], share * factor * turn[1], share * factor * turn[2]])
    return Pose((x, y, z), normalized(multiply(part, a.orientation)))


def from_file(path: Path) -> Track:
    """A track from comma-separated columns: time [s], x, y, z [m], and, where there, qx, qy, qz, qw; a first line with names is passed over.

    Raises:
        ParameterError: the file cannot be read or a line is no pose; the message gives the line.
    """
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"trajectory {path}: {error}") from error
    times, poses = [], []
    for number, row in enumerate(csv.reader(text.splitlines()), 1):
        if not row or row[0].lstrip().startswith("#") or (number == 1 and not _is_number(row[0])):
            continue
        if len(row) not in (4, 8) or not all(map(_is_number, row)):
            raise ParameterError(f"trajectory {path}, line {number}: wanted 4 or 8 numbers: time, x, y, z[, qx, qy, qz, qw]")
        t, x, y, z, *q = map(float, row)
        if q and not any(q):
            raise ParameterError(f"trajectory {path}, line {number}: the orientation is zero")
        times.append(t)
        poses.append(Pose((x, y, z), normalized(q) if q else IDENTITY))
    try:
        return Track(times, poses)
    except ParameterError as error:
        raise ParameterError(f"trajectory {path}: {error}") from error


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
