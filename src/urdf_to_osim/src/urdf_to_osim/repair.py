"""How much of a robot the repair of its inertias invents."""

from __future__ import annotations

import numpy as np

from hric_control.errors import DescriptionError
from urdf_to_osim.mass_matrix import mass_matrix, poses
from urdf_to_osim.urdf import Robot

MOSTLY = 0.5
"""A larger part of a joint's inertia is most of it, and of a robot's joints most of them: default chosen by this project, unconfirmed."""
NAMED = 5
"""Joints that a refusal names."""


def invented_joints(described: Robot, repaired: Robot) -> list[str]:
    """Joints most of whose own inertia, as the mass matrix has it over `poses`, is not in the description."""
    rows: list[str] = []
    own = np.zeros((2, sum({"fixed": 0, "planar": 3, "floating": 6}.get(joint.type, 1) for joint in described.joints.values())))
    for q in poses(described):
        for place, robot in enumerate((described, repaired)):
            M, rows = mass_matrix(robot, q)
            own[place] += np.diag(M)
    return list(dict.fromkeys(name for name, old, new in zip(rows, *own, strict=True) if new - old > MOSTLY * new))


def check_invented(described: Robot, repaired: Robot) -> None:
    """Refuse a robot that is moved by what a repair gave it rather than by what the description says.

    Raises:
        DescriptionError: most joints move mostly invented inertia; names some, and what to do.
    """
    moving = [joint for joint in repaired.joints.values() if joint.type != "fixed"]
    invented = invented_joints(described, repaired) if moving else []
    if len(invented) > MOSTLY * len(moving):
        named = ", ".join(invented[:NAMED]) + (", ..." if len(invented) > NAMED else "")
        raise DescriptionError(
            f"the mass of robot {repaired.name} would mostly be invented: {len(invented)} of {len(moving)} joints ({named}) move more of it than the "
            "description has; give the links an <inertial>, or convert with inertia invent"
        )
