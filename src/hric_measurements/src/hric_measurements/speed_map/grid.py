"""Grid of a speed map: points of the workspace, arm postures at these points, and directions of motion."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from franka_hw_interface.model import FrankaFrame
from franka_sim.box.config import motion_parameters
from franka_sim.box.inverse_kinematics import ElbowInverseKinematics
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_core.errors import HricError
from hric_core.geometry import FloatArray

DIRECTIONS = {
    "+x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "+z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Directions of motion of the end effector, in the base frame."""
STRIDE = 0.02
"""Step length of the path from the start pose to a point [m]; small enough for the inverse kinematics to converge."""
NEAR_LIMIT = 0.02
"""Minimum distance of a posture from the joint limits [rad]."""
MANIPULABLE = 0.05
"""Minimum singular value of the end effector's Jacobian (m and rad mixed); below it, the arm counts as nearly
stretched (singular). Project default, unconfirmed."""


def points(x: Sequence[float], y: Sequence[float], z: Sequence[float]) -> FloatArray:
    """Return all points of a grid, shape (n, 3) [m]; x, y, z: lowest and highest coordinate [m], number of points.

    Raises:
        HricError: a range is invalid.
    """
    axes = []
    for name, (low, high, count) in zip("xyz", (x, y, z), strict=True):
        if not (np.isfinite([low, high]).all() and low <= high and count >= 1 and count == int(count)):
            raise HricError(f"--{name} is {low:g} {high:g} {count:g}; valid: lowest, highest [m], number of points")
        axes.append(np.linspace(low, high, int(count)))
    return np.array(list(product(*axes)))


class Postures:
    """Inverse kinematics of an arm whose hand keeps its orientation of the start posture.

    Args:
        robot: robot whose model, start posture and joint limits are used.
    """

    def __init__(self, robot: FrankaHWSim) -> None:
        self._model, self._limits = robot.model, robot.box.config.limits
        self._kinematics = ElbowInverseKinematics(robot.model, motion_parameters())
        self._start = list(robot.q_start)
        self._T_base_start = robot.model.pose(FrankaFrame.END_EFFECTOR, self._start)

    def at(self, point: FloatArray) -> FloatArray | None:
        """Return the joint position, shape (7,) [rad], with the end effector at a point, shape (3,) [m].

        None: the point is out of reach, or the posture is near a joint limit or a singularity.
        """
        T = self._T_base_start.copy()
        begin = T[:3, 3].copy()
        q: list[float] | None = self._start
        count = max(1, int(np.ceil(np.linalg.norm(point - begin) / STRIDE)))
        elbow = self._start[2]
        self._kinematics.begin(self._start)
        for k in range(1, count + 1):
            T[:3, 3] = begin + (point - begin) * k / count
            assert q is not None, "left below"
            q = self._kinematics.solve(T.T.ravel().tolist(), elbow, q)
            if q is None:
                return None
        posture = np.array(q)
        low, high = np.array(self._limits.lower) + NEAR_LIMIT, np.array(self._limits.upper) - NEAR_LIMIT
        if np.any(posture < low) or np.any(posture > high):
            return None
        return None if self._kinematics.begin(posture.tolist()) < MANIPULABLE else posture
