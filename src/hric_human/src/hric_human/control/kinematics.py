"""Kinematics and gravity torque of a human body, computed on plain floats without a physics engine."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from franka_hw_interface.kdl_chain import KdlChain, tree_gravity
from hric_core.geometry import IDENTITY, ORIGIN, FloatArray, Pose, Quaternion, Vector
from hric_core.geometry.quaternions import cross, from_rotation_vector, product, rotated
from hric_core.native import load
from hric_core.urdf import Robot, read
from hric_human.body import Body, BodySegment
from hric_human.body.joints import ARM
from hric_human.body.segments import ROOT

_compiled: Any = load("hric_human_kinematics")
GRAVITY: Vector = (0.0, 0.0, -9.81)
"""Vector of gravity for an upright body, in axes of its root link [m/s^2]."""
Torque = Callable[[Sequence[float]], list[float]]


class Posed(NamedTuple):
    """Kinematic chain of a body at given joint angles, in axes of the root link.

    Attributes:
        origins: origins of its joints [m].
        axes: axes of its joints, unit vectors.
        orientation: orientation of the last link.
        end: origin of the last link [m].
    """

    origins: list[Vector]
    axes: list[Vector]
    orientation: Quaternion
    end: Vector

    def point(self, p_link: Vector) -> Vector:
        """Transform a point from axes of the last link to axes of the root link [m]."""
        x, y, z = rotated(self.orientation, p_link)
        return self.end[0] + x, self.end[1] + y, self.end[2] + z

    def velocities(self, p: Vector) -> list[Vector]:
        """Return the velocity of a point p of the last link for unit speed of each joint: axis x (p - origin) [m/rad].

        p: point in axes of the root link [m].
        """
        x, y, z = p
        return [cross(axis, (x - a, y - b, z - c)) for axis, (a, b, c) in zip(self.axes, self.origins, strict=True)]


class LinkChain:
    """Kinematic chain from the root link of a body to one of its links.

    Args:
        body: body of the chain.
        link: link of a segment, or the root.

    Attributes:
        joints: indices of the chain's joints in the body's order, from the root outwards.
    """

    def __init__(self, body: Body, link: str) -> None:
        by_link = {segment.link: segment for segment in body.segments.values()}
        path: list[BodySegment] = []
        while link != ROOT:
            path.insert(0, by_link[link])
            link = path[0].parent
        self.joints: list[int] = []
        self._frames: list[tuple[int, Vector, Vector]] = []
        offset = ORIGIN
        for segment in path:
            offset = _sum(offset, segment.p_parent_link.tolist())
            for index, joint in enumerate(body.joints.values()):
                if joint.link == segment.link:
                    a, b, c = joint.axis.tolist()
                    self.joints.append(index)
                    self._frames.append((index, offset, (a, b, c)))
                    offset = ORIGIN
        self._after = offset

    def posed(self, q: Sequence[float]) -> Posed:
        """Return the chain's origins, axes and end at joint angles of the whole body [rad]."""
        x, y, z = ORIGIN
        orientation = IDENTITY
        origins, axes = [], []
        for index, offset, axis in self._frames:
            dx, dy, dz = rotated(orientation, offset)
            x, y, z = x + dx, y + dy, z + dz
            origins.append((x, y, z))
            axes.append(rotated(orientation, axis))
            angle = q[index]
            orientation = product(
                orientation, from_rotation_vector((axis[0] * angle, axis[1] * angle, axis[2] * angle))
            )
        dx, dy, dz = rotated(orientation, self._after)
        return Posed(origins, axes, orientation, (x + dx, y + dy, z + dz))


def _sum(a: Vector, b: Sequence[float]) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


