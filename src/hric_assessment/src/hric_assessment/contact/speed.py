"""Speed at which a contact would reach a limit: two masses and a spring in closed form, ISO/TS 15066:2016, Annex A.

    mu = 1/(1/m_H + 1/m_R),   E = F^2/(2 k) = mu v^2/2,   v = F/sqrt(mu k) = p A/sqrt(mu k)

m_H and k are effective mass and stiffness of the body region (`hric_human.body.regions`). For the robot's mass m_R the
standard uses M/2 + m_L. The true effective mass is the arm's reflected mass in the direction u of the contact, m_u =
1/(u' J M^-1 J' u), which the caller computes. If m_u is larger than the standard's estimate, the estimate permits too
high a speed.
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
    """Return the reduced mass mu [kg] of two colliding masses [kg]."""
    return np.asarray(1.0 / (1.0 / np.asarray(human) + 1.0 / np.asarray(robot)))


def half_mass(moving: float, payload: float = 0.0) -> float:
    """Return the robot's effective mass as estimated by ISO/TS 15066: half of the moving mass plus payload [kg]."""
    return 0.5 * moving + payload


def transfer_energy(force: float, stiffness: float) -> float:
    """Return the energy E = F^2/(2 k) [J] that a force [N] stores in a spring [N/m]."""
    return force * force / (2.0 * stiffness)


def permitted_speed(force: float, mass: Mass, stiffness: float) -> FloatArray:
    """Return the speed v = F/sqrt(mu k) [m/s] at which the impact force reaches F [N].

    Args:
        force: force F [N].
        mass: reduced mass mu [kg].
        stiffness: stiffness k [N/m].
    """
    return np.asarray(force / np.sqrt(np.asarray(mass) * stiffness))


@dataclass(frozen=True)
class SpeedLimit:
    """Approach speed up to which a contact with one region stays within its limits.

    Attributes:
        region, area: region, and its specific area with the lowest speed; area "": the whole region.
        mass: reduced mass mu of robot and region [kg]; an array if several masses of the robot were given.
        force_transient, force_quasi_static: forces that determine the speeds [N]; transient None: contact is not
            permitted.
        transient: speed at which the transient force is reached [m/s]; 0 if contact is not permitted.
        quasi_static: speed at which the quasi-static force is reached [m/s]; only for information if contact is not
            permitted.
        energy: energy at the transient force, or at the quasi-static one if contact is not permitted [J].
        by_pressure: True if the forces follow from the pressure limit over the contact area.
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
    """Return the permitted approach speed for one region, or the lowest if areas of it have their own force limits.

    Args:
        limits: limits of one table.
        region: region of `hric_human.body.regions`.
        robot_mass: effective mass m_R of the robot, a number or an array [kg]; infinite: a link that cannot yield.
        contact_area: the smaller of the robot's and the body's [m^2]; None: not known, only the force limit counts.
        dominant: True on the side of the dominant hand; None: not known.

    Raises:
        NotAssessableError: the table, or the body model, has no values for the region.
        HricError: the region does not exist, or a mass or area is not positive.
    """
    if not np.all(np.asarray(robot_mass) > 0.0):
        raise HricError(f"robot_mass is {robot_mass}; valid: a number above 0 [kg]")
    check_known("region", [region], REGIONS, "ISO/TS 15066 or BG/BGIA")
    rows = limits.table.force_rows(region)
    if not rows or region not in REGION_MODELS:
        raise NotAssessableError(
            f"{limits.table.title} has no permitted speed for {region!r}; valid: {', '.join(REGION_MODELS)}"
        )
    mu = reduced_mass(limits.mass(region), robot_mass)
    speeds = [_of_area(limits, region, row.area, mu, contact_area, dominant) for row in rows]
    return min(speeds, key=lambda speed: (speed.transient.max(), speed.quasi_static.max()))


def _of_area(
    limits: Limits, region: str, area: str | None, mu: FloatArray, contact_area: float | None, dominant: bool | None
) -> SpeedLimit:
    limit = limits.at((region,), area, dominant)
    assert limit is not None, "the table has a row of forces for the region"
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
    """Return quasi-static and transient force limit [N], and True if the pressure limits determine them."""
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
