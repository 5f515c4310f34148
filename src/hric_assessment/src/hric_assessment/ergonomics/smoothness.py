"""How smooth a movement from rest to rest is, beside the one of minimum jerk over the same distance and time.

Minimum jerk: s = d (10 x^3 - 15 x^4 + 6 x^5) with x = t/T, so peak speed 15/8 d/T, acceleration 10/sqrt(3) d/T^2, jerk
60 d/T^3. Larger ratios are less smooth. They are descriptions, without a limit; so is the jerk
of any motion, also of one that comes back.
"""

import math
from typing import NamedTuple

import numpy as np

from hric_control.errors import HricError
from hric_control.geometry import FloatArray

PEAKS = (15.0 / 8.0, 10.0 / math.sqrt(3.0), 60.0)
"""Of speed, acceleration and jerk, in d/T, d/T^2 and d/T^3."""


class Smoothness(NamedTuple):
    """Peaks over those of minimum jerk [1]."""

    speed: float
    acceleration: float
    jerk: float


def smoothness(time: FloatArray, position: FloatArray) -> Smoothness:
    """Of a movement; by central differences, so filter what is measured before.

    Args:
        time: evenly spaced, shape (n,) [s].
        position: shape (n, d) [m] or [rad].

    Raises:
        HricError: no movement, or too few or uneven samples.
    """
    steps = np.diff(time)
    if len(time) < 8 or not np.allclose(steps, steps.mean(), rtol=1e-3):
        raise HricError(f"smoothness of {len(time)} samples; valid: 8 or more, evenly spaced")
    distance, duration = float(np.linalg.norm(position[-1] - position[0])), float(time[-1] - time[0])
    if not distance > 0.0:
        raise HricError("smoothness of no movement: begin and end are the same")
    found, derivative = [], position
    for order, peak in enumerate(PEAKS, 1):
        derivative = np.gradient(derivative, steps.mean(), axis=0)
        found.append(float(np.linalg.norm(derivative, axis=1).max()) * duration**order / (peak * distance))
    return Smoothness(*found)


def log_dimensionless_jerk(time: FloatArray, velocity: FloatArray) -> float | None:
    """Log dimensionless jerk of a motion: -ln(T^3 / v_peak^2 int |d2v/dt2|^2 dt) (Balasubramanian et al., J.
    NeuroEng. Rehabil. 12:112, 2015). The nearer to zero the smoother; one minimum-jerk reach has -5.32. None: it
    rests.

    Args:
        time: shape (n,) [s].
        velocity: shape (n, 3) [m/s].
    """
    peak = float(np.linalg.norm(velocity, axis=1).max())
    if peak < 1e-6 or len(time) < 5:
        return None
    jerk = np.gradient(np.gradient(velocity, time, axis=0), time, axis=0)
    area = float(np.trapezoid(np.einsum("ij,ij->i", jerk, jerk), time))
    return -math.log((time[-1] - time[0]) ** 3 / peak**2 * area)
