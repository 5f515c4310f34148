"""Inverse kinematics of the arm: a pose of the end effector and the position of joint 3, which is libfranka's elbow, give all seven joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import cast

import numpy as np
import numpy.typing as npt

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.kinematics import ArmKinematics, Placement
from franka_sim.box.motion_parameters import MotionParameters
from franka_sim.box.pose_lists import twist_between
from franka_sim.box.state import ELBOW_FLIP

FloatArray = npt.NDArray[np.float64]

ELBOW_JOINT = 2
"""Index of the joint that libfranka reports as the elbow's position."""
_ELBOW_ROW = np.eye(7)[ELBOW_JOINT]
_LARGEST_STEP = 0.5
"""A Newton step that turns a joint by more leaves the branch it began on: there is no solution near [rad]."""


def elbow_side(q: Sequence[float]) -> float:
    """Side of joint 4, -1 or 1, as libfranka's RobotState::elbow[1] gives it."""
    return 1.0 if q[3] > ELBOW_FLIP else -1.0


class ElbowInverseKinematics:
    """Newton's method from a guess nearby. Which of the several solutions is found is the guess's branch.

    Args:
        model: of the arm; `begin` takes a changed end effector.
        parameters: remaining error, number of steps, and how an elbow that is not commanded is held.
        time_step: [s].
    """

    def __init__(self, model: KdlFrankaModel, parameters: MotionParameters, time_step: float = 0.001) -> None:
        self.kinematics = ArmKinematics(model)
        self._parameters, self._dt = parameters, time_step
        self._null, self._matrix = _ELBOW_ROW, np.empty((7, 7))
        self._right = np.zeros((7, 2))
        self._right[6, 1] = 1.0

    def begin(self, q: Sequence[float]) -> float:
        """Begin a motion at q, 7 floats [rad]. Returns the least singular value of the end effector's Jacobian (m and rad mixed)."""
        self.kinematics.update()
        _, singular_values, rows = np.linalg.svd(self.kinematics.end_effector(q).jacobian())
        self._null = rows[-1]
        return float(singular_values[-1])

    def solve(self, T: Sequence[float], q3: float, guess: Sequence[float]) -> list[float] | None:
        """The joint positions near the guess, 7 floats [rad], or None if there are none (out of reach, singular).

        Seven equations, position, rotation and elbow. Per millisecond the guess is within about 1e-6 rad: one step is enough.

        Args:
            T: O_T_EE, 16 floats, column-major.
            q3: elbow, position of joint 3 [rad].
            guess: 7 floats [rad].
        """
        return self._newton(T, guess, _ELBOW_ROW, q3)

    def follow(self, T: Sequence[float], hold: float, q_d: Sequence[float], guess: Sequence[float]) -> list[float] | None:
        """The same without a commanded elbow: joint 3 is held as far as that needs no fast motion of the other joints.

        The unit null vector n of the Jacobian, kept from step to step, is the seventh row; [J; n'] x = (0, 1) turns it to this pose. The first step
        adds the self-motion n beta that would move joint 3 from q_d by return_rate dt (hold - q3), damped where n3 is small:
        beta = n3 (wanted - found) / (n3^2 + lambda^2).

        Args:
            T: O_T_EE, 16 floats, column-major.
            hold: where joint 3 belongs [rad].
            q_d: of the step before, 7 floats [rad].
            guess: 7 floats [rad].
        """
        placement = self.kinematics.end_effector(guess)
        self._right[:6, 0] = twist_between(placement.T, T, 1.0)
        solution = self._solve(placement, self._null, self._right)
        if solution is None:
            return None
        direction = solution[:, 1]
        self._null = direction / math.sqrt(direction @ direction)
        q, null = (guess + solution[:, 0]).tolist(), self._null.tolist()
        beta = self._self_motion(null[ELBOW_JOINT], q[ELBOW_JOINT], hold, q_d[ELBOW_JOINT])
        return self._newton(T, [x + n * beta for x, n in zip(q, null, strict=True)], self._null, None)

    def _self_motion(self, n3: float, found: float, hold: float, last: float) -> float:
        """How far to go along the null vector, whose element for joint 3 is n3; found, hold, last: position of joint 3 [rad]."""
        parameters = self._parameters
        damping = parameters.elbow_damping**2 * max(0.0, 1.0 - (n3 / parameters.elbow_least) ** 2)
        wanted = last + parameters.elbow_return_rate * self._dt * (hold - last)
        return n3 * (wanted - found) / (n3 * n3 + damping)

    def _newton(self, T: Sequence[float], guess: Sequence[float], last_row: FloatArray, q3: float | None) -> list[float] | None:
        """Newton steps until pose and elbow (None: whatever it is) are met, 7 floats [rad], or None."""
        q, tolerance = list(guess), self._parameters.ik_tolerance
        for _ in range(self._parameters.ik_steps + 1):
            placement = self.kinematics.end_effector(q)
            error = [*twist_between(placement.T, T, 1.0), 0.0 if q3 is None else q3 - q[ELBOW_JOINT]]
            if max(map(abs, error)) <= tolerance:
                return q
            solution = self._solve(placement, last_row, error)
            if solution is None:
                return None
            q = [x + dx for x, dx in zip(q, solution.tolist(), strict=True)]
        return None

    def _solve(self, placement: Placement, last_row: FloatArray, right: FloatArray | list[float]) -> FloatArray | None:
        """Solution of [J; last row] x = right, shape (7,) or (7, 2); None if there is none whose first column is a small step."""
        self._matrix[:6], self._matrix[6] = placement.jacobian(), last_row
        try:
            solution = cast(FloatArray, np.linalg.solve(self._matrix, right))
        except np.linalg.LinAlgError:
            return None
        step = solution if solution.ndim == 1 else solution[:, 0]
        return solution if float(np.abs(step).max()) <= _LARGEST_STEP else None
