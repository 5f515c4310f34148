"""Position and velocity of an arm, as capsules around the links of its URDF."""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hric_assessment.separation.capsules import capsules_of, poses, unlogged
from hric_assessment.separation.protective import fastest
from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from hric_core.urdf import read
from hric_supervisor.placed import CapsuleTree

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

    @property
    def fastest(self) -> float:
        """Speed of the fastest end [m/s]."""
        return fastest(self.velocities)


class ArmShape:
    """Capsules around the moving links of an arm's URDF; links that are fixed to the world are left out.

    Args:
        description: URDF as text, whose root is the world.
        joints: joints with known positions, in order; those of a hand at the end of the arm stay at zero.

    Raises:
        DescriptionError: a joint is not in the URDF, another joint moves the arm or a second one, no moving link has a
            shape, or a shape is a mesh.
    """

    def __init__(self, description: str, joints: Sequence[str]) -> None:
        self.tree, self.joints = read(description), tuple(joints)
        unknown = [name for name in joints if name not in self.tree.joints]
        if unknown:
            raise DescriptionError(
                f"joint {', '.join(unknown)} is not in the description of {self.tree.name}; valid: "
                f"{', '.join(name for name, joint in self.tree.joints.items() if joint.type != 'fixed')}"
            )
        if lost := unlogged(self.tree, self.joints):
            raise DescriptionError(
                f"the position of {', '.join(lost)} of {self.tree.name} is not known; valid: a transmission for each "
                "joint that moves an arm"
            )
        fixed = self.tree.rigid_groups()
        moving = [name for name in self.tree.links if fixed[name][0] != self.tree.root]
        self.capsules, left_out = capsules_of(self.tree, moving)
        if left_out:
            raise DescriptionError(
                f"a missing collision shape or <mesh> has no capsule: {', '.join(left_out)} of {self.tree.name}; "
                "valid: capsules, cylinders, spheres, boxes"
            )
        if not self.capsules.links:
            raise DescriptionError(f"no moving link of {self.tree.name} has a collision shape")
        self._placed = CapsuleTree(self.tree, self.joints, self.capsules)

    @property
    def is_franka(self) -> bool:
        """True if all joints have the names of Franka arms."""
        prefixes = [joint[: -len("_joint1")] for joint in self.joints if re.fullmatch(r".+_joint[1-7]", joint)]
        return len(prefixes) == len(self.joints) and all(f"{prefix}_link8" in self.tree.links for prefix in prefixes)

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
        now, ahead = self._placed(state.q.tolist()), self._placed((state.q + STEP * state.dq).tolist())
        return PlacedCapsules(now, (ahead - now) / STEP, self.capsules.radii, self.capsules.links)
