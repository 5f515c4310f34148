"""Force and work of a grip, and smoothness of a motion: descriptive values without a limit."""

import math
from dataclasses import dataclass

import numpy as np

from hric_bags.records.human_record import GripRecord
from hric_core.geometry import FloatArray


@dataclass(frozen=True)
class Effort:
    """Force and work of one grip.

    Attributes:
        closed: time for which the grip was closed [s].
        force_max, force_max_time: largest force [N] and its robot time [s].
        force_mean: mean force while the grip was closed [N].
        torque_max: largest torque [N m].
        work: work that the holder does on the held body [J].
        work_absolute: integral of the absolute value of the holder's power on the held body [J].
    """

    closed: float
    force_max: float
    force_max_time: float
    force_mean: float
    torque_max: float
    work: float
    work_absolute: float


def effort(grip: GripRecord) -> Effort | None:
    """Return force and work of a grip; None: the hand never closed, or only one message is known."""
    size, held = np.linalg.norm(grip.force, axis=1), grip.closed
    if not held.any() or len(held) < 2:
        return None
    velocity = np.gradient(np.where(held[:, None], grip.point, np.nan), grip.time, axis=0)
    power = np.nan_to_num(-np.einsum("ij,ij->i", grip.force, velocity))
    return Effort(
        float(held.mean() * (grip.time[-1] - grip.time[0])),
        *max((float(size.max()), float(grip.time[size.argmax()])), grip.left_out),
        float(size[held].mean()),
        float(np.linalg.norm(grip.torque, axis=1).max()),
        float(np.trapezoid(power, grip.time)),
        float(np.trapezoid(np.abs(power), grip.time)),
    )


def log_dimensionless_jerk(time: FloatArray, velocity: FloatArray) -> float | None:
    """Return the log dimensionless jerk -ln(T^3 / v_peak^2 int |d2v/dt2|^2 dt) of a motion; None: nothing moves.

    The nearer to zero, the smoother; one minimum-jerk reach has -5.32 (Balasubramanian et al., J. NeuroEng. Rehabil.
    12:112, 2015).

    Args:
        time: times of the samples, shape (n,) [s].
        velocity: velocity, shape (n, 3) [m/s].
    """
    peak = float(np.linalg.norm(velocity, axis=1).max())
    if peak < 1e-6 or len(time) < 5:
        return None
    jerk = np.gradient(np.gradient(velocity, time, axis=0), time, axis=0)
    area = float(np.trapezoid(np.einsum("ij,ij->i", jerk, jerk), time))
    return -math.log((time[-1] - time[0]) ** 3 / peak**2 * area)
