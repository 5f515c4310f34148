"""Forces that the plant applies to bodies in one step: wrenches from outside and penalty contact. They enter the rotor inertia's balance as J'F."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pybullet

from hric_control.plants.spatial import FloatArray, rotation_from_quaternion
from pybullet_ros_control.engine import Body, Engine


class ExternalForces:
    """Sends forces to the engine for the next step and sums the robot's joint efforts that they amount to."""

    def __init__(self, engine: Engine, robot: Body) -> None:
        self._engine = engine
        self.set_robot(robot)

    def set_robot(self, robot: Body) -> None:
        """The body whose efforts are summed; again after it was loaded anew."""
        assert robot.model is not None
        self._robot = robot
        self._joints = sorted(robot.joints.values())
        names = {index: name for name, index in robot.joints.items()}
        joints = [robot.model.joints[names[index]] for index in self._joints]
        self._axes = np.array([joint.axis for joint in joints])
        self._slides = np.array([joint.type == "prismatic" for joint in joints])
        self._carries: dict[int, FloatArray] = {}
        self._wanted = False
        self._frames: tuple[FloatArray, FloatArray] | None = None

    def begin(self, wanted: bool) -> None:
        """Start a step; `wanted`: sum up efforts."""
        self._wanted, self._frames = wanted, None
        self._efforts: FloatArray | None = None

    @property
    def efforts(self) -> list[float] | None:
        """J'F of this step's forces for all moving joints [N m or N]; None when none acts on the robot."""
        return None if self._efforts is None else self._efforts.tolist()

    def apply(self, body: Body, index: int, force: Sequence[float], torque: Sequence[float] | None, point: Sequence[float]) -> None:
        """A force [N] at `point` [m] and a torque [N m] on a link, all in the world frame, for the next step."""
        client = self._engine.client
        pybullet.applyExternalForce(body.id, index, force, point, pybullet.WORLD_FRAME, physicsClientId=client)
        if torque is not None:
            pybullet.applyExternalTorque(body.id, index, torque, pybullet.WORLD_FRAME, physicsClientId=client)
        if self._wanted and body is self._robot and index >= 0:
            self._add_efforts(index, np.array(force), torque, np.array(point))

    def _joint_frames(self) -> tuple[FloatArray, FloatArray]:
        """(axes, origins) of all moving joints in the world, shape (n, 3) each; asked once per step."""
        if self._frames is None:
            states = pybullet.getLinkStates(self._robot.id, self._joints, computeForwardKinematics=1, physicsClientId=self._engine.client)
            rotations = np.array([rotation_from_quaternion(state[5]) for state in states])
            self._frames = np.einsum("nij,nj->ni", rotations, self._axes), np.array([state[4] for state in states])
        return self._frames

    def _carried_by(self, index: int) -> FloatArray:
        """1 for each moving joint between the base and a link, else 0."""
        if index not in self._carries:
            chain, link = set(), index
            while link >= 0:
                chain.add(link)
                link = self._robot.parents[link]
            self._carries[index] = np.array([float(joint in chain) for joint in self._joints])
        return self._carries[index]

    def _add_efforts(self, index: int, force: FloatArray, torque: Sequence[float] | None, point: FloatArray) -> None:
        """tau_i = a_i . ((p - o_i) x F + T) for a turning joint, a_i . F for a sliding one. (The engine's own Jacobian is not that of the point.)"""
        axes, origins = self._joint_frames()
        moments = np.cross(point - origins, force)
        if torque is not None:
            moments += torque
        moments[self._slides] = force
        efforts = self._carried_by(index) * np.einsum("ni,ni->n", axes, moments)
        self._efforts = efforts if self._efforts is None else self._efforts + efforts
