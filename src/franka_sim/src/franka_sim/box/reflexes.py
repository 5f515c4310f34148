"""Checks of the measured state in each cycle that abort a motion by a reflex, and the log text of a reflex."""

import math
from array import array
from collections.abc import Callable, Sequence
from operator import mul

from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import NO_ERRORS, Errors
from franka_sim.box.config import BoxConfig
from franka_sim.box.self_collision import SelfCollision
from franka_sim.box.state import BoxState
from hric_core.native import load
from hric_core.native.vectors import smaller, within

JOINT_VELOCITY: Errors = frozenset(("joint_velocity_violation",))
JOINT_POSITION: Errors = frozenset(("joint_position_limits_violation",))
CARTESIAN_VELOCITY: Errors = frozenset(("cartesian_velocity_violation",))
SELF_COLLISION: Errors = frozenset(("self_collision_avoidance_violation",))
JOINT_COLLISION: Errors = frozenset(("joint_reflex",))
CARTESIAN_COLLISION: Errors = frozenset(("cartesian_reflex",))
Vector = Sequence[float]
_quiet_speed: "Callable[[array[float], Vector, Vector, Vector], float]" = load("hric_arm").quiet_speed


class Reflexes:
    """Checks of the measured state while the arm moves: joint limits, speed, collision and self-collision.

    A cheap, conservative bound shows in most cycles that the expensive checks (self-collision, end-effector speed,
    wrench) cannot fail, so that every cycle is covered.

    Args:
        config: thresholds.
        self_collision: check of the distance between the links.
    """

    def __init__(self, config: BoxConfig, self_collision: SelfCollision) -> None:
        self._config, self._bodies = config, self_collision
        limits, margin = config.limits, config.position_margin
        self._velocity = limits.velocity
        self._range = [x + margin for x in limits.lower], [x - margin for x in limits.upper]
        self._lower, self._upper = (list(row) for row in self._range)
        self._speed = limits.translation.velocity
        # |tau_ext|^2 below which no threshold of a joint or of the wrench is reached: |F| <= |tau_ext| / (minimum
        # singular value) + noise.
        self._gate = 0.0
        self._wrench_noise = 0.0
        self._pack()

    def _pack(self) -> None:
        """Pack the bounds for the compiled screening."""
        rows = self._velocity, self._lower, self._upper, self._bodies.reach, (self._gate,)
        self._packed = array("d", [x for row in rows for x in row])

    def start(self, state: BoxState) -> None:
        """Start a motion: a joint that is beyond its limit already may move back, but not farther out."""
        far = self._config.start_tolerance
        self._lower[:] = [min(low, q - far) for low, q in zip(self._range[0], state.q, strict=True)]
        self._upper[:] = [max(high, q + far) for high, q in zip(self._range[1], state.q, strict=True)]
        self._bodies.start(state.q)
        self.take_thresholds(state)

    def take_wrench_noise(self, peak: float) -> None:
        """Set the upper bound of the noise in each force [N] and moment [N m] of the wrench; call before `start`."""
        self._wrench_noise = peak

    def take_thresholds(self, state: BoxState) -> None:
        """Read the collision thresholds from the state."""
        t = state.thresholds
        lowest = min(*t.upper_force_acceleration, *t.upper_force_nominal)
        force = self._config.min_singular_value * max(lowest - self._wrench_noise, 0.0)
        self._gate = min(force, *t.upper_torque_acceleration, *t.upper_torque_nominal) ** 2
        self._pack()

    def errors(self, state: BoxState) -> Errors:
        """Return the errors of the measured state, by libfranka's names; collisions are also marked in the state."""
        speed, bodies = _quiet_speed(self._packed, state.q, state.dq, state.tau_ext_hat_filtered), self._bodies
        if not 0.0 <= speed <= self._speed:
            speed = sum(map(mul, map(abs, state.dq), bodies.reach))
            if wrong := self._look(state, speed):
                return wrong
        bodies.free -= speed * self._config.time_step
        return NO_ERRORS if bodies.free > 0.0 or not bodies.too_near(state.q) else SELF_COLLISION

    def _look(self, state: BoxState, speed: float) -> Errors:
        """Check each value after the screening: at least one is beyond its conservative bound."""
        q, tau = state.q, state.tau_ext_hat_filtered
        if not smaller(state.dq, self._velocity):  # comparisons with NaN are False
            return JOINT_VELOCITY
        if not within(q, self._lower, self._upper):
            return JOINT_POSITION
        collision = NO_ERRORS if sum(map(mul, tau, tau)) <= self._gate else self._collision(state)
        too_fast = not collision and speed > self._speed and self._end_effector_speed(state) > self._speed
        return CARTESIAN_VELOCITY if too_fast else collision

    def _end_effector_speed(self, state: BoxState) -> float:
        twist = state.model.zero_jacobian(FrankaFrame.END_EFFECTOR, state.q) @ state.dq
        return math.hypot(*twist[:3])

    def _collision(self, state: BoxState) -> Errors:
        tau = state.tau_ext_hat_filtered
        torques, forces = state.upper()
        if not all([-limit <= x <= limit for x, limit in zip(tau, torques, strict=True)]):
            state.joint_collision[:] = [1.0 if abs(x) > limit else 0.0 for x, limit in zip(tau, torques, strict=True)]
            return JOINT_COLLISION
        levels = [1.0 if abs(x) > limit else 0.0 for x, limit in zip(state.K_F_ext_hat_K, forces, strict=True)]
        if any(levels):
            state.cartesian_collision[:] = levels
            return CARTESIAN_COLLISION
        return NO_ERRORS


_AXES = ("force x", "force y", "force z", "moment x", "moment y", "moment z")


def _worst(values: Sequence[float], limits: Sequence[float], names: Sequence[str], units: Sequence[str]) -> str:
    i = max(range(len(values)), key=lambda k: abs(values[k]) / limits[k] if limits[k] else abs(values[k]))
    return f"{names[i]} at {values[i]:.3g} {units[i]}, limit {limits[i]:g}"


def describe(names: Errors, state: BoxState, config: BoxConfig, reason: str = "") -> str:
    """Return the errors' names, with the value that exceeds its limit most; reason: text of the motion generator."""
    joints, limits, text = state.model.joint_names, config.limits, ", ".join(sorted(names))
    if "joint_velocity_violation" in names:
        return f"{text} ({_worst(state.dq, limits.velocity, joints, ['rad/s'] * 7)})"
    if "joint_reflex" in names:
        return f"{text} ({_worst(state.tau_ext_hat_filtered, state.upper()[0], joints, ['N m'] * 7)})"
    if "cartesian_reflex" in names:
        return (
            f"{text} ({_worst(state.K_F_ext_hat_K, state.upper()[1], _AXES, ['N'] * 3 + ['N m'] * 3)}, in the "
            "stiffness frame)"
        )
    if "joint_position_limits_violation" in names:
        distances = [min(q - low, high - q) for low, q, high in zip(limits.lower, state.q, limits.upper, strict=True)]
        i = distances.index(min(distances))
        return f"{text} ({joints[i]} at {state.q[i]:.4f} rad, range {limits.lower[i]:g} to {limits.upper[i]:g})"
    return f"{text} ({reason})" if reason else text
