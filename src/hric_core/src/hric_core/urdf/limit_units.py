"""Limits of joints that were probably written in degrees, mm or N mm.

Rules and bounds follow public descriptions (PyPI example-robot-data 6.0.0 and pybullet, public repositories): stops of
revolute joints reach 10 rad; what lies beyond and is meant takes the place of no end (+-1000, +-1e16), is whole turns
(+-62.83), or is the travel of a virtual base (prismatic, +-50). Velocities and efforts are often loose bounds.
"""

import logging
import math
from collections.abc import Iterable, Iterator

from hric_core.errors import DescriptionError
from hric_core.magnitudes import largest, likely_unit
from hric_core.urdf.robot import BOUNDED, NO_LIMIT, Joint

LOG = logging.getLogger("hric.urdf")
FASTEST = 60.0
"""Velocity that no joint with stops exceeds [rad/s or m/s]: 59.9 in example-robot-data 6.0.0, romeo_laas_small.urdf."""


MAX_END = 16.0 * math.pi
"""Largest end of a joint's range: eight turns, as of a cable drum [rad] (project default, unconfirmed)."""


def check_limit_units(joints: Iterable[Joint]) -> None:
    """Refuse impossible ends of a joint's range; warn once of limits that are probably in another unit.

    Raises:
        DescriptionError: with the joint, the end and the unit that was probably meant.
    """
    bounded = [joint for joint in joints if joint.type in BOUNDED and math.isfinite(joint.upper - joint.lower)]
    for joint in bounded:
        unit, possible = _units(joint)[0], 0.0 if joint.type == "prismatic" else MAX_END
        for name, end, likely in _suspect_ends(joint):
            if abs(end) > possible:
                raise DescriptionError(
                    f"joint {joint.name}: its {name} limit {end:g} is beyond {largest(unit):.4g} [{unit}]{likely}; a "
                    f"joint without ends is continuous, or has ends beyond {NO_LIMIT:g}"
                )
    doubts = [doubt for joint in bounded for doubt in _doubts(joint)]
    if doubts:
        more = f" (and {len(doubts) - 1} more limits)" if doubts[1:] else ""
        LOG.warning("the robot description has limits that may be in another unit: %s%s", doubts[0], more)


def _units(joint: Joint) -> tuple[str, str, str]:
    """Return the units of ends, velocity and effort."""
    return ("m", "m/s", "N") if joint.type == "prismatic" else ("rad", "rad/s", "N m")


def _suspect_ends(joint: Joint) -> Iterator[tuple[str, float, str]]:
    """Return name and value of each end that is larger than joints have, and the unit that was probably meant."""
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
