"""Contacts in PyBullet: the engine's rigid contacts, and penalty contact with realistic forces.

With a step of 1 ms, the peak force of the engine's own compliant contact is 9 to 26 % below the formula of ISO/TS
15066. Penalty contact is therefore computed here: one spring per pair of links pushes both by external forces, at the
centre of the overlap area (`hric_control.plants.faces`), with the mean force of its motion through the step
(`hric_control.plants.spring_step`). The engine's own contact is switched off for these pairs.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
import pybullet

from hric_control.plant import Contact, FloatArray, Surface
from hric_control.plants import ContactLaw, Springs, combine, faces
from hric_core.geometry.transforms import cross, homogeneous, inverse, rotation_from_quaternion
from pybullet_ros_control.engine import LoadedBody, PhysicsClient
from pybullet_ros_control.external_forces import ExternalForces, Mobility
from pybullet_ros_control.model_joints import PybulletModelJoints
from pybullet_ros_control.robot import PybulletRobot

LOOK_AHEAD = 5.0
"""Maximum approach speed at which links are found before they touch [m/s] (project default, unconfirmed)."""

EngineLink = tuple[int, int]
"""PyBullet's numbers of a body and of one of its links."""
Laws = dict[tuple[int, int], tuple[ContactLaw, float]]
"""Contact law and friction coefficient [1] of each pair of links, by PyBullet's link indices in two bodies."""


@dataclass
class PenaltyPair:
    """Two bodies, some of whose links use penalty contact with each other, and the contact laws of these links."""

    a: LoadedBody
    b: LoadedBody
    laws: Laws


@dataclass(frozen=True)
class _Link:
    """Motion of one link in the present step, in the world frame.

    Attributes:
        body, index: body and engine index of the link.
        T: pose of the link's centre-of-mass frame, shape (4, 4).
        linear, angular: velocities of the centre of mass now and one step before, shape (2, 3) each [m/s], [rad/s].
    """

    body: LoadedBody
    index: int
    T: FloatArray
    linear: FloatArray
    angular: FloatArray

    def velocities(self, point: FloatArray) -> FloatArray:
        """Return the velocity of the link's material at a point [m], now and one step before, shape (2, 3) [m/s]."""
        # omega x r = - r x omega
        return np.array([v - cross(point - self.T[:3, 3], w) for v, w in zip(self.linear, self.angular, strict=True)])


def _of_two_arms(body: LoadedBody) -> Iterator[tuple[int, int]]:
    """Yield the pairs of links of different arms, by their engine indices, unless both are fixed."""
    if body.model is None or not body.model.description.arms():
        return
    robot = body.model.description
    neighbours = robot.neighbours()
    for (name_a, a), (name_b, b) in combinations(body.links.items(), 2):
        if robot.apart(name_a, name_b) and frozenset((name_a, name_b)) not in neighbours:
            yield a, b


def _names(body: LoadedBody, index: int) -> str:
    return f"{body.name}::{body.link_names[index]}"


