"""A marker's sample, and whether it can be believed. No ROS.

About half of what a damaged datagram still decodes to is wrong, so plausibility is a second check, before any target is made of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hric_controllers.orientation import Quaternion, Vector

UNIT = 0.01
"""How far the norm of a quaternion may be from 1."""


@dataclass(frozen=True)
class Marker:
    """One sample as it came.

    Attributes:
        position: in its own frame [m].
        valid: whether the marker was seen.
        attitude: quaternion in that frame; None: it has none.
        in_base: whether its frame is the robot's base.
        stamp: time of measurement [s]; None: not known.
    """

    position: Vector
    valid: bool = True
    attitude: Quaternion | None = None
    in_base: bool = False
    stamp: float | None = None


@dataclass(frozen=True)
class Believable:
    """What a sample must fulfil.

    Attributes:
        largest_distance: from the origin of its frame [m].
        largest_step: from the sample before [m].
        attitude: whether it needs one.
    """

    largest_distance: float
    largest_step: float
    attitude: bool = False

    def objection(self, marker: Marker, last: Marker | None) -> str:
        """Why the sample is refused; empty if it is not. `last`: the one before, None while nothing is followed."""
        if not all(map(math.isfinite, marker.position)):
            return "position not finite"
        if math.hypot(*marker.position) > self.largest_distance:
            return "further away than largest_distance"
        if self.attitude and not _is_unit(marker.attitude):
            return "no unit quaternion"
        return "" if last is None else self._after(marker, last)

    def _after(self, marker: Marker, last: Marker) -> str:
        if marker.in_base != last.in_base:
            return "in another frame than the one before"
        if marker.stamp is not None and last.stamp is not None and marker.stamp <= last.stamp:
            return "not newer than the one before"
        return "further from the one before than largest_step" if math.dist(marker.position, last.position) > self.largest_step else ""


def _is_unit(q: Sequence[float] | None) -> bool:
    return q is not None and all(map(math.isfinite, q)) and abs(math.hypot(*q) - 1.0) < UNIT
