"""Speed at which a contact would reach a limit: two masses and a spring in closed form, ISO/TS 15066:2016, Annex A.

    mu = 1/(1/m_H + 1/m_R),   E = F^2/(2 k) = mu v^2/2,   v = F/sqrt(mu k) = p A/sqrt(mu k)

m_H and k are the standard's body model (`hric_human.body.regions`). For m_R the standard has M/2 + m_L; the effective
mass is the reflected one in the direction of the contact, m_u = 1/(u' J M^-1 J' u), which the caller computes from the
arm. Where m_u is larger, the standard's estimate permits a speed that is too high.
"""

import math
from dataclasses import dataclass

import numpy as np

from hric_assessment.contact.limits import ContactLimit, Limits
from hric_assessment.findings import NotAssessableError
from hric_assessment.tables import REGIONS
from hric_core.errors import HricError, check_known
from hric_core.geometry import FloatArray
from hric_human.body.regions import REGION_MODELS

Mass = FloatArray | float


def reduced_mass(human: Mass, robot: Mass) -> FloatArray:
    """Return the reduced mass mu [kg] of both masses [kg]."""
    return np.asarray(1.0 / (1.0 / np.asarray(human) + 1.0 / np.asarray(robot)))


def half_mass(moving: float, payload: float = 0.0) -> float:
    """Return the standard's estimate of m_R [kg]: half of the moving mass of the arm plus payload and tool [kg]."""
    return 0.5 * moving + payload


def transfer_energy(force: float, stiffness: float) -> float:
    """Return E = F^2/(2 k) [J] of a force [N] on a spring [N/m]."""
    return force * force / (2.0 * stiffness)


def permitted_speed(force: float, mass: Mass, stiffness: float) -> FloatArray:
    """Return v = F/sqrt(mu k) [m/s] of a force [N], mu [kg] and a spring [N/m]."""
    return np.asarray(force / np.sqrt(np.asarray(mass) * stiffness))


@dataclass(frozen=True)
class SpeedLimit:
    """Speed up to which a contact of one region stays within the limits.

    Attributes:
        region, area: region and its area with the lowest speed; area "": the whole region.
        mass: mu, shape of the robot's mass [kg].
        force_transient, force_quasi_static: limits that determine the speeds [N]; transient None: not permitted.
        transient: speed [m/s]; 0 where contact is not permitted.
        quasi_static: speed by the quasi-static limit, for information where contact is not permitted [m/s].
        energy: energy at the transient limit, or at the quasi-static limit where contact is not permitted [J].
        by_pressure: True if the limits follow from the pressure over the contact area.
    """

    region: str
    area: str
    mass: FloatArray
    force_transient: float | None
    force_quasi_static: float
    transient: FloatArray
    quasi_static: FloatArray
    energy: float
    by_pressure: bool


def speed_limit(
    limits: Limits, region: str, robot_mass: Mass, contact_area: float | None = None, dominant: bool | None = None
) -> SpeedLimit:
    """Return the permitted speed of one region; of several areas with force limits of their own the lowest.

    Args:
        limits: limits of one table.
        region: region of `hric_human.body.regions`.
        robot_mass: m_R, a number or an array; infinite: a link that cannot yield [kg].
        contact_area: the smaller of the robot's and the body's [m^2]; None: not known, only the force limit counts.
        dominant: True on the side of the dominant hand; None: not known.

    Raises:
        NotAssessableError: the table, or the body model, has no such region.
        HricError: no such region, or a mass or an area that is not positive.
    """
    if not np.all(np.asarray(robot_mass) > 0.0):
        raise HricError(f"robot_mass is {robot_mass}; valid: a number above 0 [kg]")
    check_known("region", [region], REGIONS, "ISO/TS 15066 or BG/BGIA")
    rows = limits.table.force_rows(region)
    if not rows or region not in REGION_MODELS:
        raise NotAssessableError(f"no speed for {region!r} by {limits.table.title}; valid: {', '.join(REGION_MODELS)}")
    mu = reduced_mass(REGION_MODELS[region].mass, robot_mass)
    speeds = [_of_area(limits, region, row.area, mu, contact_area, dominant) for row in rows]
    return min(speeds, key=lambda speed: (speed.transient.max(), speed.quasi_static.max()))


def _of_area(
    limits: Limits, region: str, area: str | None, mu: FloatArray, contact_area: float | None, dominant: bool | None
) -> SpeedLimit:
    limit = limits.at((region,), area, dominant)
    assert limit is not None, "its row of forces is there"
    held, transient, by_pressure = _forces(limit, contact_area)
    return SpeedLimit(
        region,
        area or "",
        mu,
        transient,
        held,
        permitted_speed(transient or 0.0, mu, limit.stiffness),
        permitted_speed(held, mu, limit.stiffness),
        transfer_energy(transient or held, limit.stiffness),
        by_pressure,
    )


def _forces(limit: ContactLimit, contact_area: float | None) -> tuple[float, float | None, bool]:
    """Return (quasi-static force [N], transient force [N], True if the pressure determines them)."""
    force, pressure = limit.force, limit.pressure
    transient = force.transient if limit.permitted else None
    if contact_area is None or pressure is None:
        return force.quasi_static, transient, False
    check_positive("contact_area", contact_area, "m^2")
    held = pressure.quasi_static * contact_area
    short = None if pressure.transient is None or transient is None else pressure.transient * contact_area
    by_pressure = held < force.quasi_static or (short or math.inf) < (transient or math.inf)
    lower = None if short is None or transient is None else min(transient, short)
    return min(force.quasi_static, held), lower, by_pressure


def permitted_regions(limits: Limits) -> list[str]:
    """Return the regions with which a contact is permitted at some speed."""
    rows = [name for name in REGION_MODELS if limits.table.force_rows(name)]
    return [name for name in rows if speed_limit(limits, name, 1.0).force_transient is not None]


def check_positive(name: str, value: Mass, unit: str) -> None:
    """Raise HricError if a value is not finite, or not above 0."""
    if not np.all(np.isfinite(value) & (np.asarray(value) > 0.0)):
        raise HricError(f"{name} is {value}; valid: a finite number above 0 [{unit}]")
