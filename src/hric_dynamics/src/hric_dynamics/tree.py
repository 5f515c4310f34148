"""Mass matrix, Jacobians, gravity torque and inverse dynamics of a tree of links, compiled: no engine."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hric_core.errors import check_known
from hric_core.geometry import FloatArray, MassProperties
from hric_core.geometry.transforms import rotation_onto
from hric_core.native import load
from hric_core.urdf.robot import ONE_COORDINATE, Joint, Robot

_Bodies: Any = load("hric_bodies").Bodies
_FIXED = (True, (0.0, 0.0, 0.0))


def pose_row(T: FloatArray) -> list[float]:
    """Return a pose, shape (4, 4), in the layout of `Pose` in rigid_body.h: rotation row-major and position."""
    return [*T[:3, :3].ravel().tolist(), *T[:3, 3].tolist()]


def link_row(
    parent: int, slides: bool, T_parent_joint: FloatArray, axis: Iterable[float], body: MassProperties
) -> list[float]:
    """Return a link behind its joint in the layout of `Link` in tree.h.

    Args:
        parent: number of the link to which the joint is attached; -1: the base.
        slides: True for a prismatic joint; with a zero axis the joint is fixed.
        T_parent_joint: pose of the joint at zero, shape (4, 4) [m].
        axis: unit vector in the joint frame, 3 floats.
        body: mass properties in the link's frame.
    """
    mass = body.mass, *body.com.tolist(), *body.inertia.ravel().tolist()
    return [float(parent), float(slides), *pose_row(T_parent_joint), *axis, *mass]


class Tree:
    """Dynamics of a robot description on a base at rest, in axes of its root link.

    One instance serves one thread.

    Args:
        robot: the description.
        joints: joints with one coordinate that move, in the order of all vectors; the others are fixed at zero. None:
            all joints move, mimic joints freely; planar ones have three coordinates (angle, x, y), floating ones six
            (rotations, translations).

    Attributes:
        joints: joint of each coordinate, n names.
        index: number of each link, by name; -1: the root.
        bodies: the compiled dynamics.

    Raises:
        UnknownNameError: no such joint with one coordinate.
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
        self.bodies = _Bodies(self.n, rows)

    def positions(self, q: Mapping[str, float]) -> list[float]:
        """Return the vector of joint positions from those by name [rad or m]; the others are at zero."""
        return [q.get(name, 0.0) for name in self.joints]

    def mass_matrix(self, q: Sequence[float]) -> FloatArray:
        """Return the mass matrix without rotors, shape (n, n) [kg m^2, kg m, kg]; q: n floats [rad or m]."""
        return np.array(self.bodies.mass_matrix(q)).reshape(self.n, self.n)

    def point_jacobian(self, q: Sequence[float], link: str, point: Sequence[float]) -> FloatArray:
        """Return the velocity of a point on a link per joint speed, shape (3, n).

        Args:
            q: joint positions, n floats [rad or m].
            link: name of the link.
            point: present position, in axes of the root link, 3 floats [m].

        Raises:
            UnknownNameError: no such link.
        """
        self._robot.check_link(link)
        if self.index[link] < 0:
            return np.zeros((3, self.n))
        return np.array(self.bodies.jacobian(q, self.index[link], point)).reshape(6, self.n)[:3]


def _motions(joint: Joint) -> list[tuple[bool, Sequence[float]]]:
    """Return the joint's coordinates as (True if it slides, unit axis in the joint frame)."""
    if joint.type == "fixed":
        return []
    if joint.type in ONE_COORDINATE:
        return [(joint.type == "prismatic", joint.axis.tolist())]
    x, y, z = rotation_onto(2, joint.axis).T.tolist() if joint.type == "planar" else np.eye(3).tolist()
    turning, sliding = ([z], [x, y]) if joint.type == "planar" else ([x, y, z], [x, y, z])
    return [*((False, axis) for axis in turning), *((True, axis) for axis in sliding)]
