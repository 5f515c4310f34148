"""Position and velocity of an arm, as capsules around the links of its URDF."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hric_assessment.separation.capsules import capsules_of, poses
from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from hric_core.urdf import read
from hric_dynamics.tree import Tree

STEP = 1e-3
"""Time step along the present velocity by which point velocities are computed [s]; relative error below 1e-3."""


class ArmState(NamedTuple):
    """State of the arm at an instant.

    Attributes:
        stamp: robot time [s].
        q, dq: joint positions and velocities, shape (n,) each [rad or m], [rad/s or m/s].
        fault: reason why the state cannot be trusted, a clause; empty: it can.
    """

    stamp: float
    q: FloatArray
    dq: FloatArray
    fault: str = ""


class InForce(NamedTuple):
    """Speed scale that the robot obeyed in a cycle, as it reported after a request.

    Attributes:
        stamp: robot time of the cycle [s].
        requested: requested speed scale, 0 to 1.
        scale: speed scale that the robot obeyed in that cycle, on its way to the requested one.
    """

    stamp: float = -math.inf
    requested: float = 1.0
    scale: float = 1.0


class PlacedCapsules(NamedTuple):
    """Capsules of an arm in the world at one instant.

    Attributes:
        ends: ends of the axes, shape (k, 2, 3) [m].
        velocities: velocities of the ends, shape (k, 2, 3) [m/s].
        radii: radii of the capsules, shape (k,) [m].
        links: names of the links, k texts.
    """

    ends: FloatArray
    velocities: FloatArray
    radii: FloatArray
    links: tuple[str, ...]


class ArmShape:
    """Capsules around the moving links of an arm's URDF; links that are fixed to the world are left out.

    Args:
        description: URDF as text, whose root is the world.
        joints: joints with known positions, in order; all others stay at zero.

    Raises:
        DescriptionError: a joint is not in the URDF, no moving link has a shape, or a shape is a mesh.
    """

    def __init__(self, description: str, joints: Sequence[str]) -> None:
        self.tree, self.joints = read(description), tuple(joints)
        unknown = [name for name in joints if name not in self.tree.joints]
        if unknown:
            raise DescriptionError(
                f"joint {', '.join(unknown)} is not in the description of {self.tree.name}; valid: "
                f"{', '.join(name for name, joint in self.tree.joints.items() if joint.type != 'fixed')}"
            )
        self._dynamics = Tree(self.tree, self.joints)
        fixed = self.tree.rigid_groups()
        moving = [name for name in self.tree.links if fixed[name][0] != self.tree.root]
        self.capsules, left_out = capsules_of(self.tree, moving)
        if left_out:
            raise DescriptionError(
                f"a collision <mesh> has no capsule: {', '.join(left_out)} of {self.tree.name}; valid: capsules, "
                "cylinders, spheres, boxes"
            )
        if not self.capsules.links:
            raise DescriptionError(f"no moving link of {self.tree.name} has a collision shape")

    def poses(self, q: FloatArray) -> dict[str, FloatArray]:
        """Return the poses of all links in the world by name, shape (n, 4, 4) each.

        q: joint positions, shape (n, j).
        """
        return poses(self.tree, self.joints, q)

    def ends(self, q: FloatArray) -> FloatArray:
        """Return the axis ends of the capsules in the world, shape (n, k, 2, 3) [m].

        q: joint positions, shape (n, j).
        """
        T = self.poses(q)
        return self.capsules.placed(np.stack([T[link] for link in self.capsules.links], axis=1))

    def at(self, state: ArmState) -> PlacedCapsules:
        """Return the capsules in the world, with their velocities, for a state of the arm."""
        now, ahead = self.ends(np.array([state.q, state.q + STEP * state.dq]))
        return PlacedCapsules(now, (ahead - now) / STEP, self.capsules.radii, self.capsules.links)

    def reflected_mass(
        self, q: FloatArray, rotors: FloatArray, link: str, point: FloatArray, direction: FloatArray
    ) -> float:
        """Return the reflected mass 1/(u' J (M + B)^-1 J' u) [kg] of a point; NaN if M + B is singular.

        Args:
            q: joint positions, shape (j,) [rad or m].
            rotors: rotor inertias B at the joints, shape (j,) [kg m^2].
            link: link of the arm.
            point: point of the link in the world, shape (3,) [m].
            direction: unit vector u in the world, shape (3,).
        """
        M = self._dynamics.mass_matrix(q.tolist())
        row = direction @ self._dynamics.point_jacobian(q.tolist(), link, point.tolist())
        try:
            mobility = float(row @ np.linalg.solve(M + np.diag(rotors), row))
        except np.linalg.LinAlgError:  # a description without masses
            return math.nan
        return 1.0 / mobility if mobility else math.inf

    @property
    def moving_mass(self) -> float:
        """Mass of all links that are not fixed to the world [kg]."""
        fixed = self.tree.rigid_groups()
        return sum(
            link.mass.mass
            for link in self.tree.links.values()
            if link.mass is not None and fixed[link.name][0] != self.tree.root
        )
