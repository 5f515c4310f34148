"""Joints of the models around the robot: their positions, drives and stops."""

from collections.abc import Sequence

import numpy as np

from hric_control.plants import DrivenJoints, Model, reciprocals
from hric_core.geometry import FloatArray
from hric_core.urdf import ONE_COORDINATE
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.robot import OpenSimRobot


class OpenSimModelJoints(DrivenJoints):
    """Joints of one model with one coordinate each; damping and friction are in the engine and the robot's rows.

    Args:
        model: model of the joints.
        robot: holder of the state of all coordinates.
    """

    def __init__(self, model: Model, robot: OpenSimRobot) -> None:
        moving = [joint for joint in model.tree.joints.values() if joint.type in ONE_COORDINATE]
        super().__init__(model.name, moving, robot.config)
        self._robot, self._full_names = robot, [f"{model.name}::{joint.name}" for joint in moving]

    def _indices_in(self, engine: OpenSimEngine) -> list[int]:
        return [engine.index[engine.built.joints[name][0]] for name in self._full_names]

    def bind(self, engine: OpenSimEngine) -> None:
        """Bind to another build of the model, which already has the joints' present positions."""
        self._indices = self._indices_in(engine)

    def write_start(self, engine: OpenSimEngine, q: FloatArray, u: FloatArray) -> None:
        """Write the last set positions into all coordinates of a build, both of shape (nu,)."""
        self._robot.write(self._indices_in(engine), *self._start, q, u)
        self._stops.restart(self._start[0])

    def _inertias(self) -> Sequence[float]:
        engine = self._robot.engine
        engine.put_y(self._robot.y)
        engine.model.realizePosition(engine.system_state)
        return reciprocals(self._robot.response().diagonal()[self._indices])

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place."""
        self._robot.read(self._indices, q, dq)

    def begin(self) -> None:
        """Put the joints at the last set positions."""
        self._robot.put_coordinates(self._indices, *self._start)
        self._stops.restart(self._start[0])

    def let_go(self) -> None:
        """Set all drive efforts to zero."""
        self._efforts = self.joints.zeros

    def act(self, held: FloatArray | None) -> FloatArray | None:
        """Return the efforts on all coordinates, shape (nu,), with those of drives and stops; None for none."""
        robot = self._robot
        q, dq = ([values[index] for index in self._indices] for values in (robot.positions, robot.speeds))
        efforts = self._stops.add(q, dq, self._efforts)
        if not any(efforts):
            return held
        held = np.zeros(robot.engine.nu) if held is None else held
        held[self._indices] += efforts
        return held
