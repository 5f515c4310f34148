"""Forces that the plant applies to bodies in one step: wrenches from outside and penalty contact. They enter the rotor inertia's balance as J'F."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pybullet

from pybullet_ros_control.engine import Body, Engine
from pybullet_ros_control.spatial import FloatArray, rotation_from_quaternion


@dataclass
class Wrench:
    """A wrench that acts for some steps.

    Attributes:
        body: "model::link".
        force, torque: world frame [N], [N m].
        point: link frame [m].
        steps_left: negative means until cleared.
    """

    body: str
    force: FloatArray
    torque: FloatArray
    point: FloatArray
    steps_left: int


class ExternalForces:
    """Sends forces to the engine for the next step and sums the robot's joint efforts that they amount to.

    Args:
        robot: the body whose efforts are summed.
        n: its number of moving joints.
    """

    def __init__(self, engine: Engine, robot: Body, n: int) -> None:
        self._engine, self.robot = engine, robot
        self._zeros = [0.0] * n
        self.wanted = False
        self.efforts: list[float] | None = None

    def begin(self, q: list[float], wanted: bool) -> None:
        """Start a step at q; `wanted`: sum up efforts."""
        self._q, self.wanted, self.efforts = q, wanted, None

    def apply(self, body: Body, index: int, force: Sequence[float], torque: Sequence[float] | None, point: Sequence[float]) -> None:
        """A force [N] at `point` [m] and a torque [N m] on a link, all in the world frame, for the next step."""
        client = self._engine.client
        pybullet.applyExternalForce(body.id, index, force, point, pybullet.WORLD_FRAME, physicsClientId=client)
        if torque is not None:
            pybullet.applyExternalTorque(body.id, index, torque, pybullet.WORLD_FRAME, physicsClientId=client)
        if self.wanted and body is self.robot and index >= 0:
            self._add_efforts(index, force, torque, point)

    def _add_efforts(self, index: int, force: Sequence[float], torque: Sequence[float] | None, point: Sequence[float]) -> None:
        client = self._engine.client
        com, orientation = pybullet.getLinkState(self.robot.id, index, computeForwardKinematics=1, physicsClientId=client)[:2]
        # The engine wants the point relative to the centre of mass, along the inertial axes.
        local = rotation_from_quaternion(orientation).T @ (np.array(point) - com)
        linear, angular = pybullet.calculateJacobian(
            self.robot.id, index, local.tolist(), self._q, self._zeros, self._zeros, physicsClientId=client
        )
        efforts = np.array(force) @ np.array(linear)
        if torque is not None:
            efforts += np.array(torque) @ np.array(angular)
        before = self.efforts or self._zeros
        self.efforts = [a + b for a, b in zip(before, efforts.tolist(), strict=True)]
