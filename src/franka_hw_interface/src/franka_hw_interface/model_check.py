"""Comparison of an arm model with a log: torque that the model needs for the recorded motion, and measured torque."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from franka_hw_interface.arm_log import LogError
from franka_hw_interface.log_signals import Signals
from franka_hw_interface.model import FrankaModel
from hric_control.plants import Phi, bristle_torque, sigmoid_torque
from hric_core.geometry import FloatArray

Counting = Callable[[range], Iterable[int]]
"""Function that iterates over a range of instants, e.g. with a progress bar."""

VALID_SCALE = (0.2, 5.0)
"""Range of the ratio of measured to modelled torque [1]; outside it the log has wrong units or another quantity.

A forgotten load or another set of inertial parameters stays within it.
"""

COARSE = 500
"""Approximate number of instants at which `coarse_rms` evaluates a model (project default, unconfirmed)."""


@dataclass(frozen=True)
class ModelCheck:
    """Comparison of measured and modelled torques of j joints at m instants, all equally filtered.

    The properties have k instants: those without the transients of the filter.

    Attributes:
        joint_names: order of the columns.
        signals: filtered motion and torque of the log.
        rigid: M(q) ddq + C(q, dq) dq + g(q), shape (m, j) [N m].
        friction: friction of the model along the motion, shape (m, j) [N m].
    """

    joint_names: tuple[str, ...]
    signals: Signals
    rigid: FloatArray
    friction: FloatArray

    @property
    def time(self) -> FloatArray:
        """Time on the clock of the log, shape (k,) [s]."""
        return self.signals.time[self.signals.valid]

    @property
    def velocity(self) -> FloatArray:
        """Joint velocities, shape (k, j) [rad/s]."""
        return self.signals.dq[self.signals.valid]

    @property
    def measured(self) -> FloatArray:
        """Measured torques, shape (k, j) [N m]."""
        return self.signals.tau[self.signals.valid]

    @property
    def modelled(self) -> FloatArray:
        """Modelled torques, shape (k, j) [N m]."""
        return (self.rigid + self.friction)[self.signals.valid]

    @property
    def residual(self) -> FloatArray:
        """Measured minus modelled torques, shape (k, j) [N m]."""
        return self.measured - self.modelled

    @property
    def rms(self) -> FloatArray:
        """Root mean square of the residual of each joint, shape (j,) [N m]."""
        return root_mean_square(self.residual)


def root_mean_square(values: FloatArray) -> FloatArray:
    """Return the root mean square along the first axis."""
    result: FloatArray = np.sqrt(np.mean(values**2, axis=0))
    return result


def inverse_dynamics(
    model: FrankaModel, q: FloatArray, dq: FloatArray, ddq: FloatArray, counting: Counting = iter
) -> FloatArray:
    """Return the link-side torque M(q) ddq + C(q, dq) dq + g(q) at m instants, without friction and rotor inertia.

    Args:
        model: model with the load of the arm.
        q: joint positions, shape (m, 7) [rad].
        dq: joint velocities, shape (m, 7) [rad/s].
        ddq: joint accelerations, shape (m, 7) [rad/s^2].
        counting: function that iterates over the instants.

    Returns:
        Joint torques, shape (m, 7) [N m].
    """
    tau = np.empty_like(q)
    for k in counting(range(len(q))):
        tau[k] = model.mass(q[k]) @ ddq[k] + model.coriolis(q[k], dq[k]) + model.gravity(q[k])
    return tau


def friction_torque(dq: FloatArray, friction: Sequence[Phi] | None) -> FloatArray:
    """Return the sigmoid friction of each joint at dq, shape (m, j) [N m]; None: no friction."""
    if friction is None:
        return np.zeros_like(dq)
    return np.column_stack([sigmoid_torque(column, phi) for column, phi in zip(dq.T, friction, strict=True)])


def coarse_rms(model: FrankaModel, signals: Signals, friction: Sequence[Phi] | None) -> float:
    """Return the sum over the joints of the RMS torque residual [N m], from a few hundred instants of a log.

    Used to choose between two models; friction: phi1, phi2, phi3 of each joint, None: no friction.
    """
    count = len(signals.tau[signals.valid])
    part = slice(None, None, -(-count // COARSE))
    q, dq, ddq, tau = (values[signals.valid][part] for values in (signals.q, signals.dq, signals.ddq, signals.tau))
    residual = tau - inverse_dynamics(model, q, dq, ddq) - friction_torque(dq, friction)
    return float(root_mean_square(residual).sum())


def bristles(signals: Signals) -> FloatArray:
    """Return the friction at rest (bristle model) of each joint along the log for a breakaway torque of 1 N m.

    Shape (m, j) [N m].
    """
    return np.column_stack([bristle_torque(column, signals.time) for column in signals.dq.T])


def check(
    model: FrankaModel,
    joint_names: Sequence[str],
    signals: Signals,
    friction: Sequence[Phi] | None = None,
    counting: Counting = iter,
    breakaway: Sequence[float] = (),
) -> ModelCheck:
    """Compare the torques of a model with those of a log.

    tau = M(q) ddq + C(q, dq) dq + g(q) + friction(dq). The torque sensors of the arm are on the link side of its gears,
    so rotor inertia is not included.

    Args:
        model: model with the load of the arm.
        joint_names: joint names of the log.
        signals: filtered motion and torque of the log.
        friction: phi1 [N m], phi2 [s/rad], phi3 [rad/s] of each joint; None: no friction.
        counting: function that iterates over the instants, the slow part.
        breakaway: breakaway torque of each joint at rest [N m]; empty: none.

    Raises:
        LogError: the ratio of measured to modelled torque is outside VALID_SCALE.
    """
    rigid = signals.low_pass(inverse_dynamics(model, signals.q, signals.dq, signals.ddq, counting))
    torque = friction_torque(signals.dq, friction)
    if any(breakaway):
        torque = torque + bristles(signals) * breakaway
    checked = ModelCheck(tuple(joint_names), signals, rigid, signals.low_pass(torque))
    expected = rigid[signals.valid]
    scale = float((checked.measured * expected).sum() / (expected * expected).sum())
    if not VALID_SCALE[0] <= scale <= VALID_SCALE[1]:
        hint = "is it a commanded torque, without gravity?" if abs(scale) < VALID_SCALE[0] else "is it in N m?"
        raise LogError(
            f"the measured torque is {scale:.3g} times what the motion needs: the torque of the joints' sensors "
            f"in N m (tau_J) is needed; {hint}"
        )
    return checked
