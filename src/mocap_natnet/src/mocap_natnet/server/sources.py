"""Sources of motion for bodies of the emulated Motive.

A source returns the pose at a time of the stream; positions and orientations are z up.
"""

import csv
import math
import threading
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hric_core.errors import ParameterError
from hric_core.geometry.poses import ORIGIN, Pose, Track, interpolated
from hric_core.geometry.quaternions import IDENTITY, Quaternion, Vector, from_rotation_vector, normalized, product
from hric_core.parameters import Settings, number, numbers

Source = Callable[[float], Pose | None]
"""Function from stream time [s] to the pose of a body (z up); None: the body is not visible.

It is called once per frame, with increasing times, and must not block.
"""
KEPT = 1000
"""Number of poses that a `PoseHistory` stores. The constants of this file are project defaults, unconfirmed."""
AHEAD = 0.05
"""Time for which a body continues at its last speed after its last pose [s]; then it rests."""
MAX_AGE = 0.5
"""Age of the last pose beyond which a body is no longer visible [s]."""


@dataclass(frozen=True)
class SinusoidSource(Settings):
    """Settings and source of a sinusoidal motion: p(t) = centre + amplitude sin(2 pi frequency (t - begin)).

    The orientation is rotated by the rotation vector `rotation` times the same sine. Before `begin` the body is at the
    centre. orientation: mean orientation.
    """

    centre: Vector = numbers(3, (0.0, 0.0, 1.0), unit="m")
    amplitude: Vector = numbers(3, (0.1, 0.0, 0.0), unit="m")
    frequency: float = number(0.25, unit="Hz")
    begin: float = number(0.0, unit="s")
    rotation: Vector = numbers(3, ORIGIN, unit="rad")
    orientation: Quaternion = IDENTITY

    def __call__(self, time: float) -> Pose:
        """Return the pose at a time of the stream [s]."""
        sine = math.sin(2 * math.pi * self.frequency * max(0.0, time - self.begin))
        x, y, z = (centre + amplitude * sine for centre, amplitude in zip(self.centre, self.amplitude, strict=True))
        rotation = from_rotation_vector([part * sine for part in self.rotation])
        return Pose((x, y, z), product(rotation, self.orientation))


def from_file(path: Path) -> Track:
    """Return a track from comma-separated columns: time [s], x, y, z [m], and optionally qx, qy, qz, qw.

    A first line with names is skipped.

    Raises:
        ParameterError: the file cannot be read, or a line is not a pose; the message gives the line.
    """
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"trajectory {path}: {error}") from error
    times, poses = [], []
    for line, row in enumerate(csv.reader(text.splitlines()), 1):
        if not row or row[0].lstrip().startswith("#") or (line == 1 and not _is_number(row[0])):
            continue
        if len(row) not in (4, 8) or not all(map(_is_number, row)):
            raise ParameterError(
                f"trajectory {path}, line {line} is not a pose; valid: 4 or 8 numbers: time, x, y, z[, qx, qy, qz, qw]"
            )
        t, x, y, z, *q = map(float, row)
        if q and not any(q):
            raise ParameterError(f"trajectory {path}, line {line}: the orientation is zero")
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


class PoseHistory:
    """Source of poses that arrive during the run, interpolated linearly; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._times: deque[float] = deque(maxlen=KEPT)
        self._poses: deque[Pose] = deque(maxlen=KEPT)

    def add(self, time: float, pose: Pose) -> None:
        """Add a pose; an earlier time than the last one restarts the history, the same time is ignored.

        Args:
            time: robot time [s].
            pose: pose with z up.
        """
        with self._lock:
            if self._times and time == self._times[-1]:
                return
            if self._times and time < self._times[-1]:
                self._times.clear()
                self._poses.clear()
            self._times.append(time)
            self._poses.append(pose)

    @property
    def last(self) -> float:
        """Time of the last pose [s]; minus infinity if there is none."""
        with self._lock:
            return self._times[-1] if self._times else float("-inf")

    def __call__(self, time: float) -> Pose | None:
        """Return the pose at a robot time [s]; None if it is not known."""
        with self._lock:
            if not self._times or not self._times[0] - MAX_AGE <= time <= self._times[-1] + MAX_AGE:
                return None
            after = bisect_right(self._times, time)
            if after == 0 or len(self._times) == 1:
                return self._poses[0]
            after = min(after, len(self._times) - 1)
            begin, end = self._times[after - 1], self._times[after]
            a, b = self._poses[after - 1], self._poses[after]
        if time > end and end - begin > MAX_AGE:
            return b
        return interpolated(a, b, (min(time, end + AHEAD) - begin) / (end - begin))
