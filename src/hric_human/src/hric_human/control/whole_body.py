"""A whole body in the world, on plain floats: where its links and markers are, and what the floor carries."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from hric_control.geometry import IDENTITY, ORIGIN, FloatArray, Pose, Quaternion, Vector, transformed
from hric_control.geometry.quaternions import cross, from_rotation_vector, inverse, product, rotated
from hric_control.urdf import read
from hric_human.body import Body
from hric_human.body.segments import ROOT
from hric_human.control.kinematics import GRAVITY

Wrench = tuple[float, float, float, float, float, float]
"""Force [N], and torque about the origin of the axes in which it is [N m]."""


class _Link(NamedTuple):
    """A link behind its joint.

    Attributes:
        name: of it.
        parent: index of the link that its joint hangs on; -1: the root.
        offset: of the joint, in axes of the parent [m].
        axis: of the joint; zero where it is fixed.
        joint: index in the body's order; 0 where it is fixed.
        mass, com, inertia: in axes of the link, the inertia by rows [kg], [m], [kg m^2].
    """

    name: str
    parent: int
    offset: Vector
    axis: Vector
    joint: int
    mass: float
    com: Vector
    inertia: tuple[Vector, Vector, Vector]


class WholeBody:
    """All links of a body, from the root outwards, those between the joints of one segment included.

    Args:
        body: whose.

    Attributes:
        body: as given.
        links: see `_Link`.
    """

    def __init__(self, body: Body) -> None:
        self.body = body
        robot, order = read(body.urdf), list(body.joints)
        index = {ROOT: -1}
        self.links: list[_Link] = []
        for joint in robot.joints.values():
            moves, mass = joint.name in body.joints, robot.links[joint.child].mass
            assert mass is not None, "every link of a body but its root has a mass"
            a, b, c = (_vector(row) for row in mass.inertia)
            self.links.append(
                _Link(
                    joint.child,
                    index[joint.parent],
                    _vector(joint.T_parent_joint[:3, 3]),
                    _vector(joint.axis) if moves else ORIGIN,
                    order.index(joint.name) if moves else 0,
                    mass.mass,
                    _vector(mass.com),
                    (a, b, c),
                )
            )
            index[joint.child] = len(self.links) - 1

    def poses(self, q: Sequence[float], T_world_root: Pose) -> dict[str, Pose]:
        """Of all links in the world, by name; q: n floats [rad]."""
        found = [*[Pose()] * len(self.links), T_world_root]  # the root is the last one, as its index has it
        for at, link in enumerate(self.links):
            parent = found[link.parent]
            found[at] = Pose(transformed(parent, link.offset), product(parent.orientation, _rotation(link, q)))
        return dict(zip([*[link.name for link in self.links], ROOT], found, strict=True))

    def markers(self, poses: Mapping[str, Pose]) -> dict[str, Vector]:
        """Positions of the body's markers in the world, by name [m]; poses: of the links, as `poses` gives them."""
        return {
            marker.name: transformed(poses[marker.link], _vector(marker.p_link_marker))
            for marker in self.body.markers.values()
        }


def _vector(array: FloatArray) -> Vector:
    x, y, z = array.tolist()
    return x, y, z


def _rotation(link: _Link, q: Sequence[float]) -> Quaternion:
    """Of a link in its parent."""
    if link.axis == ORIGIN:
        return IDENTITY
    angle, (a, b, c) = q[link.joint], link.axis
    return from_rotation_vector((angle * a, angle * b, angle * c))


class _Moving(NamedTuple):
    """A link, in axes of the world: origin [m] and its acceleration [m/s^2], angular velocity [rad/s] and acceleration
    [rad/s^2]."""

    pose: Pose
    acceleration: Vector
    omega: Vector
    alpha: Vector

    def accelerated(self, r: Vector) -> Vector:
        """Acceleration of the point of the link at r from its origin: a + alpha x r + omega x (omega x r)."""
        return _sum(self.acceleration, cross(self.alpha, r), cross(self.omega, cross(self.omega, r)))


def floor_wrench(
    whole: WholeBody,
    q: Sequence[float],
    dq: Sequence[float],
    ddq: Sequence[float],
    T_world_root: Pose,
    gravity: Vector = GRAVITY,
) -> Wrench:
    """What a person presses on the floor with, whose hands hold nothing: sum of m (g - a) and of its moments over all
    links (Newton-Euler). What holds his hands adds to it as it acts on them.

    What is not described (legs, where the body is an arm) counts as the rest of the subject's mass, at rest below or
    above the root.

    Args:
        whole: whose.
        q, dq, ddq: joint positions, velocities, accelerations, n floats each [rad], [rad/s], [rad/s^2].
        T_world_root: pose of the root link, which is at rest.
        gravity: in axes of the world [m/s^2].

    Returns:
        in axes of the world, about its origin.
    """
    rest = whole.body.subject.mass - whole.body.total_mass
    weight = _scaled(rest, gravity)
    force, torque = weight, cross(T_world_root.position, weight)
    found = [*[_Moving(Pose(), ORIGIN, ORIGIN, ORIGIN)] * len(whole.links), _Moving(T_world_root, *[ORIGIN] * 3)]
    for at, link in enumerate(whole.links):
        moving = found[at] = _behind(found[link.parent], link, q, dq, ddq)
        orientation = moving.pose.orientation
        com = rotated(orientation, link.com)
        pressed = _scaled(link.mass, _sum(gravity, _scaled(-1.0, moving.accelerated(com))))
        p = _sum(moving.pose.position, com)
        force = _sum(force, pressed)
        torque = _sum(torque, cross(p, pressed), _scaled(-1.0, _spin(link, moving)))
    return *force, *torque


def _behind(parent: _Moving, link: _Link, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> _Moving:
    """A link behind its joint."""
    orientation, omega = parent.pose.orientation, parent.omega
    r, axis = rotated(orientation, link.offset), rotated(orientation, link.axis)
    rate = _scaled(dq[link.joint], axis)
    return _Moving(
        Pose(_sum(parent.pose.position, r), product(orientation, _rotation(link, q))),
        parent.accelerated(r),
        _sum(omega, rate),
        _sum(parent.alpha, _scaled(ddq[link.joint], axis), cross(omega, rate)),
    )


def _spin(link: _Link, moving: _Moving) -> Vector:
    """Rate of the angular momentum about the centre of mass, in axes of the world: I alpha + omega x I omega."""
    orientation = moving.pose.orientation
    back = inverse(orientation)
    omega, alpha = rotated(back, moving.omega), rotated(back, moving.alpha)
    return rotated(orientation, _sum(_times(link.inertia, alpha), cross(omega, _times(link.inertia, omega))))


def _times(rows: tuple[Vector, Vector, Vector], v: Vector) -> Vector:
    x, y, z = (a * v[0] + b * v[1] + c * v[2] for a, b, c in rows)
    return x, y, z


def _scaled(factor: float, v: Vector) -> Vector:
    return factor * v[0], factor * v[1], factor * v[2]


def _sum(a: Vector, b: Vector, c: Vector = ORIGIN) -> Vector:
    return a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2]
