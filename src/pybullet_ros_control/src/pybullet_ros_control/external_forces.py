"""External forces on bodies in one step, their joint efforts J'F, and the effective mass of bodies at a point."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pybullet

from hric_core.geometry.transforms import FloatArray, cross, rotation_from_quaternion, skew
from pybullet_ros_control.engine import LoadedBody, PhysicsClient
from pybullet_ros_control.model_joints import PybulletModelJoints
from pybullet_ros_control.robot import PybulletRobot


class JointRows:
    """Joint efforts J'F of forces at any point of a body, in the engine's order of its moving joints.

    J is computed here, since PyBullet's own function does not return the Jacobian of the given point.

    Args:
        body: body with a model.
        client: PyBullet's number of the physics client.

    Attributes:
        joints: engine indices of the moving joints.
    """

    def __init__(self, body: LoadedBody, client: int) -> None:
        assert body.model is not None
        self._body, self._client = body, client
        self.joints = sorted(body.joints.values())
        names = {index: name for name, index in body.joints.items()}
        joints = [body.model.joints[names[index]] for index in self.joints]
        self._axes = np.array([joint.axis for joint in joints])
        self._slides = np.array([joint.type == "prismatic" for joint in joints])
        self._carries: dict[int, FloatArray] = {}
        self.forget()

    def forget(self) -> None:
        """Discard cached frames, after the body has moved."""
        self._frames: tuple[FloatArray, FloatArray] | None = None

    def _joint_frames(self) -> tuple[FloatArray, FloatArray]:
        """Return (axes, origins [m]) of all moving joints in the world frame, shape (n, 3) each; read once per step."""
        if self._frames is None:
            states = pybullet.getLinkStates(
                self._body.id, self.joints, computeForwardKinematics=1, physicsClientId=self._client
            )
            rotations = np.array([rotation_from_quaternion(state[5]) for state in states])
            self._frames = np.einsum("nij,nj->ni", rotations, self._axes), np.array([state[4] for state in states])
        return self._frames

    def _carried_by(self, index: int) -> FloatArray:
        """Return 1 for each moving joint between the base and a link (engine index), else 0; shape (n,)."""
        if index not in self._carries:
            chain, link = set(), index
            while link >= 0:
                chain.add(link)
                link = self._body.parents[link]
            self._carries[index] = np.array([float(joint in chain) for joint in self.joints])
        return self._carries[index]

    def efforts(self, index: int, force: FloatArray, torque: Sequence[float] | None, point: FloatArray) -> FloatArray:
        """Return the joint efforts of a force F and torque T that act on a link at point p, shape (n,) [N m or N].

        Revolute joint i with axis a_i through o_i: a_i . ((p - o_i) x F + T); prismatic joint: a_i . F.

        Args:
            index: engine index of the link.
            force: F in the world frame, shape (3,) [N].
            torque: T in the world frame, 3 floats [N m]; None: zero.
            point: p in the world frame, shape (3,) [m].
        """
        axes, origins = self._joint_frames()
        moments = (point - origins) @ skew(force)
        if torque is not None:
            moments += torque
        moments[self._slides] = force
        return np.asarray(self._carried_by(index) * np.einsum("ni,ni->n", axes, moments))


class Mobility:
    """Mobility (inverse effective mass) of points of bodies, with joints, brakes and rotor inertias considered.

    Args:
        engine: engine with the bodies.
    """

    def __init__(self, engine: PhysicsClient) -> None:
        self._engine = engine
        self.clear()

    def clear(self) -> None:
        """Discard cached masses, after bodies were added or removed."""
        self._masses: dict[int, tuple[float, FloatArray]] = {}
        self._inertias: dict[int, FloatArray] = {}

    def begin(self, robot: PybulletRobot, joints: Mapping[str, PybulletModelJoints], forces: "ExternalForces") -> None:
        """Start a step; cached mass matrices are discarded.

        Args:
            robot: robot in the engine.
            joints: joints of the other models, by name of the model.
            forces: external forces of the step.
        """
        self._robot, self._joints, self._forces = robot, joints, forces
        self._inertias.clear()

    def inverse_mass(self, body: LoadedBody, index: int, point: FloatArray, normal: FloatArray) -> float:
        """Return the inverse effective mass n' J (M + B)^-1 J' n of a link at a point, along a direction n [1/kg].

        A free body with joints counts as one point mass.

        Args:
            body: body with the link.
            index: engine index of the link.
            point: point in the world frame, shape (3,) [m].
            normal: unit vector n in the world frame, shape (3,).
        """
        mass, moments = self._mass(body)
        if mass > 0.0 and not body.joints:
            return self._of_free_body(body, mass, moments, point, normal)
        if mass > 0.0:
            return 1.0 / mass
        if not body.joints or index < 0:
            return 0.0
        row = self._forces.rows(body).efforts(index, normal, None, point)
        return float(row @ self._inverse_inertia(body) @ row)

    def _mass(self, body: LoadedBody) -> tuple[float, FloatArray]:
        """Return (mass [kg], principal moments, shape (3,) [kg m^2]) of a free body; mass 0: its base is fixed."""
        if body.id not in self._masses:
            client = self._engine.client
            base = pybullet.getDynamicsInfo(body.id, -1, physicsClientId=client)
            links = [
                pybullet.getDynamicsInfo(body.id, i, physicsClientId=client)[0] for i in body.links.values() if i >= 0
            ]
            self._masses[body.id] = (base[0] + sum(links) if base[0] > 0.0 else 0.0), np.array(base[2])
        return self._masses[body.id]

    def _of_free_body(
        self, body: LoadedBody, mass: float, moments: FloatArray, point: FloatArray, normal: FloatArray
    ) -> float:
        centre, orientation = pybullet.getBasePositionAndOrientation(body.id, physicsClientId=self._engine.client)
        lever = cross(point - centre, normal) @ rotation_from_quaternion(orientation)
        return float(1.0 / mass + (lever * lever) @ (1.0 / moments))

    def _inverse_inertia(self, body: LoadedBody) -> FloatArray:
        """Return (M + B)^-1 of the joints, shape (n, n); braked and driven joints have zeros."""
        if body.id not in self._inertias:
            robot = self._robot
            self._inertias[body.id] = (
                _inverse_inertia(robot) if body.id == robot.body.id else self._joints[body.name].mobility()
            )
        return self._inertias[body.id]


def _inverse_inertia(robot: PybulletRobot) -> FloatArray:
    M = robot.mass_matrix() + np.diag([loss.rotor for loss in robot.losses])
    followers = [i for i, *_ in robot.joints.followers]
    J = robot.joints.law_jacobian()[:, [i for i in robot.free_joints if i not in followers]]
    return np.asarray(J @ np.linalg.inv(J.T @ M @ J) @ J.T)


class ExternalForces:
    """External forces of the next step: they are sent to the engine, and their joint efforts are summed.

    Args:
        engine: engine with the bodies.
    """

    def __init__(self, engine: PhysicsClient) -> None:
        self._engine = engine
        self.clear()

    def clear(self) -> None:
        """Discard cached data, after bodies were added or removed."""
        self._rows: dict[int, JointRows] = {}
        self._sums: dict[int, FloatArray | None] = {}

    def begin(self, summed: Iterable[LoadedBody]) -> None:
        """Start a step; `summed`: bodies with fixed base and joints, for which joint efforts are summed."""
        self._sums = {body.id: None for body in summed}
        for rows in self._rows.values():
            rows.forget()

    def rows(self, body: LoadedBody) -> JointRows:
        """Return the object that computes joint efforts of forces on a body in this step."""
        if body.id not in self._rows:
            self._rows[body.id] = JointRows(body, self._engine.client)
        return self._rows[body.id]

    def efforts(self, body: LoadedBody) -> list[float] | None:
        """Return the sum of the joint efforts J'F of this step's forces on a body [N m or N]; None without a force."""
        efforts = self._sums.get(body.id)
        return None if efforts is None else efforts.tolist()

    def apply(
        self,
        body: LoadedBody,
        index: int,
        force: Sequence[float],
        torque: Sequence[float] | None,
        point: Sequence[float],
    ) -> None:
        """Apply a force [N] at `point` [m] and a torque [N m] to a link in the next step, world frame."""
        client = self._engine.client
        pybullet.applyExternalForce(body.id, index, force, point, pybullet.WORLD_FRAME, physicsClientId=client)
        if torque is not None:
            pybullet.applyExternalTorque(body.id, index, torque, pybullet.WORLD_FRAME, physicsClientId=client)
        if index >= 0 and body.id in self._sums:
            efforts = self.rows(body).efforts(index, np.array(force), torque, np.array(point))
            before = self._sums[body.id]
            self._sums[body.id] = efforts if before is None else before + efforts
