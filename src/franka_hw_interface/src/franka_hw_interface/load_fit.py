"""Identification of a payload from two logs of the same motion, with the payload and without it.

The difference of both residuals (measured minus modelled torque) is the torque that the payload needs. Errors of the
arm's model and its friction, which do not depend on the payload, cancel. The torque is linear in the payload's mass,
first moment and inertia about the flange.
"""

from dataclasses import dataclass

import numpy as np
import scipy.signal

from franka_hw_interface.arm_log import LogError
from franka_hw_interface.friction_fit import MOVING
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model_check import ModelCheck, inverse_dynamics, root_mean_square
from hric_core.geometry import FloatArray

SAME_MOTION = 0.05
"""Largest RMS difference of a joint's position between both logs [rad]; project default, unconfirmed."""
LOOSE_INERTIA = 0.3
"""Standard deviation relative to the largest principal moment above which the inertia counts as not determined [1];
project default, unconfirmed."""
SHORTEST = 2.0
"""Minimum time in which a joint moves, summed over the joints [s]; project default, unconfirmed."""
SIGNIFICANT = 3.0
"""Smallest mass that shows a payload, in standard deviations of the mass [1]; project default, unconfirmed."""
REFINEMENTS = 5
"""Number of steps that refine the shift between both logs."""


@dataclass(frozen=True)
class LoadFit:
    """Payload in the flange frame, with standard deviations from residual and bandwidth.

    Attributes:
        mass, mass_deviation: mass [kg].
        com, com_deviation: centre of mass, shape (3,) [m].
        inertia, inertia_deviation: inertia about the centre of mass, shape (3, 3) [kg m^2]; None: not determined.
        rms_before, rms: RMS of each joint's torque difference, before and after the fit, shape (7,) [N m].
        shift: time by which the log without the payload was shifted [s].
    """

    mass: float
    mass_deviation: float
    com: FloatArray
    com_deviation: FloatArray
    inertia: FloatArray | None
    inertia_deviation: FloatArray | None
    rms_before: FloatArray
    rms: FloatArray
    shift: float


def fit_load(model: KdlFrankaModel, loaded: ModelCheck, empty: ModelCheck) -> LoadFit:
    """Return the payload that explains the difference of two logs.

    Args:
        model: model of the arm without the payload; its payload is changed and removed again.
        loaded: comparison of this model with the log that was recorded with the payload.
        empty: comparison of this model with the log that was recorded without it.

    Raises:
        LogError: the motions differ, are too slow, or do not determine mass and centre of mass.
    """
    shift = _shift(loaded, empty)
    time = loaded.time - shift
    inside = (time >= empty.time[0]) & (time <= empty.time[-1])
    without = _at(time, empty.time, empty.residual)
    _check_same_motion(loaded, empty, time, inside)
    torque = loaded.residual - without
    moving = (np.abs(loaded.velocity) > MOVING) & inside[:, None]
    if moving.sum() < SHORTEST * loaded.signals.rate:
        spent = moving.sum() / loaded.signals.rate
        raise LogError(f"the joints exceed {MOVING:g} rad/s for only {spent:.2g} s; valid: {SHORTEST:g} s or more")
    regressor = _regressor(model, loaded)
    values, covariance = _solved(regressor, torque, moving, loaded)
    mass, mass_deviation = float(values[0]), float(np.sqrt(covariance[0, 0]))
    if not mass > SIGNIFICANT * mass_deviation:
        raise LogError(
            f"the mass is {mass:.4f} +- {mass_deviation:.1g} kg; valid: above {SIGNIFICANT:g} standard deviations (is "
            "the log with the payload given as the one without it, or has neither a payload?)"
        )
    inertia, inertia_deviation = _inertia(values, covariance)
    com = values[1:4] / values[0]
    slope = np.hstack([-com[:, None], np.eye(3)]) / mass  # of the centre of mass with respect to mass and first moment
    com_variance = np.diag(slope @ covariance[:4, :4] @ slope.T)
    left = torque - regressor @ values
    return LoadFit(
        mass,
        mass_deviation,
        com,
        np.sqrt(com_variance),
        inertia,
        inertia_deviation,
        _moving_rms(torque, moving),
        _moving_rms(left, moving),
        shift,
    )


def _shift(loaded: ModelCheck, empty: ModelCheck) -> float:
    """Return the time by which the log without the payload must be shifted to match the motion of the other [s]."""
    period = 1.0 / loaded.signals.rate
    grid = np.arange(empty.time[0], empty.time[-1], period)
    other = _at(grid, empty.time, empty.velocity)
    match = sum(scipy.signal.correlate(a, b, mode="full") for a, b in zip(loaded.velocity.T, other.T, strict=True))
    shift = float(loaded.time[0] - empty.time[0] + (int(np.argmax(match)) - (len(grid) - 1)) * period)
    acceleration = empty.signals.ddq[empty.signals.valid]
    for _ in range(REFINEMENTS):  # Gauss-Newton steps for the least difference of the velocities
        time = loaded.time - shift
        inside = (time >= empty.time[0]) & (time <= empty.time[-1])
        slope = _at(time[inside], empty.time, acceleration)
        away = _at(time[inside], empty.time, empty.velocity) - loaded.velocity[inside]
        shift += float((slope * away).sum() / max((slope * slope).sum(), 1e-12))
    return shift


