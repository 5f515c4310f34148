"""Validity check of poses, for numbers that were decoded correctly but cannot be true."""

import math
from collections import Counter
from dataclasses import dataclass

from hric_core.geometry import Pose, Vector, normalized
from hric_core.parameters import Settings, numbers, refused

UNIT_ERROR = 1e-3
"""Largest deviation of a valid quaternion's norm from 1, in 32-bit floats (project default, unconfirmed)."""
SHORTEST = 1e-4
"""Minimum time between two poses from which a speed is computed [s] (project default, unconfirmed)."""
BUNCHED = 0.02
"""Largest valid excess of the time between exposures over the time between arrivals [s].

Frames may arrive in bunches (project default, unconfirmed).
"""
REASONS = ("not finite", "not a unit quaternion", "outside the volume", "too fast", "not described", "too many bodies")


@dataclass(frozen=True)
class Volume(Settings):
    """Parameters of the volume in which poses are valid (project default, unconfirmed: a large laboratory)."""

    low: Vector = numbers(
        3, (-10.0, -10.0, -2.0), unit="m", text="lower corner; a pose outside counts as lost (mocap frame, z up)"
    )
    high: Vector = numbers(3, (10.0, 10.0, 5.0), unit="m", text="upper corner")

    def check(self, where: str) -> None:
        """Check that the lower corner is below the upper one. Raises ParameterError."""
        if not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise refused(f"{where}high", self.high, f"above low, {self.low}, on each axis [m]")


class PoseValidator:
    """Validator of the poses of all bodies, in the order of time.

    Args:
        volume: volume in which poses are valid.
        max_speed: largest speed of a body [m/s] (project default, unconfirmed: faster than a hand).

    Attributes:
        refused: number of refused poses, by reason.
    """

    def __init__(self, volume: Volume | None = None, max_speed: float = 10.0) -> None:
        self._volume, self._max_speed = volume or Volume(), max_speed
        self.refused: Counter[str] = Counter()
        self._last: dict[int, tuple[float, float, Vector]] = {}

    def accept(self, body: int, pose: Pose, exposed: float, received: float) -> Pose | None:
        """Return a body's pose with an exact unit quaternion; None if the pose is not valid.

        The speed is measured from the last accepted pose: after a permanent jump, the body is accepted again as soon as
        it could have moved there.

        Args:
            body: streaming id of the body.
            pose: pose with z up.
            exposed: time of the exposure by the frame's contents [s].
            received: time of the arrival [s], which no fault of the stream can change.
        """
        reason = self._wrong(body, pose, exposed, received)
        if reason:
            self.refused[reason] += 1
            return None
        self._last[body] = (exposed, received, pose.position)
        return Pose(pose.position, normalized(pose.orientation))

    def possible(self, pose: Pose) -> bool:
        """Return True if a pose is valid, without comparing it with earlier ones; count a refusal."""
        reason = self._impossible(pose)
        if reason:
            self.refused[reason] += 1
        return not reason

    def _impossible(self, pose: Pose) -> str:
        if not all(map(math.isfinite, (*pose.position, *pose.orientation))):
            return "not finite"
        if abs(math.hypot(*pose.orientation) - 1.0) > UNIT_ERROR:
            return "not a unit quaternion"
        (x, y, z), (x0, y0, z0), (x1, y1, z1) = pose.position, self._volume.low, self._volume.high
        return "" if x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1 else "outside the volume"

    def _wrong(self, body: int, pose: Pose, exposed: float, received: float) -> str:
        if reason := self._impossible(pose):
            return reason
        if body in self._last:
            exposed_before, received_before, where = self._last[body]
            between = max(SHORTEST, min(exposed - exposed_before, received - received_before + BUNCHED))
            if math.dist(pose.position, where) > self._max_speed * between:
                return "too fast"
        return ""
