"""Fit of joint friction (sigmoid and breakaway) to the residual of a rigid-body model by nonlinear least squares."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from franka_hw_interface.model_check import ModelCheck, bristles, friction_torque, root_mean_square
from hric_control.plants import Phi, sigmoid_torque
from hric_core.geometry import FloatArray

MOVING = 0.1
"""Minimum joint speed at which sliding friction can be identified [rad/s]; project default, unconfirmed.

The sigmoid bends at 1/phi2, which is 0.06 to 0.2 rad/s for the published parameters.
"""
MIN_TIME = 0.5
"""Minimum time that a joint must be faster than MOVING in each direction [s]; project default, unconfirmed."""
LOOSE = 0.3
"""Relative standard deviation above which a parameter is loosely determined [1]; project default, unconfirmed."""
BOUNDS = ((0.0, 0.1, -1.0, 0.0), (50.0, 1000.0, 1.0, 50.0))
"""Bounds of phi1 [N m], phi2 [s/rad], phi3 [rad/s] and breakaway [N m]: far beyond those of any joint."""
STARTS = ((1.0, 5.0, 0.0), (0.5, 30.0, 0.0))
"""Additional initial values (phi1, phi2, phi3) of the search: a soft and a steep sigmoid.

A search that starts at a steep sigmoid can get stuck, since the sigmoid is flat far from its bend.
"""


@dataclass(frozen=True)
class JointFriction:
    """Friction of a joint after a fit.

    Attributes:
        joint: name of the joint.
        phi: phi1 [N m], phi2 [s/rad], phi3 [rad/s].
        deviation: standard deviations of phi1 to phi3, from the residual and its bandwidth.
        speeds: minimum and maximum velocity of the log [rad/s].
        rms_before, rms: residual with the previous values and with phi [N m].
        fitted: False if the motion does not determine the friction; phi then has the previous values.
        breakaway: breakaway torque at rest [N m].
    """

    joint: str
    phi: Phi
    deviation: Phi
    speeds: tuple[float, float]
    rms_before: float
    rms: float
    fitted: bool
    breakaway: float = 0.0

    def loose(self) -> list[str]:
        """Return the names of the parameters whose standard deviation exceeds LOOSE of their size; phi3: of 1/phi2."""
        scales = (self.phi[0], self.phi[1], 1.0 / self.phi[1])
        return [f"phi{i + 1}" for i in range(3) if self.fitted and not self.deviation[i] <= LOOSE * scales[i]]

    def summary(self) -> str:
        """Return a one-line summary of the fit: velocity range, residuals, uncertain parameters."""
        low, high = self.speeds
        if not self.fitted:
            return (
                f"NOT FITTED: the joint moved from {low:.3f} to {high:.3f} rad/s, too slowly or too briefly in a "
                "direction, which does not determine friction; values as before"
            )
        loose = f"; loosely determined: {', '.join(self.loose())}" if self.loose() else ""
        return (
            f"fitted at velocities from {low:.3f} to {high:.3f} rad/s, RMS residual {self.rms_before:.3g} N m before, "
            f"{self.rms:.3g} N m after{loose}"
        )


def fit_friction(check: ModelCheck, before: Sequence[Phi]) -> list[JointFriction]:
    """Fit the friction of each joint to the measured torque minus the rigid-body torque M(q) ddq + C dq + g.

    The friction is a sigmoid of the velocity plus a breakaway torque. A joint that was not faster than `MOVING` for
    `MIN_TIME` in each direction keeps its previous values.

    Args:
        check: comparison of log and model; its friction is ignored.
        before: phi1 [N m], phi2 [s/rad], phi3 [rad/s] of each joint, where the search starts.
    """
    remaining = (check.signals.tau - check.rigid)[check.signals.valid]
    with_before = remaining - check.signals.low_pass(friction_torque(check.signals.dq, before))[check.signals.valid]
    fits, bent = [], check.signals.low_pass(bristles(check.signals))[check.signals.valid]
    for j, joint in enumerate(check.joint_names):
        velocity = check.velocity[:, j]
        speeds, rms = (float(velocity.min()), float(velocity.max())), float(root_mean_square(with_before[:, j]))
        unchanged = JointFriction(joint, before[j], (np.inf,) * 3, speeds, rms, rms, False)
        moved = min((velocity > MOVING).sum(), (velocity < -MOVING).sum()) >= MIN_TIME * check.signals.rate
        fits.append(_fitted(check, j, (remaining[:, j], bent[:, j]), unchanged) if moved else unchanged)
    return fits


def _fitted(check: ModelCheck, j: int, curves: tuple[FloatArray, FloatArray], before: JointFriction) -> JointFriction:
    """Fit the friction of joint j of the log and return it.

    Args:
        check: comparison of log and model.
        j: index of the joint.
        curves: torque residual of the rigid model, and bristle torque for a breakaway of 1 N m, shape (k,) each [N m].
        before: previous friction, where the search starts.
    """
    signals, (remaining, bent) = check.signals, curves

    def residual(values: FloatArray) -> FloatArray:
        sliding = signals.low_pass(sigmoid_torque(signals.dq[:, j], tuple(values[:3])))[signals.valid]
        result: FloatArray = sliding + values[3] * bent - remaining
        return result

    low, high = np.array(BOUNDS)
    starts = [np.clip((*start, 0.1), low + 1e-6, high - 1e-6) for start in (before.phi, *STARTS)]
    best = min(
        (least_squares(residual, start, bounds=BOUNDS, x_scale=(1.0, 10.0, 0.1, 0.1)) for start in starts),
        key=lambda result: result.cost,
    )
    # Neighbouring samples of a filtered residual are correlated: only 2 cut-off duration of them are independent.
    independent = max(2.0 * signals.cutoff * signals.duration, 5.0)
    variance = float(np.mean(best.fun**2)) * independent / (independent - 4.0)
    _, singular, directions = np.linalg.svd(best.jac, full_matrices=False)
    with np.errstate(divide="ignore"):
        spread = np.sqrt(variance * (len(remaining) / independent) * ((directions.T / singular) ** 2).sum(axis=1))
    phi1, phi2, phi3, breakaway = map(float, best.x)
    rms = float(root_mean_square(best.fun))
    return replace(
        before,
        phi=(phi1, phi2, phi3),
        deviation=(float(spread[0]), float(spread[1]), float(spread[2])),
        rms=rms,
        fitted=True,
        breakaway=breakaway,
    )