class HandChain(LinkChain):
    """Kinematic chain of a hand; the hand's frame has the axes of its link and its origin in its centre of mass.

    Args:
        body: body of the hand.
        side: "right" or "left".

    Attributes:
        side: side of the hand.
        p_link_hand: origin of the hand's frame in its link [m].
        arm: indices of the arm's joints in the body's order.
        reach: distance from the shoulder to the hand's origin with a straight arm [m].
    """

    def __init__(self, body: Body, side: str) -> None:
        hand, forearm = body.segments[f"{side}_hand"], body.segments[f"{side}_forearm"]
        super().__init__(body, hand.link)
        self.side = side
        self.p_link_hand: Vector = _sum(ORIGIN, hand.mass.com.tolist())
        self.arm = self.joints[-len(ARM) :]
        self.reach = -float(forearm.p_parent_link[2] + hand.p_parent_link[2]) - self.p_link_hand[2]

        self._whole = self._numbers(Posed([], [], IDENTITY, ORIGIN), self._frames)

    def _numbers(self, start: Posed, frames: Sequence[tuple[int, Vector, Vector]]) -> FloatArray:
        joints = [number for _, offset, axis in frames for number in (*offset, *axis)]
        return np.array([*start.end, *start.orientation, *self._after, *self.p_link_hand, *joints])

    def numbers(self, q: Sequence[float]) -> FloatArray:
        """Return the arm for `kinematics.c`, with all other joints at the angles q of the whole body [rad]."""
        trunk = copy(self)
        trunk._frames, trunk._after = self._frames[: -len(ARM)], ORIGIN
        return self._numbers(trunk.posed(q), self._frames[-len(ARM) :])

    def pose(self, q: Sequence[float]) -> Pose:
        """Return the pose of the hand in axes of the root link; q: joint angles of the whole body [rad]."""
        px, py, pz, x, y, z, w = _compiled.pose(self._whole, [q[index] for index in self.joints])
        return Pose((px, py, pz), (x, y, z, w))

    def placed(self, q: Sequence[float], T_world_root: FloatArray) -> FloatArray:
        """Return the pose of the hand in the world, shape (4, 4), for a pose of the root link and angles q [rad]."""
        return np.array(_compiled.placed(self._whole, [q[index] for index in self.joints], T_world_root)).reshape(4, 4)

    def shoulder(self, q: Sequence[float]) -> Vector:
        """Return the shoulder joint centre in axes of the root link [m]; q: joint angles of the whole body [rad]."""
        return self.posed(q).origins[-len(ARM)]


def own_weight(body: Body, gravity: Vector = GRAVITY, loads: Mapping[str, float] = {}) -> Torque:
    """Return a function from n joint angles [rad] to the n joint torques [N m] that hold the body against gravity.

    Gravity torques are linear in the masses, so those of a tree are the sum over its chains, if each link's mass counts
    in one chain only.

    Args:
        body: body to hold.
        gravity: gravity vector in axes of the root link [m/s^2].
        loads: masses held in the centres of mass of links, by link [kg].
    """
    names, robot = list(body.joints), read(body.urdf)
    parents = {segment.parent for segment in body.segments.values()}
    counted: set[str] = set()
    parts: list[tuple[KdlChain, list[int]]] = []
    for tip in (segment.link for segment in body.segments.values() if segment.link not in parents):
        path = {joint.child for joint in robot.path(ROOT, tip)}
        chain = KdlChain(_with_mass(robot, path - counted, loads), ROOT, tip, gravity)
        parts.append((chain, [names.index(name) for name in chain.joint_names]))
        counted |= path
    return parts[0][0].gravity_list if len(parts) == 1 else tree_gravity(len(names), parts)


def _with_mass(robot: Robot, links: set[str], loads: Mapping[str, float]) -> Robot:
    """Return a robot in which only the named links have mass, with the loads [kg] added at their centres of mass."""
    made = {}
    for name, link in robot.links.items():
        mass = link.mass if name in links else None
        made[name] = replace(link, mass=mass and replace(mass, mass=mass.mass + loads.get(name, 0.0)))
    return replace(robot, links=made)
