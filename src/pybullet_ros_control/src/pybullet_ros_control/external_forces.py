"""Forces that the plant applies to bodies in one step: wrenches from outside and penalty contact. They enter the rotor inertia's balance as J'F."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pybullet

from hric_control.plants.spatial import FloatArray
from pybullet_ros_control.engine import Body, Engine
from pybullet_ros_control.joint_rows import JointRows


class ExternalForces:
    """Sends forces to the engine for the next step and sums the robot's joint efforts that they amount to.

    Attributes:
        rows: the robot's joints.
    """

    def __init__(self, engine: Engine, robot: Body) -> None:
        self._engine = engine
        self.set_robot(robot)

    def set_robot(self, robot: Body) -> None:
        """The body whose efforts are summed; again after it was loaded anew."""
        self._robot, self.rows = robot, JointRows(robot, self._engine.client)
        self._wanted = False

    def begin(self, wanted: bool) -> None:
        """Start a step; `wanted`: sum up efforts."""
        self._wanted = wanted
        self.rows.forget()
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
            efforts = self.rows.efforts(index, np.array(force), torque, np.array(point))
            self._efforts = efforts if self._efforts is None else self._efforts + efforts
