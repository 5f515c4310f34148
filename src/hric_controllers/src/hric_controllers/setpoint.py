"""Checking joint set points before they reach the loop."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hric_control.errors import CommandError


def check_setpoint(values: Sequence[float], joints: Sequence[str], ranges: Sequence[tuple[float, float]]) -> list[float]:
    """The set point as n floats [rad or m].

    Args:
        values: one per joint.
        joints: names, for messages.
        ranges: (lower, upper) of each joint [rad or m].

    Raises:
        CommandError: wrong length, not finite, or outside a joint's range; says what would be valid.
    """
    if len(values) != len(joints):
        raise CommandError(f"{len(values)} values; valid: {len(joints)}, for {', '.join(joints)}")
    wrong = []
    for joint, value, (low, high) in zip(joints, values, ranges, strict=True):
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            wrong.append(f"{joint} {value!r} is not a finite number")
        elif not low <= value <= high:
            wrong.append(f"{joint} {value:.6g} is outside {low:.6g} to {high:.6g}")
    if wrong:
        raise CommandError("; ".join(wrong))
    return [float(value) for value in values]
