"""Inverse kinematics of the arm by Newton's method, for an end-effector pose and a position of joint 3 (the elbow)."""

from collections.abc import Callable, Sequence

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.config import MotionParameters
from franka_sim.box.kinematics import ArmKinematics
from franka_sim.box.state import ELBOW_FLIP
from hric_core.native import load

_solve_pose: Callable[..., list[float] | None] = load("hric_kinematics").solve_pose
_first_step: Callable[..., tuple[list[float], list[float]] | None] = load("hric_kinematics").first_step
ELBOW_JOINT = 2
"""Index of the joint that libfranka reports as the elbow's position."""
ELBOW_ROW = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
_LARGEST_STEP = 0.5
"""Maximum Newton step of a joint [rad]; if a larger one is needed, there is no solution near the initial guess."""


class Newton:
    """Newton's method for seven equations: position, rotation, and a row for the redundant degree of freedom.

    Args:
        kinematics: kinematics of the arm.
        tolerance: remaining error (m and rad mixed).
        steps: maximum number of steps.
    """

    def __init__(self, kinematics: ArmKinematics, tolerance: float, steps: int) -> None:
        self._kinematics = kinematics
        self._free = (tolerance, _LARGEST_STEP, float(steps), -1.0)
        self._held = (tolerance, _LARGEST_STEP, float(steps), float(ELBOW_JOINT))

    def solve(
        self, T: Sequence[float], row: Sequence[float], q3: float | None, guess: Sequence[float]
    ) -> list[float] | None:
        """Return the joint positions for the pose, and for the elbow if it is specified.

        Args:
            T: O_T_EE, 16 floats, column-major.
            row: seventh row of the equations, 7 floats; ELBOW_ROW if q3 is specified.
            q3: desired position of joint 3 [rad]; None: unconstrained.
            guess: start of the iteration, 7 floats [rad].

        Returns:
            7 floats [rad], or None: out of reach, singular, or no solution nearby.
        """
        options, elbow = (self._free, 0.0) if q3 is None else (self._held, q3)
        return _solve_pose(self._kinematics.arm, T, row, elbow, options, guess)

    def first_step(
        self, T: Sequence[float], row: Sequence[float], guess: Sequence[float]
    ) -> tuple[list[float], list[float]] | None:
        """Compute one Newton step towards a pose, orthogonal to the seventh row, and the null vector of the Jacobian J.

        Args:
            T: desired O_T_EE, 16 floats, column-major.
            row: seventh row of the equations, 7 floats.
            guess: start of the step, 7 floats [rad].

        Returns:
            (q after the step [rad], unit vector x with J x = 0 and row x > 0), 7 floats each; None if the pose is
            singular or the step too large.
        """
        return _first_step(self._kinematics.arm, T, row, self._free, guess)


def elbow_side(q: Sequence[float]) -> float:
    """Return the side of joint 4, -1 or 1, as in libfranka's RobotState::elbow[1]."""
    return 1.0 if q[3] > ELBOW_FLIP else -1.0


