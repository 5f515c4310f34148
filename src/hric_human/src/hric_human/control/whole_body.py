"""Kinematics and inverse dynamics of a human body in the world, and the wrench of the person on the floor."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import IDENTITY, ORIGIN, FloatArray, Pose, Quaternion, Vector, transformed
from hric_core.geometry.quaternions import cross, from_rotation_vector, product
from hric_core.urdf import read
from hric_dynamics.tree import Tree
from hric_human.body import Body
from hric_human.body.segments import ROOT
from hric_human.control.kinematics import GRAVITY

Wrench = tuple[float, float, float, float, float, float]
"""Force (x, y, z) [N] and torque (x, y, z) [N m] about the origin of the frame in which both are expressed."""


class ExternalLoad(NamedTuple):
    """External load on a link at n instants, in axes of the world.

    Attributes:
        link: name of the link.
        force, torque: shape (n, 3) [N], [N m].
        point: point at which the force acts, shape (n, 3) [m].
    """

    link: str
    force: FloatArray
    torque: FloatArray
    point: FloatArray


class RootMotion(NamedTuple):
    """Motion of a root link at n instants, in axes of the world.

    Attributes:
        position: position of the link's origin, shape (n, 3) [m].
        orientation: unit quaternions (x, y, z, w), shape (n, 4).
        omega, alpha: angular velocity and acceleration, shape (n, 3) [rad/s], [rad/s^2].
        acceleration: acceleration of the link's origin, shape (n, 3) [m/s^2].
    """

    position: FloatArray
    orientation: FloatArray
    omega: FloatArray
    alpha: FloatArray
    acceleration: FloatArray

    @classmethod
    def at_rest(cls, T_world_root: Pose, instants: int) -> "RootMotion":
        """Return the motion of a root link at rest at a pose, for a number of instants."""
        rows, none = np.ones((instants, 1)), np.zeros((instants, 3))
        return cls(rows * T_world_root.position, rows * T_world_root.orientation, none, none, none)


class Needed(NamedTuple):
    """Result of inverse dynamics at n instants for a body with j joints and l links, in axes of the world.

    Attributes:
        torque: joint torques, shape (n, j) [N m].
        force, moment: reaction that each link receives from its parent through their joint, the moment about the link's
            origin, shape (n, l, 3) [N], [N m].
        position: positions of the links' origins, shape (n, l, 3) [m].
        rotation: rotations of the links, shape (n, l, 3, 3).
    """

    torque: FloatArray
    force: FloatArray
    moment: FloatArray
    position: FloatArray
    rotation: FloatArray


class _Link(NamedTuple):
    """Link and the joint that attaches it to its parent.

    Attributes:
        name: name of the link.
        parent: index of the parent link; -1: the root.
        offset: position of the joint, in axes of the parent [m].
        axis: axis of the joint; zero if it is fixed.
        joint: index of the joint in the body's order; 0 if it is fixed.
    """

    name: str
    parent: int
    offset: Vector
    axis: Vector
    joint: int


class WholeBody:
    """Kinematics and inverse dynamics of all links of a body, including auxiliary links between joints at one point.

    Args:
        body: described body.

    Attributes:
        body: described body.
        links: all links but the root, from the root outwards.
        index: index of each link in `links`, by name.
    """

    def __init__(self, body: Body) -> None:
        self.body = body
        robot, order = read(body.urdf), list(body.joints)
        tree = Tree(robot, order)
        self.links = [
            _Link(
                joint.child,
                tree.index[joint.parent],
                _vector(joint.T_parent_joint[:3, 3]),
                _vector(joint.axis) if joint.name in body.joints else ORIGIN,
                order.index(joint.name) if joint.name in body.joints else 0,
            )
            for joint in robot.joints.values()
        ]
        self.index = {link.name: at for at, link in enumerate(self.links)}
        self._bodies = tree.bodies

    def inverse_dynamics(
        self,
        q: FloatArray,
        dq: FloatArray,
        ddq: FloatArray,
        root: Pose | RootMotion,
        loads: Sequence[ExternalLoad] = (),
        gravity: Vector = GRAVITY,
    ) -> Needed:
        """Compute the joint torques and reactions of a motion under external loads (recursive Newton-Euler algorithm).

        Args:
            q: joint positions, shape (n, j) [rad].
            dq: joint velocities, shape (n, j) [rad/s].
            ddq: joint accelerations, shape (n, j) [rad/s^2].
            root: pose of the root link in the world if it is at rest, or its motion.
            loads: external loads on links.
            gravity: gravity vector in axes of the world [m/s^2].

        Raises:
            HricError: a load on a link that the body does not have.
        """
        wrong = [external.link for external in loads if external.link not in self.index]
        if wrong:
            raise HricError(f"load on {wrong[0]!r}, which is no link of the body; valid: {', '.join(self.index)}")
        n, links = len(q), len(self.links)
        acting = np.zeros((n, len(loads), 9))
        for at, external in enumerate(loads):
            acting[:, at] = np.hstack([external.force, external.torque, external.point])
        moved = RootMotion.at_rest(root, n) if isinstance(root, Pose) else root
        motion = [np.ascontiguousarray(values, np.float64) for values in (np.hstack(moved), q, dq, ddq)]
        force, moment, position = (np.empty((n, links, 3)) for _ in range(3))
        needed = Needed(np.zeros(motion[1].shape), force, moment, position, np.empty((n, links, 3, 3)))
        self._bodies.solve(gravity, [self.index[external.link] for external in loads], *motion, acting, *needed)
        return needed

    def poses(self, q: Sequence[float], T_world_root: Pose) -> dict[str, Pose]:
        """Return the poses of all links in the world, by name; q: n floats [rad]."""
        in_world = [*[Pose()] * len(self.links), T_world_root]  # the root is last: its index as a parent is -1
        for at, link in enumerate(self.links):
            parent = in_world[link.parent]
            in_world[at] = Pose(transformed(parent, link.offset), product(parent.orientation, _rotation(link, q)))
        return dict(zip([*[link.name for link in self.links], ROOT], in_world, strict=True))

    def markers(self, poses: Mapping[str, Pose]) -> dict[str, Vector]:
        """Return the positions of the body's markers in the world, by name [m]; poses: poses of the links by name."""
        return {
            marker.name: transformed(poses[marker.link], _vector(marker.p_link_marker))
            for marker in self.body.markers.values()
        }


