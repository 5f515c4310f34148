"""Whether a pose can be one: a second check, for numbers that were read well and are wrong all the same."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

from hric_control.errors import ParameterError
from mocap_natnet.codec.types import Vector
from mocap_natnet.poses import Pose, normalized

UNIT_ERROR = 1e-3
"""How far the norm of a quaternion in 32-bit numbers may be from 1 (our choice)."""
SHORTEST = 1e-4
"""Least time between two poses that a speed is read from [s] (our choice)."""
BUNCHED = 0.02
"""The time between two exposures is believed up to that between the arrivals and this, since frames may arrive in bunches [s] (our choice)."""
REASONS = ("not finite", "not a unit quaternion", "outside the volume", "too fast", "not described", "too many bodies")


@dataclass(frozen=True)
class Limits:
    """What a body can do (our choice: a large laboratory, faster than a hand).

    Args:
        low, high: corners of the volume, z up [m].
        speed: largest one of a body [m/s].
    """

    low: Vector = (-10.0, -10.0, -2.0)
    high: Vector = (10.0, 10.0, 5.0)
    speed: float = 10.0

    def __post_init__(self) -> None:
        if not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise ParameterError(f"the volume goes from {self.low} to {self.high}; valid: each first number less than the second [m]")
        if not self.speed > 0:
            raise ParameterError(f"the largest speed is {self.speed}; valid: above 0 [m/s]")


class Plausibility:
    """Judges the poses of all bodies, one after the other.

    Attributes:
        refused: how many, by reason.
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.refused: Counter[str] = Counter()
        self._last: dict[int, tuple[float, float, Vector]] = {}

    def accept(self, body: int, pose: Pose, exposed: float, received: float) -> Pose | None:
        """The pose with an exact unit quaternion; None where it cannot be one.

        Too fast is measured from the last pose that was accepted: after a jump that stays, the body is back as soon as it could have got there.

        Args:
            body: streaming id.
            pose: z up.
            exposed: time of the exposure, as the frame tells it [s].
            received: time of the arrival, which no fault of the stream can change [s].
        """
        reason = self._wrong(body, pose, exposed, received)
        if reason:
            self.refused[reason] += 1
            return None
        self._last[body] = (exposed, received, pose.position)
        return Pose(pose.position, normalized(pose.orientation))

    def possible(self, pose: Pose) -> bool:
        """Whether a pose can be one, whatever it was before. A refusal is counted."""
        reason = self._impossible(pose)
        if reason:
            self.refused[reason] += 1
        return not reason

    def _impossible(self, pose: Pose) -> str:
        if not all(map(math.isfinite, (*pose.position, *pose.orientation))):
            return "not finite"
        if abs(math.hypot(*pose.orientation) - 1.0) > UNIT_ERROR:
            return "not a unit quaternion"
        limits = self.limits
        (x, y, z), (x0, y0, z0), (x1, y1, z1) = pose.position, limits.low, limits.high
        if not (x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1):
            return "outside the volume"
        return ""

    def _wrong(self, body: int, pose: Pose, exposed: float, received: float) -> str:
        if reason := self._impossible(pose):
            return reason
        if body in self._last:
            exposed_before, received_before, where = self._last[body]
            between = max(SHORTEST, min(exposed - exposed_before, received - received_before + BUNCHED))
            if math.dist(pose.position, where) > self.limits.speed * between:
                return "too fast"
        return ""
