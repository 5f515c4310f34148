"""The arm's internal joint impedance, and gains that a sampled loop can carry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from hric_control.errors import HricError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class JointImpedance:
    """tau = K (q_d - q) + D (dq_d - dq), each torque within its limit.

    Attributes:
        stiffness: K, n floats [N m/rad].
        damping: D, n floats [N m s/rad].
        max_torque: n floats [N m].
    """

    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    max_torque: tuple[float, ...]

    def torque(self, q_d: Sequence[float], dq_d: Sequence[float], q: Sequence[float], dq: Sequence[float]) -> list[float]:
        """Torque without gravity, n floats [N m]; positions [rad], velocities [rad/s]."""
        rows = zip(self.stiffness, self.damping, self.max_torque, q_d, dq_d, q, dq, strict=True)
        return [min(max(k * (x_d - x) + d * (v_d - v), -limit), limit) for k, d, limit, x_d, v_d, x, v in rows]


@cache
def defaults() -> dict[str, Any]:
    """What config/internal_impedance.yaml says."""
    for folder in (Path(__file__).resolve().parents[2], *_installed()):
        path = folder / "config" / "internal_impedance.yaml"
        if path.is_file():
            values: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
            return values
    raise HricError("franka_sim: config/internal_impedance.yaml is not found")


def _installed() -> list[Path]:
    import rospkg

    try:
        return [Path(rospkg.RosPack().get_path("franka_sim"))]
    except rospkg.ResourceNotFound:
        return []


def least_inertia(mass_matrices: FloatArray, rotor_inertia: Sequence[float]) -> FloatArray:
    """Least 1/((M+B)^-1)_ii of each joint over the poses, shape (n,) [kg m^2]: what a joint moves when all others are free.

    mass_matrices: shape (poses, n, n) [kg m^2]; rotor_inertia: diagonal of B, n floats [kg m^2].
    """
    inverse = np.linalg.inv(mass_matrices + np.diag(rotor_inertia))
    least: FloatArray = 1.0 / np.diagonal(inverse, axis1=1, axis2=2).max(axis=0)
    return least


def sustainable(stiffness: Sequence[float], damping: Sequence[float], inertia: FloatArray, time_step: float) -> tuple[list[float], list[float]]:
    """The gains, lowered per joint to what a loop of this time step can carry (the bounds of config/internal_impedance.yaml).

    Args:
        stiffness, damping: wanted, n floats [N m/rad], [N m s/rad].
        inertia: from `least_inertia`.
        time_step: [s].
    """
    rule = defaults()
    highest_k = (rule["frequency_limit"] / time_step) ** 2 * inertia
    highest_d = rule["damping_limit"] / time_step * inertia
    return np.minimum(stiffness, highest_k).tolist(), np.minimum(damping, highest_d).tolist()


def spectral_radius(mass: FloatArray, stiffness: Sequence[float], damping: Sequence[float], time_step: float) -> float:
    """Largest eigenvalue of the sampled loop around a pose, by magnitude: below 1 it is stable.

    The arm is (M+B) ddq = tau, the torque held over each time step: v' = v + dt a, q' = q + dt v + dt^2/2 a.

    mass: M+B, shape (n, n) [kg m^2].
    """
    n, dt = len(mass), time_step
    by_q, by_v = np.linalg.solve(mass, np.diag(stiffness)), np.linalg.solve(mass, np.diag(damping))
    one = np.eye(n)
    step = np.block([[one - dt * dt / 2 * by_q, dt * one - dt * dt / 2 * by_v], [-dt * by_q, one - dt * by_v]])
    return float(np.abs(np.linalg.eigvals(step)).max())
