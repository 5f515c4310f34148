"""Inverse kinematics of the arm: a pose of the end effector and the position of joint 3, which is libfranka's elbow, give all seven joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.kinematics import ArmKinematics
from franka_sim.box.motion_parameters import MotionParameters
from franka_sim.box.newton import ELBOW_JOINT, ELBOW_ROW, make_newton
from franka_sim.box.state import ELBOW_FLIP


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
        self._newton = make_newton(self.kinematics, parameters.ik_tolerance, parameters.ik_steps)
        self._null = ELBOW_ROW

    def begin(self, q: Sequence[float]) -> float:
        """Begin a motion at q, 7 floats [rad]. Returns the least singular value of the end effector's Jacobian (m and rad mixed)."""
        self.kinematics.update()
        _, singular_values, rows = np.linalg.svd(self.kinematics.end_effector(q).jacobian())
        self._null = rows[-1].tolist()
        return float(singular_values[-1])

    def solve(self, T: Sequence[float], q3: float, guess: Sequence[float]) -> list[float] | None:
        """The joint positions near the guess, 7 floats [rad], or None if there are none (out of reach, singular).

        Seven equations, position, rotation and elbow. Per millisecond the guess is within about 1e-6 rad: one step is enough.

        Args:
            T: O_T_EE, 16 floats, column-major.
            q3: elbow, position of joint 3 [rad].
            guess: 7 floats [rad].
        """
        return self._newton.solve(T, ELBOW_ROW, q3, guess)

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
        step = self._newton.first_step(T, self._null, guess)
        if step is None:
            return None
        q, self._null = step
        null = self._null
        beta = self._self_motion(null[ELBOW_JOINT], q[ELBOW_JOINT], hold, q_d[ELBOW_JOINT])
        return self._newton.solve(T, null, None, [x + n * beta for x, n in zip(q, null, strict=True)])

    def _self_motion(self, n3: float, found: float, hold: float, last: float) -> float:
        """How far to go along the null vector, whose element for joint 3 is n3; found, hold, last: position of joint 3 [rad]."""
        parameters = self._parameters
        damping = parameters.elbow_damping**2 * max(0.0, 1.0 - (n3 / parameters.elbow_least) ** 2)
        wanted = last + parameters.elbow_return_rate * self._dt * (hold - last)
        return n3 * (wanted - found) / (n3 * n3 + damping)
