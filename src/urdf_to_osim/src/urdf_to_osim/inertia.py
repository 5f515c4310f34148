"""Detection and repair of physically impossible inertias of links.

A tensor J about the centre of mass belongs to a body if its second moments S = tr(J)/2 E - J have no negative
eigenvalue, which is the triangle inequality of the principal moments (P. Wensing, S. Kim, J.-J. Slotine, Linear matrix
inequalities for physically consistent inertial parameter identification, IEEE RA-L 3(1), 2018).
"""

import math

import numpy as np

from hric_control.plants.models import as_point
from hric_core.errors import DescriptionError
from hric_core.geometry import MassProperties, judge

# Tolerance of the inequality relative to the largest moment: tensors have few digits, and a thin rod or a plate may
# violate it slightly. Project default, unconfirmed.
ROUNDING = 1e-6
# Repair of a moving leaf link [kg], [kg m^2]: negligible in the dynamics, but large enough for the integrator. Project
# default, unconfirmed.
MIN_MASS, MIN_INERTIA = 1e-5, 1e-6
MINIMUM = MassProperties(MIN_MASS, np.zeros(3), MIN_INERTIA * np.eye(3))
# Impossibly small radius of gyration, a hundredth of an atom's radius [m]: a tensor below it is a rounded zero.
MIN_RADIUS = 1e-12
# A body without an inertia is repaired to a sphere of water [kg/m^3].
DENSITY = 1000.0


def fault(body: MassProperties) -> str:
    """Return why a link's inertia is physically impossible; empty if it is possible, or if there is no mass at all."""
    if body.mass == 0.0:
        return "it has an inertia but no mass" if body.inertia.any() else ""
    if _has_none(body):
        return f"it has {body.mass} kg but no inertia"
    verdict = judge(body.inertia)
    slack, moments = (
        ROUNDING * float(np.max(np.abs(verdict.moments))),
        ", ".join(f"{moment:.4g}" for moment in verdict.moments),
    )
    if verdict.moments[0] < -slack:
        return f"its inertia is not positive (principal moments {moments} kg m^2)"
    return (
        f"its inertia breaks the triangle inequality (principal moments {moments} kg m^2)"
        if verdict.triangle_margin < -slack
        else ""
    )


def says_nothing(body: MassProperties) -> bool:
    """Return True if a body lacks mass or inertia in the description, so that a repair has to invent them."""
    return body.mass == 0.0 or _has_none(body)


def _has_none(body: MassProperties) -> bool:
    return float(np.max(np.abs(body.inertia))) <= body.mass * MIN_RADIUS**2


def repaired(body: MassProperties) -> tuple[MassProperties, str]:
    """Return the nearest physically possible mass properties, and a text about what was changed."""
    if body.mass == 0.0:
        return MassProperties(), "its inertia was dropped, since it has no mass"
    if _has_none(body):
        radius = (0.75 * body.mass / (math.pi * DENSITY)) ** (1.0 / 3.0)
        return MassProperties(
            body.mass, body.com, 0.4 * body.mass * radius**2 * np.eye(3)
        ), f"it got the inertia of a ball of water with a radius of {radius:.3g} m"
    moments, axes = np.linalg.eigh(0.5 * np.trace(body.inertia) * np.eye(3) - body.inertia)
    moments = np.maximum(moments, ROUNDING * float(np.max(np.abs(moments))))
    inertia = axes @ np.diag(np.sum(moments) - moments) @ axes.T
    change = float(np.max(np.abs(inertia - body.inertia)))
    return MassProperties(
        body.mass, body.com, 0.5 * (inertia + inertia.T)
    ), f"its inertia was changed to the nearest possible one, by up to {change:.3g} kg m^2"


def settled(name: str, body: MassProperties, choice: str) -> tuple[MassProperties, str]:
    """Return the mass properties to use for a link, and a note about changes (empty if nothing was changed).

    Args:
        name: name of the link.
        body: mass properties in the description.
        choice: treatment of impossible inertias: "refuse", "repair", "invent" or "keep".

    Raises:
        DescriptionError: the inertia is impossible and must be corrected by the user; the text says how.
    """
    reason = fault(body)
    if choice == "keep" and body.mass > 0.0:
        return as_point(body), f"link {name}: {reason}; kept as it is" if reason else ""
    if not reason:
        return body, ""
    if choice in ("refuse", "keep"):
        raise DescriptionError(f"link {name}: {reason}; correct its <inertial>, or convert with inertia repair")
    mended, what = repaired(body)
    return mended, f"link {name}: {reason}; {what}"
