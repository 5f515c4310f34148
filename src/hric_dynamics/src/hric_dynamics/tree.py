"""Mass matrix, Jacobians, gravity torques and inverse dynamics of a tree of links, compiled from C."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hric_core.errors import check_known
from hric_core.geometry import FloatArray, MassProperties
from hric_core.geometry.transforms import rotation_onto
from hric_core.native import load
from hric_core.urdf.robot import ONE_COORDINATE, Joint, Robot

_built = load("hric_bodies")
Bodies: Any = _built.Bodies
"""Compiled links: Bodies(number of coordinates, rows), each row the number of a joint's coordinate (-1: fixed) and
`link_row`."""
nearest: Callable[[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray], None] = _built.nearest
"""Function that writes, for each of m capsules, which of k other capsules is the nearest.

Arguments: ends_a, radii_a, ends_b, radii_b, rows, contiguous float64 arrays: ends of the axes of the k and m capsules,
shapes (k, 2, 3) and (m, 2, 3), and radii, shapes (k,) and (m,) [m]; result, shape (m, 8): distance [m], below 0 for an
overlap, NaN: not known; index of the nearest of the k capsules; nearest points on its axis and on the own one [m].
"""
_FIXED = (True, (0.0, 0.0, 0.0))


def pose_row(T: FloatArray) -> list[float]:
    """Return a pose, shape (4, 4), as 12 floats for the C structure `Pose`: rotation row by row, then position."""
    return [*T[:3, :3].ravel().tolist(), *T[:3, 3].tolist()]


def link_row(
    parent: int, slides: bool, T_parent_joint: FloatArray, axis: Iterable[float], body: MassProperties
) -> list[float]:
    """Return a link and its parent joint as floats, in the layout of `Link` in tree.h.

    Args:
        parent: index of the link to which the joint is attached; -1: the base.
        slides: True for a prismatic joint; with a zero axis the joint is fixed.
        T_parent_joint: pose of the joint frame at position 0 in the parent link, shape (4, 4) [m].
        axis: unit vector in the joint frame, 3 floats.
        body: mass properties in the link's frame.
    """
    mass = body.mass, *body.com.tolist(), *body.inertia.ravel().tolist()
    return [float(parent), float(slides), *pose_row(T_parent_joint), *axis, *mass]


class Tree:
    """Dynamics of a robot whose base is at rest; vectors are in the axes of the root link.

    An instance must be used by one thread only.

    Args:
        robot: robot description.
        joints: names of the moving joints, each with one coordinate, in the order of all joint vectors; the other
            joints are fixed at position 0. None: all joints move, mimic joints independently; planar joints have three
            coordinates (angle, x, y), floating ones six (rotations, translations).

    Attributes:
        joints: name of the joint of each coordinate, n names.
        index: index of each link by name; -1: the root.
        bodies: compiled dynamics.

    Raises:
        UnknownNameError: there is no such joint with one coordinate.
    """

    def __init__(self, robot: Robot, joints: Sequence[str] | None = None) -> None:
        if joints is None:
            self.joints = [joint.name for joint in robot.joints.values() for _ in _motions(joint)]
        else:
            self.joints = list(joints)
            single = [joint.name for joint in robot.joints.values() if joint.type in ONE_COORDINATE]
            check_known("joint with one coordinate", joints, single, f"robot {robot.name}")
        self._robot, self.index = robot, {robot.root: -1}
        rows: list[list[float]] = []
        for joint in robot.joints.values():
            moves = joint.name in self.joints
            motions, first = (_motions(joint), self.joints.index(joint.name)) if moves else ([_FIXED], -1)
            parent, T = self.index[joint.parent], joint.T_parent_joint
            for number, (slides, axis) in enumerate(motions):
                mass = robot.links[joint.child].mass if number == len(motions) - 1 else None
                rows.append([first + number, *link_row(parent, slides, T, axis, mass or MassProperties())])
                parent, T = len(rows) - 1, np.eye(4)
            self.index[joint.child] = parent
        self.n = len(self.joints)
        self.bodies = Bodies(self.n, rows)

    def capsule_ends(self, q: Sequence[float], T_base: Sequence[float], capsules: FloatArray, ends: FloatArray) -> None:
        """Write both ends of the axes of capsules in the world at joint positions.

        Args:
            q: joint positions, n floats [rad or m].
            T_base: pose of the root link in the world, 12 floats as of `pose_row`.
            capsules: index of the link, both ends in its frame [m], and radius [m] of each capsule, shape (k, 8).
            ends: result, shape (k, 2, 3) [m].
        """
        self.bodies.capsule_ends(q, T_base, capsules, ends)

    def positions(self, q: Mapping[str, float]) -> list[float]:
        """Return the vector of joint positions [rad or m] from a mapping by name; joints not in it are at 0."""
        return [q.get(name, 0.0) for name in self.joints]

    def mass_matrix(self, q: Sequence[float]) -> FloatArray:
        """Return the mass matrix without rotor inertia, shape (n, n) [kg m^2, kg m, kg].

        q: joint positions, n floats [rad or m]."""
        return np.array(self.bodies.mass_matrix(q)).reshape(self.n, self.n)

    def jacobian(self, q: Sequence[float], link: str, point: Sequence[float]) -> FloatArray:
        """Return the Jacobian of a point on a link, shape (6, n): velocity and angular velocity per joint velocity.

        Args:
            q: joint positions, n floats [rad or m].
            link: name of the link.
            point: present position of the point, in the root link's frame, 3 floats [m].

        Raises:
            UnknownNameError: there is no such link.
        """
        self._robot.check_link(link)
        if self.index[link] < 0:
            return np.zeros((6, self.n))
        return np.array(self.bodies.jacobian(q, self.index[link], point)).reshape(6, self.n)

    def point_jacobian(self, q: Sequence[float], link: str, point: Sequence[float]) -> FloatArray:
        """Return the translational Jacobian of a point on a link, shape (3, n): its velocity per joint velocity.

        Args:
            q: joint positions, n floats [rad or m].
            link: name of the link.
            point: present position of the point, in the root link's frame, 3 floats [m].

        Raises:
            UnknownNameError: there is no such link.
        """
        return self.jacobian(q, link, point)[:3]


def _motions(joint: Joint) -> list[tuple[bool, Sequence[float]]]:
    """Return (True for translation, unit axis in the joint frame) for each coordinate of a joint."""
    if joint.type == "fixed":
        return []
    if joint.type in ONE_COORDINATE:
        return [(joint.type == "prismatic", joint.axis.tolist())]
    x, y, z = rotation_onto(2, joint.axis).T.tolist() if joint.type == "planar" else np.eye(3).tolist()
    turning, sliding = ([z], [x, y]) if joint.type == "planar" else ([x, y, z], [x, y, z])
    return [*((False, axis) for axis in turning), *((True, axis) for axis in sliding)]
