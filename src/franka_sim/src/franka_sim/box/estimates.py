"""Estimate of the external torque on the arm from joint positions, velocities and torques."""

import math
from collections.abc import Sequence

from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.config import BoxConfig

Vector = Sequence[float]
_NONE = (0.0,) * 7


class ExternalTorque:
    """Estimator of tau_ext_hat_filtered: measured torque minus model torque, low-pass filtered.

    r' = w (tau_J - M(q) ddq - C(q, dq) dq - g(q) - tau_f(dq) - r),   w = 2 pi cut-off

    In continuous time this is the momentum observer of De Luca et al. (IROS 2006), r = w (integral of (tau_J + C^T dq -
    g - tau_f - r) dt - p): both give the external torque after one first-order low-pass. Here the acceleration is the
    difference of two measured velocities, the mean over the cycle, so the observer's transpose of C is not needed.
    tau_f: friction torque by the box's own friction model. Rotor inertia is excluded: tau_J is measured on the link
    side.

    Sign as in libfranka, whose RobotState calls it the error between tau_J and the torques that the model expects: a
    torque that the arm exerts on its environment is positive, and a force F that pushes the arm appears as -J^T F.

    Attributes:
        value: estimated external torque per joint, 7 floats [N m].
    """

    def __init__(self, arm: CompiledArm, config: BoxConfig) -> None:
        self._arm = arm
        self._constants = (
            1.0 / config.time_step,
            1.0 - math.exp(-2.0 * math.pi * config.external_torque_cutoff * config.time_step),
        )
        self.value = [0.0] * 7

    def reset(self) -> None:
        """Reset the estimate to zero."""
        self.value[:] = [0.0] * 7

    def update(
        self, q: Vector, dq: Vector, q_now: Vector, dq_now: Vector, tau: Vector, friction: Vector | None
    ) -> list[float]:
        """Update the estimate for one cycle.

        Args:
            q: joint positions at the start of the cycle, 7 floats [rad].
            dq: joint velocities at the start of the cycle, 7 floats [rad/s].
            q_now: joint positions at the end of the cycle, 7 floats [rad].
            dq_now: joint velocities at the end of the cycle, 7 floats [rad/s].
            tau: joint torques during the cycle, 7 floats [N m].
            friction: friction torques at dq, 7 floats [N m]; None: the box has no friction model.

        Returns:
            Gravity torque at q_now, 7 floats [N m]: a by-product, which the box compensates next.
        """
        return self._arm.external_torque(self._constants, q, self.value, dq, q_now, dq_now, tau, friction or _NONE)
