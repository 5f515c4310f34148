"""Where an arm is and how fast: the capsules of its description by its joints."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hric_assessment.separation.capsules import Capsules
from hric_control.errors import DescriptionError
from hric_control.geometry import FloatArray
from hric_control.geometry.transforms import rotation_about
from hric_control.urdf import Joint, Shape, join_capsules, read
from hric_control.urdf.mass_matrix import mass_matrix, point_jacobian

STEP = 1e-3
"""Along the present velocity, for the speeds of places [s]: what the curvature adds is below 1e-3 of the speed."""


class ArmState(NamedTuple):
    """Of an instant.

    Attributes:
        stamp: robot time [s].
        q, dq: shape (n,) each [rad or m], [rad/s or m/s].
    """

    stamp: float
    q: FloatArray
    dq: FloatArray


class InForce(NamedTuple):
    """The speed scale of the robot, in a cycle that took a request up.

    Attributes:
        stamp: robot time of that cycle [s].
        requested: scale that it goes to.
        scale: in force.
    """

    stamp: float = -math.inf
    requested: float = 1.0
    scale: float = 1.0


class Placed(NamedTuple):
    """Capsules in the world.

    Attributes:
        ends: shape (k, 2, 3) [m].
        velocities: of the ends, shape (k, 2, 3) [m/s].
        radii: shape (k,) [m].
        links: k names.
    """

    ends: FloatArray
    velocities: FloatArray
    radii: FloatArray
    links: tuple[str, ...]


class ArmShape:
    """The capsules of a description; those of a link that is fixed to the world are left out, since nothing slows it.

    Args:
        description: URDF, whose root is the world.
        joints: whose positions are known, in order; all others stay at zero.

    Raises:
        DescriptionError: a joint that it has not, or no link that moves has a shape.
    """

    def __init__(self, description: str, joints: Sequence[str]) -> None:
        self.tree, self.joints = read(description), tuple(joints)
        unknown = [name for name in joints if name not in self.tree.joints]
        if unknown:
            raise DescriptionError(
                f"joint {', '.join(unknown)} is not in the description of {self.tree.name}; valid: "
                f"{', '.join(name for name, joint in self.tree.joints.items() if joint.type != 'fixed')}"
            )
        fixed = self.tree.rigid_groups()
        moving = [link for link in self.tree.links.values() if fixed[link.name][0] != self.tree.root]
        found = [(link.name, *_capsule(shape)) for link in moving for shape in join_capsules(link.collisions)]
        if not found:
            raise DescriptionError(f"no moving link of {self.tree.name} has a collision shape")
        links, ends, radii = zip(*found, strict=True)
        self.capsules = Capsules(links, np.array(ends), np.array(radii))
        self._steps = [
            (joint, self.joints.index(joint.name) if joint.name in self.joints else -1)
            for joint in self.tree.joints.values()
        ]

    def poses(self, q: FloatArray) -> dict[str, FloatArray]:
        """T_world_link of all links for n rows of joint positions, shape (n, 4, 4) each; q: shape (n, j)."""
        T = {self.tree.root: np.broadcast_to(np.eye(4), (len(q), 4, 4))}
        for joint, column in self._steps:
            T_world_joint = T[joint.parent] @ joint.T_parent_joint
            T[joint.child] = T_world_joint if column < 0 else T_world_joint @ _motion(joint, q[:, column])
        return T

    def ends(self, q: FloatArray) -> FloatArray:
        """Ends of the capsules, shape (n, k, 2, 3) [m]; q: shape (n, j)."""
        T = self.poses(q)
        return self.capsules.placed(np.stack([T[link] for link in self.capsules.links], axis=1))

    def at(self, state: ArmState) -> Placed:
        """The capsules now, and how fast they move."""
        now, ahead = self.ends(np.array([state.q, state.q + STEP * state.dq]))
        return Placed(now, (ahead - now) / STEP, self.capsules.radii, self.capsules.links)

    def reflected_mass(
        self, q: FloatArray, rotors: FloatArray, link: str, point: FloatArray, direction: FloatArray
    ) -> float:
        """Return m_u = 1/(u' J (M + B)^-1 J' u) [kg]; NaN where M + B is singular.

        Args:
            q: shape (j,) [rad or m].
            rotors: B, of the joints, shape (j,) [kg m^2].
            link: of the description.
            point: of it, in the world, shape (3,) [m].
            direction: u, shape (3,).
        """
        angles = dict(zip(self.joints, q.tolist(), strict=True))
        M, rows = mass_matrix(self.tree, angles)
        chosen = [rows.index(name) for name in self.joints]
        row = direction @ point_jacobian(self.tree, angles, link, point)[:, chosen]
        try:
            mobility = float(row @ np.linalg.solve(M[np.ix_(chosen, chosen)] + np.diag(rotors), row))
        except np.linalg.LinAlgError:  # a description without masses
            return math.nan
        return 1.0 / mobility if mobility else math.inf

    @property
    def moving_mass(self) -> float:
        """Of all links behind the first joint [kg]."""
        fixed = self.tree.rigid_groups()
        return sum(
            link.mass.mass
            for link in self.tree.links.values()
            if link.mass is not None and fixed[link.name][0] != self.tree.root
        )


def _motion(joint: Joint, q: FloatArray) -> FloatArray:
    """Of the child of a joint, shape (n, 4, 4)."""
    T = np.tile(np.eye(4), (len(q), 1, 1))
    if joint.type == "prismatic":
        T[:, :3, 3] = q[:, None] * joint.axis
    else:
        T[:, :3, :3] = [rotation_about(joint.axis, angle) for angle in q.tolist()]
    return T


def _capsule(shape: Shape) -> tuple[FloatArray, float]:
    """(ends, radius) of a capsule that holds a shape [m]."""
    T = shape.T_link_shape
    if shape.kind == "sphere":
        return np.array([T[:3, 3], T[:3, 3]]), shape.size[0]
    if shape.kind in ("capsule", "cylinder"):
        radius, length = shape.size
        step = 0.5 * length * T[:3, 2]
        return np.array([T[:3, 3] - step, T[:3, 3] + step]), radius
    if shape.kind == "box":
        longest = int(np.argmax(shape.size))
        step = 0.5 * shape.size[longest] * T[:3, longest]
        across = [size for axis, size in enumerate(shape.size) if axis != longest]
        return np.array([T[:3, 3] - step, T[:3, 3] + step]), 0.5 * math.hypot(*across)
    raise DescriptionError(f"{shape.where}: a <mesh> has no capsule; valid: capsules, cylinders, spheres, boxes")