def _vector(array: FloatArray) -> Vector:
    x, y, z = array.tolist()
    return x, y, z


def _rotation(link: _Link, q: Sequence[float]) -> Quaternion:
    """Return the rotation of a link in its parent."""
    if link.axis == ORIGIN:
        return IDENTITY
    angle, (a, b, c) = q[link.joint], link.axis
    return from_rotation_vector((angle * a, angle * b, angle * c))


def floor_wrench(
    dynamics: WholeBody,
    q: Sequence[float],
    dq: Sequence[float],
    ddq: Sequence[float],
    T_world_root: Pose,
    gravity: Vector = GRAVITY,
) -> Wrench:
    """Return the wrench that a person with empty hands exerts on the floor: sum of m (g - a) and its moments.

    Loads on the hands are to be added. The mass of parts that the body lacks (legs, if it is an arm) counts as at rest
    on the vertical through the root link.

    Args:
        dynamics: body of the person.
        q: joint positions, n floats [rad].
        dq: joint velocities, n floats [rad/s].
        ddq: joint accelerations, n floats [rad/s^2].
        T_world_root: pose of the root link, which is at rest.
        gravity: gravity vector in axes of the world [m/s^2].

    Returns:
        wrench in axes of the world, about its origin.
    """
    moved = dynamics.inverse_dynamics(np.array([q]), np.array([dq]), np.array([ddq]), T_world_root, (), gravity)
    rest = _scaled(dynamics.body.subject.mass - dynamics.body.total_mass, gravity)
    force, torque = rest, cross(T_world_root.position, rest)
    for at, link in enumerate(dynamics.links):
        if link.parent < 0:
            pressed = _scaled(-1.0, _vector(moved.force[0, at]))
            torque = _sum(torque, cross(_vector(moved.position[0, at]), pressed), _vector(-moved.moment[0, at]))
            force = _sum(force, pressed)
    return *force, *torque


def _scaled(factor: float, v: Vector) -> Vector:
    return factor * v[0], factor * v[1], factor * v[2]


def _sum(a: Vector, b: Vector, c: Vector = ORIGIN) -> Vector:
    return a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2]
