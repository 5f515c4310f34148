"""Contacts in MuJoCo: the engine's rigid contacts, and penalty contact with realistic forces.

MuJoCo's own soft contact is not suitable: a negative `solref` is no stiffness in N/m, and each contact point would be a
separate spring. So penalty contact is computed here: one spring per pair of links, at the centre of the overlap area
(`hric_control.plants.faces`), with the mean force of its motion through the step (`hric_control.plants.spring_step`),
as in the other plants.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import mujoco
import numpy as np

from hric_control.plant import Contact
from hric_control.plants import Springs, faces
from hric_core.geometry.transforms import FloatArray, cross
from mujoco_ros_control.scene import CompiledScene
from mujoco_ros_control.scene_spec import Geom, Law


@dataclass(frozen=True)
class _Near:
    """Two shapes that overlap, or may do so within the step.

    Attributes:
        a, b: the shapes.
        law: contact law of their links.
        normal: unit vector from b to a, world frame, shape (3,).
        position: point midway between the shapes, world frame, shape (3,) [m].
        depth: depth of the overlap, negative for a gap [m].
    """

    a: Geom
    b: Geom
    law: Law
    normal: FloatArray
    position: FloatArray
    depth: float


class MujocoPenaltyContact:
    """Penalty contact between all pairs of links whose surfaces request it.

    Args:
        springs: contact springs of the link pairs, with their state.

    Attributes:
        last: penalty contacts of the last step.
        any: True if the scene has pairs with penalty contact.
    """

    def __init__(self, springs: Springs) -> None:
        self._step, self.springs = springs.time_step, springs
        self.last: list[Contact] = []
        self._speeds: FloatArray | None = None

    def bind(self, scene: CompiledScene) -> None:
        """Use a newly compiled scene."""
        self._scene, self._data, self._qvel, self._speeds = scene, scene.d, scene.d.qvel, None
        self.any = bool(scene.springs)
        if not self.any:
            self.last = []

    def forget(self) -> None:
        """Clear the memory of the previous step, after bodies were repositioned."""
        self.springs.forget()
        self.last, self._speeds = [], None

    def push(self) -> None:
        """Push each overlapping pair of links apart in the coming step, from the present positions and velocities."""
        speeds = self._qvel.copy()
        before = speeds if self._speeds is None else self._speeds
        self._speeds = speeds
        self.last = []
        self.springs.begin()
        if not self._data.ncon:
            return
        for _, group in groupby(self._near(), key=lambda near: (near.a.link, near.b.link)):
            self._push(list(group), speeds, before)

    def _near(self) -> list[_Near]:
        """Return the pairs of shapes that are near each other, with their deepest point, sorted by pairs of links."""
        contact, deepest = self._scene.d.contact, dict[tuple[int, int], int]()
        springs, apart = self._scene.springs, self._scene.apart
        distances = contact.dist.tolist()
        for i, geoms in enumerate(map(tuple, contact.geom.tolist())):
            if geoms not in springs or geoms in apart:
                continue
            if distances[i] < distances[deepest.setdefault(geoms, i)]:
                deepest[geoms] = i
        pairs = []
        for geoms, i in deepest.items():
            a, b, law, forward = springs[geoms]
            normal = contact.frame[i, :3] * (-1.0 if forward else 1.0)
            pairs.append(_Near(a, b, law, normal, contact.pos[i].copy(), -distances[i]))
        return sorted(pairs, key=lambda near: (near.a.link, near.b.link))

    def _push(self, near: Sequence[_Near], speeds: FloatArray, before: FloatArray) -> None:
        """Apply one spring for a pair of links, so that several shapes do not make a link stiffer."""
        scene, first = self._scene, near[0]
        bodies = [scene.bodies[geom.body] for geom in (first.a, first.b)]
        law, friction = first.law
        normal = faces.mean_normal([(shape.depth, shape.normal) for shape in near])
        corners = [corner for shape in near for corner in self._corners(shape)]
        angular, linear = (self._relative(bodies, corners[0].position) @ speeds).reshape(2, 3)
        pace, lever = float(linear @ normal), cross(normal, angular)
        closing = [-pace - float((corner.position - corners[0].position) @ lever) for corner in corners]
        # Time to the middle of the step; semi-implicit positions are already there.
        position, depth = faces.centre(corners, closing, 0.0 if scene.semi_implicit else 0.5 * self._step)
        J = self._relative(bodies, position)[3:]
        row = normal @ J
        speed = -float(row @ speeds)
        pair = first.a.link, first.b.link
        done = self.springs.push(
            pair,
            depth - 0.5 * self._step * speed,
            speed,
            -float(row @ (speeds - before)) / self._step,
            self._inverse_mass(row),
            law,
        )
        if done.mean <= 0.0:
            return
        relative = np.array([J @ speeds, J @ before])
        rub = self.springs.rub(
            pair, friction * done.mean, normal, relative, lambda along: self._inverse_mass(along @ J)
        )
        force = done.mean * normal + rub
        for body, sign in zip(bodies, (1.0, -1.0), strict=True):
            act(scene, body, sign * force, np.zeros(3), position)
        at, direction = tuple(position.tolist()), tuple(normal.tolist())
        impulse, energy = self._step * done.mean, self.springs.energy(pair)
        self.last.append(Contact(*pair, at, direction, depth, done.reading, "penalty", impulse, speed, energy))

    def _corners(self, near: _Near) -> list[faces.Corner]:
        poses = [self._scene.pose(self._scene.bodies[geom.body]) for geom in (near.a, near.b)]
        return faces.corners(near.a.solid, poses[0], near.b.solid, poses[1], near.normal, near.position, near.depth)

    def _relative(self, bodies: Sequence[int], point: FloatArray) -> FloatArray:
        """Return the Jacobian of the velocity of body a relative to body b at a point [m].

        Angular above linear, shape (6, nv); bodies: MuJoCo ids of a and b.
        """
        m, d = self._scene.m, self._scene.d
        result = np.zeros((6, m.nv))
        for body, sign in zip(bodies, (1.0, -1.0), strict=True):
            linear, angular = np.empty((3, m.nv)), np.empty((3, m.nv))
            mujoco.mj_jac(m, d, linear, angular, point, body)
            result += sign * np.concatenate([angular, linear])
        return result

    def _inverse_mass(self, row: FloatArray) -> float:
        """Return the inverse effective mass row (M + B)^-1 row' [1/kg], with row = n' J for a direction n, shape (nv,).

        Braked and driven joints have such a large rotor inertia B that they count as fixed.
        """
        return float(row @ self._scene.response(row[None])[0])


def act(scene: CompiledScene, body: int, force: FloatArray, torque: FloatArray, point: FloatArray) -> None:
    """Apply a force [N] at a point [m] and a torque [N m] to a body in the coming step, world frame."""
    applied = scene.d.xfrc_applied[body]
    applied[:3] += force
    applied[3:] += torque + cross(point - scene.d.xipos[body], force)


def rigid_contacts(scene: CompiledScene, time_step: float) -> list[Contact]:
    """Return MuJoCo's contacts of the last step that carry a force or overlap."""
    d = scene.d
    contact, links = d.contact, scene.links
    addresses = contact.efc_address.tolist()
    forces = d.efc_force.tolist()
    columns = (contact.geom.tolist(), contact.dist.tolist(), contact.pos.tolist(), contact.frame[:, :3].tolist())
    result = []
    for address, (b, a), distance, position, normal in zip(addresses, *columns, strict=True):
        if (b, a) in scene.springs or (b, a) in scene.apart:
            continue
        force = forces[address] if address >= 0 else 0.0
        if force > 0.0 or distance < 0.0:
            names = links[a], links[b]
            result.append(Contact(*names, tuple(position), tuple(normal), -distance, force, "rigid", time_step * force))
    return result
