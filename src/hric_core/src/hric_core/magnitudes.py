"""Largest realistic parameter value for each unit, and a guess of the unit in which a refused value was meant.

A bound is above what any robot, room or person needs, and below the values that result from a wrong unit: degrees for
rad, mm for m, g for kg, N mm for N m, ms for s. If a parameter declares a maximum, the bound of its unit is not used.
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Magnitude:
    """Largest realistic value in a unit, and the units that are often confused with it.

    Attributes:
        largest: largest absolute value, in the unit.
        source: reason for this bound.
        others: units confused with this one; each with its size in this unit, e.g. mm: 0.001 for m.
    """

    largest: float
    source: str
    others: Mapping[str, float]


DEGREE = math.pi / 180.0
"""Degree [rad]."""
_UNCONFIRMED = "; project default, unconfirmed"
NEVER_MEANT = 1e12
"""Absolute value from which on a refused number is not explained by a wrong unit."""
MAGNITUDES: Mapping[str, Magnitude] = {
    "rad": Magnitude(4.0 * math.pi, "two turns: joints with stops have one at most" + _UNCONFIRMED, {"deg": DEGREE}),
    "rad/s": Magnitude(50.0, "twice what the fastest small arms reach" + _UNCONFIRMED, {"deg/s": DEGREE}),
    "rad/s^2": Magnitude(200.0, "ten times a Panda's 20 rad/s^2 (Franka, limits for Panda)", {"deg/s^2": DEGREE}),
    "rad/s^3": Magnitude(1e5, "five times a Panda's 20000 rad/s^3 (Franka, limits for Panda)", {"deg/s^3": DEGREE}),
    "m": Magnitude(30.0, "a large hall with cameras" + _UNCONFIRMED, {"mm": 1e-3, "cm": 1e-2}),
    "m/s": Magnitude(30.0, "a thrown ball" + _UNCONFIRMED, {"mm/s": 1e-3, "cm/s": 1e-2}),
    "m/s^2": Magnitude(100.0, "ten times gravity" + _UNCONFIRMED, {"mm/s^2": 1e-3}),
    "m/s^3": Magnitude(2e4, "three times a Panda's 6500 m/s^3 (Franka, limits for Panda)", {"mm/s^3": 1e-3}),
    "m^2": Magnitude(0.5, "a person's front" + _UNCONFIRMED, {"cm^2": 1e-4, "mm^2": 1e-6}),
    "kg": Magnitude(300.0, "a person with what they carry, and a small machine" + _UNCONFIRMED, {"g": 1e-3}),
    "kg m^2": Magnitude(100.0, "an arm stretched out, about its base" + _UNCONFIRMED, {"kg cm^2": 1e-4, "g m^2": 1e-3}),
    "N": Magnitude(2e4, "ten times what a person can press" + _UNCONFIRMED, {"mN": 1e-3}),
    "N m": Magnitude(
        1e4, "the thesis's bound of an integral (listing 5), above any arm's torque", {"N mm": 1e-3, "N cm": 1e-2}
    ),
    "N m/s": Magnitude(1e6, "a thousand times a Panda's 1000 N m/s (Franka, limits for Panda)", {"N mm/s": 1e-3}),
    "N s/m": Magnitude(1e6, "critical damping of 1000 kg on a spring of 1e6 N/m, with a margin" + _UNCONFIRMED, {}),
    "N m/rad": Magnitude(4e4, "above the largest gain of the thesis, 30000 (listing 5)", {"N mm/rad": 1e-3}),
    "N m s/rad": Magnitude(1e4, "critical damping of a joint with that stiffness" + _UNCONFIRMED, {"N mm s/rad": 1e-3}),
    "s": Magnitude(3600.0, "a session with a person" + _UNCONFIRMED, {"ms": 1e-3}),
}
"""Bounds by unit. Stiffness in N/m has none: a value in N/mm, its usual confusion, is smaller, not larger."""
_SEPARATORS = re.compile(r", | or ")


def largest(unit: str) -> float:
    """Return the largest realistic absolute value in a unit; for "rad or m" the larger bound; inf: no bound."""
    return max(MAGNITUDES[single].largest if single in MAGNITUDES else math.inf for single in _SEPARATORS.split(unit))


def first_beyond(value: Any, unit: str) -> tuple[float, str] | None:
    """Return the first number above the bound of its unit, and the unit; None if there is none.

    If the value is a table with a unit such as "s, m", the first column is in s and the others are in m."""
    first, _, rest = unit.partition(", ")
    rows = value if rest and isinstance(value, tuple) and value and isinstance(value[0], tuple) else ()
    parts = [part for row in rows for part in ((row[:1], first), (row[1:], rest))] or [(value, unit)]
    return next(((item, of) for part, of in parts for item in _numbers(part) if abs(item) > largest(of)), None)


def likely_unit(value: Any, unit: str, low: float, high: float) -> str:
    """Return the unit in which a refused number was probably meant, as text; empty if none fits.

    Args:
        value: refused value.
        unit: unit of the parameter.
        low: smallest value of the parameter, in its unit.
        high: largest value of the parameter, in its unit.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < NEVER_MEANT:
        return ""
    if abs(value) <= min(high, largest(unit)):  # too small or of the wrong sign, which no unit explains
        return ""
    for single in _SEPARATORS.split(unit):
        for other, size in MAGNITUDES[single].others.items() if single in MAGNITUDES else ():
            if low <= value * size <= min(high, largest(single)):
                return f"; {value:g} {other} would be {value * size:.6g} {single}"
    return ""


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, tuple):
        for item in value:
            yield from _numbers(item)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield value
