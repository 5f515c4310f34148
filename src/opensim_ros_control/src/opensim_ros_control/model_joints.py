"""Joints of the models around the robot (e.g. a human body): their positions, drives and stops in OpenSim."""

from collections.abc import Sequence

import numpy as np

from hric_control.plants import DrivenJoints, Model, reciprocals
from hric_core.geometry import FloatArray
from hric_core.urdf import ONE_COORDINATE
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.robot import OpenSimRobot


class OpenSimModelJoints(DrivenJoints):
    """Joints with one coordinate of one model around the robot.

    Damping belongs to the OpenSim model, Coulomb friction to the robot's `JointEfforts`.

    Args:
        model: model with the joints.
        robot: robot, whose object has the state of all coordinates of the OpenSim model.
    """

    def __init__(self, model: Model, robot: OpenSimRobot) -> None:
        moving = [joint for joint in model.tree.joints.values() if joint.type in ONE_COORDINATE]
        super().__init__(model.name, moving, robot.config)
        self._robot, self._full_names = robot, [f"{model.name}::{joint.name}" for joint in moving]

    def _indices_in(self, engine: OpenSimEngine) -> list[int]:
        return [engine.index[engine.built.joints[name][0]] for name in self._full_names]

    def bind(self, engine: OpenSimEngine) -> None:
        """Use a new build of the OpenSim model, in which the joints already have their present positions."""
        self._indices = self._indices_in(engine)

    def write_start(self, engine: OpenSimEngine, q: FloatArray, u: FloatArray) -> None:
        """Write the stored start positions and velocities into the arrays q and u of all coordinates, shape (nu,)."""
        self._robot.write(self._indices_in(engine), *self._start, q, u)
        self._stops.restart(self._start[0])

    def _inertias(self) -> Sequence[float]:
        engine = self._robot.engine
        engine.put_y(self._robot.y)
        engine.model.realizePosition(engine.system_state)
        return reciprocals(self._robot.response().diagonal()[self._indices])

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write joint positions and velocities at the measuring instant into the lists q and dq."""
        self._robot.read(self._indices, q, dq)

    def begin(self) -> None:
        """Set the joints in the engine to the stored start positions and velocities."""
        self._robot.put_coordinates(self._indices, *self._start)
        self._stops.restart(self._start[0])

    def let_go(self) -> None:
        """Set all drive efforts to zero."""
        self._efforts = self.joints.zeros

    def act(self, held: FloatArray | None) -> FloatArray | None:
        """Add the efforts of drives and joint stops in the coming step to those of all coordinates.

        Args:
            held: efforts so far, shape (nu,) [N m or N]; None: no efforts.

        Returns:
            The sum, or None if there are no efforts.
        """
        robot = self._robot
        q, dq = ([values[index] for index in self._indices] for values in (robot.positions, robot.speeds))
        efforts = self._stops.add(q, dq, self._efforts)
        if not any(efforts):
            return held
        held = np.zeros(robot.engine.nu) if held is None else held
        held[self._indices] += efforts
        return held