def _at(times: FloatArray, known: FloatArray, values: FloatArray) -> FloatArray:
    """Return values of each column, interpolated linearly at times [s]."""
    return np.column_stack([np.interp(times, known, column) for column in values.T])


def _check_same_motion(loaded: ModelCheck, empty: ModelCheck, time: FloatArray, inside: FloatArray) -> None:
    q = loaded.signals.q[loaded.signals.valid]
    there = _at(time, empty.time, empty.signals.q[empty.signals.valid])
    away = root_mean_square((q - there)[inside]) if inside.any() else np.full(q.shape[1], np.inf)
    if not (away <= SAME_MOTION).all():
        joint = int(np.argmax(away))
        raise LogError(
            f"the two logs have different motions: {loaded.joint_names[joint]} differs by {away[joint]:.2g} rad RMS; "
            f"valid: the same trajectory twice, with up to {SAME_MOTION:g} rad between them (did a reflex end one of "
            "them? Then set an estimate of the payload first, with franka_control/set_load or robot.load)"
        )


def _regressor(model: KdlFrankaModel, loaded: ModelCheck) -> FloatArray:
    """Return the torque per unit of mass, first moment (3) and inertia about the flange (xx xy xz yy yz zz).

    Shape (k, 7, 10). It comes from ten valid payloads, whose parameters span all others.
    """
    signals = loaded.signals
    without = inverse_dynamics(model, signals.q, signals.dq, signals.ddq)
    torques, parameters = [], []
    for com, inertia in _payloads():
        try:
            model.set_load(1.0, com, inertia.ravel().tolist())
            torque = inverse_dynamics(model, signals.q, signals.dq, signals.ddq) - without
        finally:
            model.set_load(0.0, [0.0] * 3, [0.0] * 9)
        torques.append(signals.low_pass(torque)[signals.valid])
        about_flange = inertia + np.dot(com, com) * np.eye(3) - np.outer(com, com)
        parameters.append([1.0, *com, *about_flange[np.triu_indices(3)]])
    result: FloatArray = np.stack(torques, axis=-1) @ np.linalg.inv(np.array(parameters).T)
    return result


def _payloads() -> list[tuple[list[float], FloatArray]]:
    """Return centre of mass [m] and inertia about it [kg m^2] of ten payloads of 1 kg."""
    round_body = 0.01 * np.eye(3)
    centres = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]
    made = [(centre, round_body) for centre in centres]
    for row, column in zip(*np.triu_indices(3), strict=True):
        inertia = round_body.copy()
        inertia[row, column] += 0.004
        inertia[column, row] = inertia[row, column]
        made.append(([0.0, 0.0, 0.0], inertia))
    return made


def _solved(
    regressor: FloatArray, torque: FloatArray, moving: FloatArray, loaded: ModelCheck
) -> tuple[FloatArray, FloatArray]:
    """Return weighted least-squares parameters and their covariance; the weight of a joint is that of its residual."""
    count = regressor.shape[-1]
    spread = np.ones(torque.shape[1])
    for _ in range(3):
        weighted = (regressor / spread[:, None])[moving]
        values, _, rank, _ = np.linalg.lstsq(weighted, (torque / spread)[moving], rcond=1e-9)
        if rank < count:
            raise LogError("the motion does not determine the payload; valid: a motion of all joints")
        spread = np.maximum(_moving_rms(torque - regressor @ values, moving), 1e-6)
    # Neighbouring samples of a filtered residual are correlated: only 2 cut-off duration of them are independent.
    share = 2.0 * loaded.signals.cutoff / loaded.signals.rate
    return values, np.linalg.inv(weighted.T @ weighted) / share


def _inertia(values: FloatArray, covariance: FloatArray) -> tuple[FloatArray | None, FloatArray | None]:
    """Return inertia about the centre of mass and its standard deviation; None: not determined, or not possible."""
    com = values[1:4] / values[0]
    matrix, deviation = np.empty((3, 3)), np.empty((3, 3))
    rows = np.triu_indices(3)
    matrix[rows], deviation[rows] = values[4:], np.sqrt(np.diag(covariance)[4:])
    matrix.T[rows], deviation.T[rows] = matrix[rows], deviation[rows]
    matrix = matrix - values[0] * (com @ com * np.eye(3) - np.outer(com, com))
    moments = np.linalg.eigvalsh(matrix)
    possible = moments[0] > 0.0 and moments[0] + moments[1] >= moments[2]
    determined = np.diag(deviation).max() <= LOOSE_INERTIA * moments[2]
    return (matrix, deviation) if possible and determined else (None, None)


def _moving_rms(values: FloatArray, moving: FloatArray) -> FloatArray:
    """Return the RMS of each joint while it moves, shape (7,); 0 for a joint that never moves."""
    columns = zip(values.T, moving.T, strict=True)
    return np.array([root_mean_square(column[mask]) if mask.any() else 0.0 for column, mask in columns])
