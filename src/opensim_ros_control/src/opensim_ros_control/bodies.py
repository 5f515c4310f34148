"""Poses and Jacobians of a model's bodies, computed at most once per state, and the loads in the robot's joints.

The joint loads follow from the Newton-Euler equations: a joint transmits the inertial forces of the outboard links
minus the external forces on them. OpenSim's own joint reactions are unsuitable, since they do not include rotors and
the forces that the plant applies outside the OpenSim model.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import opensim

from hric_control.plant import JointReaction
from hric_core.geometry import FloatArray
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.robot_model import mass_properties
from urdf_to_osim.transforms import matrix


class Kinematics:
    """Poses and Jacobians of all bodies of an OpenSim model, by OpenSim's body numbers (ground is 0), in ground.

    Args:
        engine: engine with the model; its positions must be realized at each call.
    """

    def __init__(self, engine: OpenSimEngine) -> None:
        self._engine = engine
        self._matrix = opensim.Matrix()
        body_set = engine.model.getBodySet()
        self._bodies = {
            int(body_set.get(i).getMobilizedBodyIndex()): body_set.get(i) for i in range(body_set.getSize())
        }
        self._poses: dict[int, FloatArray] = {}
        self._jacobians: FloatArray | None = None

    def carrier(self, frame: opensim.Frame) -> tuple[int, FloatArray]:
        """Return (number of the body to which a frame is fixed, pose of the frame in that body, shape (4, 4))."""
        number = int(opensim.PhysicalFrame.safeDownCast(frame.findBaseFrame()).getMobilizedBodyIndex())
        return number, matrix(frame.findTransformInBaseFrame())

    def body(self, number: int) -> opensim.PhysicalFrame:
        """Return OpenSim's frame of a body, by its number."""
        return self._bodies.get(number, self._engine.model.getGround())

    def count(self) -> int:
        """Return the number of bodies, ground included."""
        return len(self.system_jacobian()) // 6

    def forget(self) -> None:
        """Discard cached values, after a change of the state."""
        self._poses.clear()
        self._jacobians = None

    def pose(self, number: int) -> FloatArray:
        """Return the pose of a body in ground, shape (4, 4), by its number."""
        if number not in self._poses:
            state = self._engine.system_state
            self._poses[number] = np.eye(4) if number == 0 else matrix(self._bodies[number].getTransformInGround(state))
        return self._poses[number]

    def system_jacobian(self) -> FloatArray:
        """Return the Jacobian of the velocities of all bodies' origins, six rows per body (angular, linear).

        Shape (6 bodies, nu). OpenSim computes all bodies together faster than one alone.
        """
        if self._jacobians is None:
            self._engine.matter.calcSystemJacobian(self._engine.system_state, self._matrix)
            self._jacobians = np.asarray(self._matrix.to_numpy())
        return self._jacobians

    def jacobian(self, number: int, point: FloatArray) -> FloatArray:
        """Return the (angular, linear) velocity Jacobian at a point of a body, shape (6, nu).

        Args:
            number: number of the body.
            point: point in the ground frame, shape (3,) [m].
        """
        result: FloatArray = self.system_jacobian()[6 * number : 6 * number + 6].copy()
        if number != 0:
            x, y, z = (point - self.pose(number)[:3, 3]).tolist()
            # v = v_origin + omega x r
            result[3:] += np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]) @ result[:3]
        return result


@dataclass(frozen=True)
class BodyForce:
    """External load on a body in a step, in the ground frame.

    Attributes:
        number: number of the body.
        position: point of application, shape (3,) [m].
        force, torque: force and torque at that point, shape (3,) each [N], [N m].
    """

    number: int
    position: FloatArray
    force: FloatArray
    torque: FloatArray


class Reactions:
    """Computation of the loads in the robot's joints, for one build of the model.

    Args:
        engine: engine with the model.
        joints: (joint, child link) of the robot's moving joints.
        kinematics: kinematics of the same engine.
    """

    def __init__(self, engine: OpenSimEngine, joints: Sequence[tuple[str, str]], kinematics: Kinematics) -> None:
        self._engine, self._kinematics, self._joints = engine, kinematics, list(joints)
        body_set = engine.model.getBodySet()
        bodies = [body_set.get(i) for i in range(body_set.getSize())]
        self._numbers = [int(body.getMobilizedBodyIndex()) for body in bodies]
        properties = [mass_properties(body) for body in bodies]
        self._masses = np.array([[body.mass] for body in properties])
        self._coms = np.array([body.com for body in properties])
        self._inertias = np.array([body.inertia for body in properties])
        description = engine.built.description
        children: dict[str, list[str]] = {link: [] for link in description.links}
        for joint in description.joints.values():
            children[joint.parent].append(joint.child)
        self._outboard = [self._carriers(child, children) for _, child in self._joints]
        self._sum = np.array([[float(number in outboard) for number in self._numbers] for outboard in self._outboard])
        gravity = engine.model.getGravity()
        self._gravity = np.array([gravity.get(i) for i in range(3)])

    def _carriers(self, link: str, children: dict[str, list[str]]) -> list[int]:
        """Return the numbers of the bodies of a link and of all links outboard of it."""
        links = [link]
        for name in links:
            links += children[name]
        return sorted({self._kinematics.carrier(self._engine.frames[name])[0] for name in links})

    def _inertial(self, u: FloatArray, du: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (forces, torques about ground's origin) that each body's motion needs, with gravity deducted.

        Shape (bodies, 3) each [N], [N m], ground frame; u, du: speeds and their time derivatives, shape (nu,).
        """
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

    def loads(
        self, y: FloatArray, du: FloatArray, outside: Sequence[BodyForce], R_ground_world: FloatArray
    ) -> list[JointReaction]:
        """Return the loads in all moving joints of the robot, in the world frame.

        Args:
            y: state (positions and speeds) in the engine's order.
            du: time derivatives of the speeds, shape (nu,).
            outside: external loads on the bodies.
            R_ground_world: rotation of the world in OpenSim's ground, shape (3, 3).
        """
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
        points = np.array([matrix(frame)[:3, 3] for frame in frames])
        torques -= _cross(points, forces)
        rows = zip(self._joints, *(part @ R_ground_world for part in (points, forces, torques)), strict=True)
        return [
            JointReaction(joint, link, _triple(point), _triple(force), _triple(torque))
            for (joint, link), point, force, torque in rows
        ]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross products a x b, row by row, shape (..., 3)."""
    return np.asarray(a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]])


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return k products of a matrix and a vector, shapes (k, 3, 3) and (k, 3), result (k, 3)."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def _triple(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
