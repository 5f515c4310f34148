"""Loads in the robot's joints, by Newton and Euler: a joint carries what moves the links outboard of it, less what acts on them from outside.

OpenSim's own reactions do not serve here: they know neither rotors nor the forces that the plant applies beside the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import opensim

from hric_control.plants.reactions import JointReaction
from hric_control.plants.spatial import FloatArray
from opensim_ros_control.engine import Engine
from opensim_ros_control.kinematics import Kinematics, matrix_of


@dataclass(frozen=True)
class Load:
    """A force that acted on a body in a step, ground frame.

    Attributes:
        number: of the body.
        position: shape (3,) [m].
        force, torque: shape (3,) each [N], [N m].
    """

    number: int
    position: FloatArray
    force: FloatArray
    torque: FloatArray


class Reactions:
    """Joint loads of one build of the model.

    Args:
        engine: the model.
        joints: (joint, child link) of the robot's moving joints.
        kinematics: of the same engine.
    """

    def __init__(self, engine: Engine, joints: Sequence[tuple[str, str]], kinematics: Kinematics) -> None:
        self._engine, self._kinematics, self._joints = engine, kinematics, list(joints)
        self._numbers, self._masses, self._coms, self._inertias = self._mass_properties()
        description = engine.built.description
        children: dict[str, list[str]] = {link: [] for link in description.links}
        for joint in description.joints.values():
            children[joint.parent].append(joint.child)
        self._outboard = [self._carriers(child, children) for _, child in self._joints]
        self._sum = np.array([[float(number in outboard) for number in self._numbers] for outboard in self._outboard])
        gravity = engine.model.getGravity()
        self._gravity = np.array([gravity.get(i) for i in range(3)])

    def _mass_properties(self) -> tuple[list[int], FloatArray, FloatArray, FloatArray]:
        """(numbers, masses, centres of mass, tensors about these) of all bodies, in their own axes."""
        numbers, masses, coms, inertias = [], [], [], []
        found = self._engine.model.getBodySet()
        for i in range(found.getSize()):
            body = found.get(i)
            com, inertia = body.getMassCenter(), body.getInertia()
            moments, products = inertia.getMoments(), inertia.getProducts()
            xy, xz, yz = (products.get(k) for k in range(3))
            numbers.append(int(body.getMobilizedBodyIndex()))
            masses.append([body.getMass()])
            coms.append([com.get(k) for k in range(3)])
            inertias.append(np.diag([moments.get(k) for k in range(3)]) + np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]]))
        return numbers, np.array(masses), np.array(coms), np.array(inertias)

    def _carriers(self, link: str, children: dict[str, list[str]]) -> list[int]:
        """Bodies of a link and all that hangs on it."""
        links = [link]
        for name in links:
            links += children[name]
        return sorted({self._kinematics.carrier(self._engine.frames[name])[0] for name in links})

    def _inertial(self, u: FloatArray, du: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(forces, torques about the ground's origin) that move the bodies against gravity, ground frame, one row per body."""
        bias = opensim.Vector()
        self._engine.matter.calcBiasForSystemJacobian(self._engine.system_state, bias)
        J = self._kinematics.system_jacobian()
        velocity, acceleration = ((J @ u).reshape(-1, 6), (J @ du + bias.to_numpy()).reshape(-1, 6))
        w, dw = velocity[self._numbers, :3], acceleration[self._numbers, :3]
        poses = np.array([self._kinematics.pose(number) for number in self._numbers])
        R = poses[:, :3, :3]
        arms, inertias = _times(R, self._coms), R @ self._inertias @ R.transpose(0, 2, 1)
        a = acceleration[self._numbers, 3:] + _cross(dw, arms) + _cross(w, _cross(w, arms))
        forces = self._masses * (a - self._gravity)
        torques = _times(inertias, dw) + _cross(w, _times(inertias, w))
        return forces, torques + _cross(poses[:, :3, 3] + arms, forces)

    def loads(self, y: FloatArray, du: FloatArray, outside: Sequence[Load], R_ground_world: FloatArray) -> list[JointReaction]:
        """Loads in a state y with du/dt, under forces from outside."""
        engine, n = self._engine, self._engine.nu
        engine.put_y(y)
        engine.model.realizeVelocity(engine.system_state)
        self._kinematics.forget()
        forces, torques = (self._sum @ part for part in self._inertial(y[n : 2 * n], du))
        for load in outside:
            carry = [i for i, numbers in enumerate(self._outboard) if load.number in numbers]
            forces[carry] -= load.force
            torques[carry] -= load.torque + _cross(load.position, load.force)
        frames = [engine.frames[link].getTransformInGround(engine.system_state) for _, link in self._joints]
        points = np.array([matrix_of(frame)[:3, 3] for frame in frames])
        torques -= _cross(points, forces)
        rows = zip(self._joints, *(part @ R_ground_world for part in (points, forces, torques)), strict=True)
        return [JointReaction(joint, link, _triple(point), _triple(force), _triple(torque)) for (joint, link), point, force, torque in rows]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """a x b of each row, shape (..., 3)."""
    return np.asarray(a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]])


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Matrix times vector of each row, shapes (k, 3, 3) and (k, 3)."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def _triple(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
