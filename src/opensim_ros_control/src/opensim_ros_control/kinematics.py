"""Poses and Jacobians of what moves in a model, asked for at most once per state."""

from __future__ import annotations

import numpy as np
import opensim

from hric_control.plants.spatial import FloatArray
from opensim_ros_control.engine import Engine
from opensim_ros_control.robot_model import matrix


class Kinematics:
    """Bodies of one engine by OpenSim's numbers; the ground is 0. All in the ground frame.

    Args:
        engine: with positions realized whenever this is asked.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._matrix = opensim.Matrix()
        found = engine.model.getBodySet()
        self._bodies = {int(found.get(i).getMobilizedBodyIndex()): found.get(i) for i in range(found.getSize())}
        self._poses: dict[int, FloatArray] = {}
        self._jacobians: FloatArray | None = None

    def carrier(self, frame: opensim.Frame) -> tuple[int, FloatArray]:
        """(number of the body that carries a frame, the frame's pose in it, shape (4, 4))."""
        base = opensim.PhysicalFrame.safeDownCast(frame.findBaseFrame())
        number = int(base.getMobilizedBodyIndex())
        return number, matrix(frame.findTransformInBaseFrame())

    def forget(self) -> None:
        """The state is another one."""
        self._poses.clear()
        self._jacobians = None

    def pose(self, number: int) -> FloatArray:
        """T_ground_body, shape (4, 4)."""
        if number not in self._poses:
            self._poses[number] = np.eye(4) if number == 0 else matrix_of(self._bodies[number].getTransformInGround(self._engine.system_state))
        return self._poses[number]

    def system_jacobian(self) -> FloatArray:
        """(angular, linear) velocity of all bodies' origins per speed, shape (6 bodies, nu): all at once costs less than one of them alone."""
        if self._jacobians is None:
            self._engine.matter.calcSystemJacobian(self._engine.system_state, self._matrix)
            self._jacobians = np.asarray(self._matrix.to_numpy())
        return self._jacobians

    def jacobian(self, number: int, point: FloatArray) -> FloatArray:
        """(angular, linear) velocity at a point of a body per speed, shape (6, nu).

        Args:
            number: of the body.
            point: in the ground frame, shape (3,) [m].
        """
        result: FloatArray = self.system_jacobian()[6 * number : 6 * number + 6].copy()
        if number != 0:
            x, y, z = (point - self.pose(number)[:3, 3]).tolist()
            # v = v_origin + omega x r
            result[3:] += np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]) @ result[:3]
        return result


def matrix_of(T: opensim.Transform) -> FloatArray:
    """A transform as a matrix, shape (4, 4), quickly."""
    get, p = T.R().get, T.p().to_numpy()
    result = np.empty((4, 4))
    result[:3, :3] = [[get(0, 0), get(0, 1), get(0, 2)], [get(1, 0), get(1, 1), get(1, 2)], [get(2, 0), get(2, 1), get(2, 2)]]
    result[:3, 3] = p
    result[3] = (0.0, 0.0, 0.0, 1.0)
    return result
