"""Detection of joint limits in a URDF that were probably written in degrees, mm or N mm.

Rules and bounds follow public robot descriptions (PyPI example-robot-data 6.0.0 and pybullet, public repositories):
stops of revolute joints are at up to 10 rad. Intended values beyond that mean "no limit" (+-1000, +-1e16), are whole
turns (+-62.83), or are the range of a virtual mobile base (prismatic, +-50). Velocity and effort limits are often far
too high, without a mistake in the unit.
"""

import logging
import math
from collections.abc import Iterable, Iterator

from hric_core.errors import DescriptionError
from hric_core.magnitudes import largest, likely_unit
from hric_core.urdf.robot import BOUNDED, NO_LIMIT, Joint

LOG = logging.getLogger("hric.urdf")
FASTEST = 60.0
"""Largest realistic velocity limit of a joint with stops [rad/s or m/s].

The largest known one is 59.9, in example-robot-data 6.0.0, romeo_laas_small.urdf."""


MAX_END = 16.0 * math.pi
"""Largest possible position limit of a revolute joint [rad]: eight turns, e.g. of a cable drum.

Project default, unconfirmed."""


def check_limit_units(joints: Iterable[Joint]) -> None:
    """Refuse impossible position limits; log one warning about limits that are probably in another unit.

    Raises:
        DescriptionError: a position limit is impossible; the message names joint, limit and probable unit.
    """
    bounded = [joint for joint in joints if joint.type in BOUNDED and math.isfinite(joint.upper - joint.lower)]
    for joint in bounded:
        unit, possible = _units(joint)[0], 0.0 if joint.type == "prismatic" else MAX_END
        for name, end, likely in _suspect_ends(joint):
            if abs(end) > possible:
                raise DescriptionError(
                    f"joint {joint.name}: its {name} limit {end:g} is beyond {largest(unit):.4g} [{unit}]{likely}; for "
                    f"a joint without limits use the type continuous, or limits beyond {NO_LIMIT:g}"
                )
    doubts = [doubt for joint in bounded for doubt in _doubts(joint)]
    if doubts:
        more = f" (and {len(doubts) - 1} more limits)" if doubts[1:] else ""
        LOG.warning("the robot description has limits that may be in another unit: %s%s", doubts[0], more)


def _units(joint: Joint) -> tuple[str, str, str]:
    """Return the units of a joint's position, velocity and effort limits."""
    return ("m", "m/s", "N") if joint.type == "prismatic" else ("rad", "rad/s", "N m")


def _suspect_ends(joint: Joint) -> Iterator[tuple[str, float, str]]:
    """Yield ("lower" or "upper", value, hint with the probable unit) of each unrealistically large position limit."""
    unit = _units(joint)[0]
    for name, end, opposite in (("lower", joint.lower, joint.upper), ("upper", joint.upper, joint.lower)):
        likely = likely_unit(end, unit, -largest(unit), largest(unit))
        if likely and not _is_stand_in(end, opposite, joint.type):
            yield name, end, likely


def _is_stand_in(end: float, opposite: float, kind: str) -> bool:
    revolutions = end / math.tau
    symmetric = opposite == -end
    if kind == "prismatic":
        return symmetric
    return (symmetric and _is_power_of_ten(end)) or abs(revolutions - round(revolutions)) < 2e-4 * abs(revolutions)


def _is_power_of_ten(value: float) -> bool:
    return math.log10(abs(value)).is_integer()


def _doubts(joint: Joint) -> Iterator[str]:
    unit, speed_unit, effort_unit = _units(joint)
    for name, end, likely in _suspect_ends(joint):
        yield f"joint {joint.name}: {name} limit {end:g} is taken as {unit}{likely}"
    for name, value, unit, bound in (
        ("velocity", joint.velocity, speed_unit, FASTEST),
        ("effort", joint.effort, effort_unit, 0.0),
    ):
        if value > bound and (likely := likely_unit(value, unit, 0.0, math.inf)) and not _is_power_of_ten(value):
            yield f"joint {joint.name}: {name} {value:g} is taken as {unit}{likely}"
