"""Joints of the models around the robot: their positions, drives and stops."""

from collections.abc import Sequence

import numpy as np

from hric_control.plants import Model, MovingJoints, StopLaw, reciprocals
from hric_core.geometry import FloatArray
from hric_core.urdf import ONE_COORDINATE
from opensim_ros_control.engine import Engine
from opensim_ros_control.robot import Robot


class ModelJoints:
    """Joints of one model with one coordinate each; damping and friction are in the engine and the robot's rows.

    Args:
        model: model of the joints.
        robot: holder of the state of all coordinates.

    Attributes:
        joints: joints of the description, all of them actuated.
    """

    def __init__(self, model: Model, robot: Robot) -> None:
        moving = [joint for joint in model.tree.joints.values() if joint.type in ONE_COORDINATE]
        self.joints, self._robot = MovingJoints(moving, [joint.name for joint in moving], model.name), robot
        self._full_names = [f"{model.name}::{name}" for name in self.joints.names]
        self._stops = StopLaw([(joint.lower, joint.upper) for joint in moving], self._inertias)
        self._efforts, self._start = self.joints.zeros, self.joints.start(*[self.joints.zeros] * 3)

    def _indices_in(self, engine: Engine) -> list[int]:
        return [engine.index[engine.built.joints[name][0]] for name in self._full_names]

    def bind(self, engine: Engine) -> None:
        """Bind to another build of the model, which already has the joints' present positions."""
        self._indices = self._indices_in(engine)

    def begin(self, engine: Engine, q: FloatArray, u: FloatArray) -> None:
        """Write the last set positions into all coordinates of a build, both of shape (nu,)."""
        self._robot.write(self._indices_in(engine), *self._start, q, u)
        self._stops.restart(self._start[0])

    def _inertias(self) -> list[float]:
        engine = self._robot.engine
        engine.put_y(self._robot.y)
        engine.model.realizePosition(engine.system_state)
        return reciprocals(self._robot.response().diagonal()[self._indices])

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place."""
        self._robot.read(self._indices, q, dq)

    def put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Put the joints at q, dq now and at each start. Raises CommandError if not one finite number per joint."""
        zeros = self.joints.zeros
        self._start = self.joints.start(q, zeros if dq is None else dq, zeros)
        self._robot.put_coordinates(self._indices, *self._start)
        self._stops.restart(self._start[0])

    def drive(self, efforts: Sequence[float]) -> None:
        """Set the efforts from the next step on [N m or N]. Raises CommandError if not one per joint."""
        self._efforts = self.joints.command(efforts)

    def let_go(self) -> None:
        """Set all drive efforts to zero."""
        self._efforts = self.joints.zeros

    def act(self, held: FloatArray | None) -> FloatArray | None:
        """Return the efforts on all coordinates, shape (nu,), with those of drives and stops; None for none."""
        robot = self._robot
        q, dq = ([values[index] for index in self._indices] for values in (robot.q, robot.u))
        efforts = self._stops.add(q, dq, self._efforts)
        if not any(efforts):
            return held
        held = np.zeros(robot.engine.nu) if held is None else held
        held[self._indices] += efforts
        return held
