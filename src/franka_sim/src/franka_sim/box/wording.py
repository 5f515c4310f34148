"""What a reflex was about, in words: the joint, what was measured, and the limit."""

from __future__ import annotations

from collections.abc import Sequence

from franka_hw_interface.robot_state import Errors
from franka_sim.box.config import BoxConfig
from franka_sim.box.state import BoxState

_AXES = ("force x", "force y", "force z", "moment x", "moment y", "moment z")


def _worst(values: Sequence[float], limits: Sequence[float], names: Sequence[str], units: Sequence[str]) -> str:
    i = max(range(len(values)), key=lambda k: abs(values[k]) / limits[k] if limits[k] else abs(values[k]))
    return f"{names[i]} at {values[i]:.3g} {units[i]}, limit {limits[i]:g}"


def describe(names: Errors, state: BoxState, config: BoxConfig, reason: str = "") -> str:
    """Errors by name, and the worst value behind them where it is known; reason: what the motion generator says."""
    joints, limits, text = state.model.joint_names, config.limits, ", ".join(sorted(names))
    if "joint_velocity_violation" in names:
        return f"{text} ({_worst(state.dq, limits.velocity, joints, ['rad/s'] * 7)})"
    if "joint_reflex" in names:
        return f"{text} ({_worst(state.tau_ext_hat_filtered, state.upper()[0], joints, ['N m'] * 7)})"
    if "cartesian_reflex" in names:
        return f"{text} ({_worst(state.K_F_ext_hat_K, state.upper()[1], _AXES, ['N'] * 3 + ['N m'] * 3)}, in the stiffness frame)"
    if "joint_position_limits_violation" in names:
        distances = [min(q - low, high - q) for low, q, high in zip(limits.lower, state.q, limits.upper, strict=True)]
        i = distances.index(min(distances))
        return f"{text} ({joints[i]} at {state.q[i]:.4f} rad, range {limits.lower[i]:g} to {limits.upper[i]:g})"
    return f"{text} ({reason})" if reason else text
