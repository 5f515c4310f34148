"""Mass of what moves in a plant, the same on every engine."""

import numpy as np

from hric_control.errors import DescriptionError
from hric_control.geometry import MassProperties
from hric_control.urdf import Robot

TRACE = 1e-12
"""Mass [kg] and moments of inertia [kg m^2] of a moving link that has none, where something with mass follows: engines
refuse zero, and nothing feels this. Default chosen by this project, unconfirmed."""


def moving_body(tree: Robot, link: str, total: MassProperties) -> MassProperties:
    """Return the mass of a moving link with what is fixed to it as an engine can have it.

    Args:
        tree: the description.
        link: the topmost of them.
        total: their sum, in axes of the link.

    Raises:
        DescriptionError: it is none, and nothing further out has one: nothing would resist the joint.
    """
    if total.mass <= 0.0:
        outer = (tree.links[joint.child].mass for joint, _ in tree.beyond(link))
        if total.inertia.any() or not any(mass is not None and mass.mass > 0.0 for mass in outer):
            raise DescriptionError(f"link {link}: it moves, but neither it nor what is fixed to it has a mass")
        total = MassProperties(TRACE, np.zeros(3), np.zeros((3, 3)))
    return as_point(total) if np.abs(total.inertia).max() < TRACE else total


def as_point(body: MassProperties) -> MassProperties:
    """Return a point mass with a trace of inertia."""
    return MassProperties(body.mass, body.com, body.inertia + TRACE * np.eye(3))