class ElbowInverseKinematics:
    """Inverse kinematics of a Cartesian motion: the solution nearest to the previous one, with or without an elbow.

    Args:
        model: model of the arm; `begin` reads its end effector again.
        parameters: remaining error, number of steps, and parameters for an elbow that is not commanded.
        time_step: control period [s].
    """

    def __init__(self, model: KdlFrankaModel, parameters: MotionParameters, time_step: float = 0.001) -> None:
        self.kinematics = ArmKinematics(model)
        self._parameters, self._dt = parameters, time_step
        self._newton = Newton(self.kinematics, parameters.ik_tolerance, parameters.ik_steps)
        self.null = ELBOW_ROW

    def nearest(self, T: Sequence[float], q: Sequence[float]) -> list[float] | None:
        """Return the joint positions one Newton step from q towards a pose, without self-motion; None as for `follow`.

        Args:
            T: O_T_EE, 16 floats, column-major.
            q: joint positions, 7 floats [rad].
        """
        step = self._newton.first_step(T, self.null, q)
        return None if step is None else step[0]

    def begin(self, q: Sequence[float]) -> float:
        """Start a motion at q, 7 floats [rad]; return the minimum singular value of the Jacobian (m and rad mixed)."""
        self.kinematics.update()
        _, singular_values, rows = np.linalg.svd(self.kinematics.end_effector(q).jacobian())
        self.null = rows[-1].tolist()
        return float(singular_values[-1])

    def solve(self, T: Sequence[float], q3: float, guess: Sequence[float]) -> list[float] | None:
        """Return the joint positions for a pose and elbow, 7 floats [rad]; None if out of reach or singular.

        Seven equations: position, rotation and elbow. With one call per millisecond the guess is about 1e-6 rad from
        the solution, so one Newton step is enough.

        Args:
            T: O_T_EE, 16 floats, column-major.
            q3: elbow, position of joint 3 [rad].
            guess: start of the iteration, 7 floats [rad].
        """
        return self._newton.solve(T, ELBOW_ROW, q3, guess)

    def follow(
        self,
        T: Sequence[float],
        hold: float,
        q_d: Sequence[float],
        guess: Sequence[float],
        dq_d: Sequence[float] = (0.0,) * 7,
    ) -> list[float] | None:
        """Return the joint positions for a pose, 7 floats [rad]; joint 3 is held unless that needs fast joint motion.

        None if the pose is out of reach or singular.

        The unit null vector n of the Jacobian, updated in each step, is the seventh row; [J; n'] x = (0, 1) rotates it
        to this pose. The first step adds the self-motion n beta that would move joint 3 from q_d by return_rate dt
        (hold - q3), damped where n3 is small: beta = n3 (desired - iterate) / (n3^2 + lambda^2).

        Args:
            T: O_T_EE, 16 floats, column-major.
            hold: desired position of joint 3 [rad].
            q_d: joint positions of the previous step, 7 floats [rad].
            guess: start of the iteration, 7 floats [rad].
            dq_d: joint velocities of the previous step, 7 floats [rad/s].
        """
        step = self._newton.first_step(T, self.null, guess)
        if step is None:
            return None
        q, self.null = step
        null = self.null
        coasting = self._coasting([x - last for x, last in zip(q, q_d, strict=True)], dq_d)
        if coasting:
            q = [x - n * coasting for x, n in zip(q, null, strict=True)]
        beta = self._self_motion(null[ELBOW_JOINT], q[ELBOW_JOINT], hold, q_d[ELBOW_JOINT])
        return self._newton.solve(T, null, None, [x + n * beta for x, n in zip(q, null, strict=True)])

    def _coasting(self, step: Sequence[float], dq_d: Sequence[float]) -> float:
        """Return by how much a self-motion exceeds that of the previous step, less its decay, along the null vector.

        Where joint 3 does not hold the elbow, the self-motion would go on with the acceleration of the guess.

        Args:
            step: displacement of the joints in this step, 7 floats [rad].
            dq_d: joint velocities of the previous step, 7 floats [rad/s].
        """
        null, parameters = self.null, self._parameters
        held = min(1.0, (null[ELBOW_JOINT] / parameters.elbow_min) ** 2)
        if held == 1.0:
            return 0.0
        left = 1.0 - parameters.elbow_decay * self._dt
        return (1.0 - held) * sum(n * (x - left * v * self._dt) for n, x, v in zip(null, step, dq_d, strict=True))

    def _self_motion(self, n3: float, iterate: float, hold: float, last: float) -> float:
        """Return the length of the step along the unit null vector that brings joint 3 back to its desired position.

        Args:
            n3: element of the null vector for joint 3.
            iterate: position of joint 3 after the first Newton step [rad].
            hold: desired position of joint 3 [rad].
            last: position of joint 3 in the previous cycle [rad].
        """
        parameters = self._parameters
        damping = parameters.elbow_damping**2 * max(0.0, 1.0 - (n3 / parameters.elbow_min) ** 2)
        desired = last + parameters.elbow_return_rate * self._dt * (hold - last)
        return n3 * (desired - iterate) / (n3 * n3 + damping)