class PybulletPenaltyContact:
    """Penalty contact between all pairs of links whose surfaces request it.

    Args:
        engine: engine with the bodies.
        springs: contact springs of the link pairs, with their state.

    Attributes:
        pairs: pairs of bodies with penalty contact.
        last: penalty contacts of the last step.
    """

    def __init__(self, engine: PhysicsClient, springs: Springs) -> None:
        self._engine, self.springs = engine, springs
        self.pairs: list[PenaltyPair] = []
        self.last: list[Contact] = []
        self._mobility = Mobility(engine)
        self._solids: dict[tuple[int, int], list[faces.Solid]] = {}
        self._links: dict[tuple[int, int], _Link] = {}
        self._before: dict[tuple[int, int], _Link] = {}

    def set_pairs(
        self,
        bodies: Mapping[str, LoadedBody],
        surface: Callable[[LoadedBody, int], Surface],
        apart: Collection[tuple[EngineLink, EngineLink]],
    ) -> None:
        """Determine all pairs with penalty contact again, and switch off their rigid contact in the engine.

        Args:
            bodies: bodies by name.
            surface: function that returns the surface of a body's link, by its engine index.
            apart: link pairs that must not touch, e.g. because a bushing connects them.
        """
        self.forget()
        self.pairs, self._solids = [], {}
        self._mobility.clear()
        ordered = list(bodies.values())
        for i, a in enumerate(ordered):
            for b in ordered[i:]:
                laws: Laws = {}
                links = product(a.links.values(), b.links.values()) if a is not b else _of_two_arms(a)
                for link_a, link_b in links:
                    ends = (a.id, link_a), (b.id, link_b)
                    if ends in apart or ends[::-1] in apart:
                        continue
                    law = combine(surface(a, link_a), surface(b, link_b))
                    if law is not None:
                        laws[link_a, link_b] = law
                        pybullet.setCollisionFilterPair(
                            a.id, b.id, link_a, link_b, 0, physicsClientId=self._engine.client
                        )
                if laws:
                    self.pairs.append(PenaltyPair(a, b, laws))

    def forget(self) -> None:
        """Clear the memory of the previous step, after bodies were repositioned."""
        self.springs.forget()
        self.last, self._links = [], {}

    def apply(self, forces: ExternalForces, robot: PybulletRobot, joints: Mapping[str, PybulletModelJoints]) -> None:
        """Push each overlapping pair of links apart in the coming step.

        Args:
            forces: external forces of the step, to which the contact forces are added.
            robot: robot in the engine.
            joints: joints of the other models, by name of the model.
        """
        self.last = []
        self.springs.begin()
        self._before, self._links = self._links, {}
        self._mobility.begin(robot, joints, forces)
        reach = LOOK_AHEAD * self._engine.time_step
        for pair in self.pairs:
            points = pybullet.getClosestPoints(pair.a.id, pair.b.id, reach, physicsClientId=self._engine.client)
            if points:
                self._meet(pair, points, forces)

    def _meet(self, pair: PenaltyPair, points: tuple[tuple[Any, ...], ...], forces: ExternalForces) -> None:
        by_links: dict[tuple[int, int], list[tuple[Any, ...]]] = {}
        for point in points:
            if (point[3], point[4]) in pair.laws:
                by_links.setdefault((point[3], point[4]), []).append(point)
        # One spring per pair of links, so that several shapes do not make a link stiffer.
        for links, of_links in by_links.items():
            self._push(pair, links, of_links, forces)

    def _push(
        self, pair: PenaltyPair, links: tuple[int, int], points: list[tuple[Any, ...]], forces: ExternalForces
    ) -> None:
        a, b = self._link(pair.a, links[0]), self._link(pair.b, links[1])
        law, friction = pair.laws[links]
        normal = faces.mean_normal([(-point[8], np.array(point[7])) for point in points])
        corners = [corner for point in points for corner in self._corners(a, b, point)]
        step = self._engine.time_step
        # The engine's positions are half a step later than its velocities, at the middle of the step.
        position, depth = faces.centre(corners)
        relative = a.velocities(position) - b.velocities(position)
        speed, before = (-relative @ normal).tolist()

        def inverse_mass(direction: FloatArray) -> float:
            return sum(self._mobility.inverse_mass(link.body, link.index, position, direction) for link in (a, b))

        name_a, name_b = _names(a.body, a.index), _names(b.body, b.index)
        done = self.springs.push(
            (name_a, name_b),
            depth - 0.5 * step * speed,
            speed,
            (speed - before) / step,
            inverse_mass(normal),
            law,
        )
        if done.mean <= 0.0:
            return
        at, direction = tuple(position.tolist()), tuple(normal.tolist())
        rub = self.springs.rub((name_a, name_b), friction * done.mean, normal, relative, inverse_mass)
        force = (done.mean * normal + rub).tolist()
        forces.apply(a.body, a.index, force, None, at)
        forces.apply(b.body, b.index, [-f for f in force], None, at)
        impulse, energy = step * done.mean, self.springs.energy((name_a, name_b))
        self.last.append(Contact(name_a, name_b, at, direction, depth, done.reading, "penalty", impulse, speed, energy))

    def _corners(self, a: _Link, b: _Link, point: tuple[Any, ...]) -> list[faces.Corner]:
        """Return the intersections of the shapes that a closest point belongs to."""
        normal, depth = np.array(point[7]), -point[8]
        deepest = 0.5 * (np.array(point[5]) + np.array(point[6]))
        for solid_a, solid_b in product(self._solids_of(a), self._solids_of(b)):
            corners = faces.corners(solid_a, a.T, solid_b, b.T, normal, deepest, depth)
            if len(corners) > 1:
                return corners
        return [faces.Corner(deepest, depth, 1.0)]

    def _solids_of(self, link: _Link) -> list[faces.Solid]:
        key = (link.body.id, link.index)
        if key not in self._solids:
            self._solids[key] = solids(link.body, link.index, self._engine)
        return self._solids[key]

    def _link(self, body: LoadedBody, index: int) -> _Link:
        key = (body.id, index)
        if key not in self._links:
            position, orientation, linear, angular = self._engine.motion(body, index)
            T = homogeneous(rotation_from_quaternion(orientation), position)
            old = self._before.get(key)
            # Without a previous step, the velocities are assumed to be constant.
            was = (linear, angular) if old is None else (old.linear[0], old.angular[0])
            self._links[key] = _Link(body, index, T, np.array([linear, was[0]]), np.array([angular, was[1]]))
        return self._links[key]


def rigid_contacts(engine: PhysicsClient, bodies: Mapping[int, LoadedBody]) -> list[Contact]:
    """Return the engine's contacts of the last step that carry a force or overlap."""
    result = []
    for point in pybullet.getContactPoints(physicsClientId=engine.client):
        force, depth = point[9], -point[8]
        if force > 0.0 or depth > 0.0:
            a, b = _names(bodies[point[1]], point[3]), _names(bodies[point[2]], point[4])
            result.append(Contact(a, b, point[5], point[7], depth, force, "rigid", engine.time_step * force))
    return result


def solids(body: LoadedBody, index: int, engine: PhysicsClient) -> list[faces.Solid]:
    """Return the collision shapes of a link in its centre-of-mass frame; a mesh is left out if there are others."""
    data = pybullet.getCollisionShapeData(body.id, index, physicsClientId=engine.client)
    shapes = []
    for shape in data:
        solid = _solid(shape[2], shape[3], homogeneous(rotation_from_quaternion(shape[6]), shape[5]))
        if solid is None and shape[2] == pybullet.GEOM_MESH and len(data) == 1 and body.model is not None:
            corners = body.model.hulls[body.link_names[index]]
            solid = faces.Solid("hull", (), inverse(engine.inertial_frame(body, index)), corners)
        if solid is not None:
            shapes.append(solid)
    return shapes


def _solid(kind: int, size: tuple[float, ...], T: FloatArray) -> faces.Solid | None:
    if kind == pybullet.GEOM_SPHERE:
        return faces.Solid("sphere", size[:1], T)
    if kind == pybullet.GEOM_BOX:
        return faces.Solid("box", size, T)
    if kind == pybullet.GEOM_CAPSULE:
        return faces.Solid("capsule", (size[1], size[0]), T)
    if kind == pybullet.GEOM_CYLINDER:
        return faces.Solid("cylinder", (size[1], size[0]), T)
    return faces.Solid("plane", (), T) if kind == pybullet.GEOM_PLANE else None
