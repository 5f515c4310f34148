"""Deceleration of the desired joint position to rest, around which the internal joint impedance holds the arm."""

from franka_sim.box.config import BoxConfig
from franka_sim.box.state import BoxState


class MotionBraking:
    """Deceleration of the desired joint motion with the acceleration limits, e.g. after an aborted motion.

    q_d' = q_d + dt dq_d, dq_d' = dq_d reduced by at most dt * deceleration * limit; ddq_d is the change of dq_d per
    time.
    """

    def __init__(self, config: BoxConfig) -> None:
        self._dt = config.time_step
        self._step = tuple(config.stop_deceleration * config.time_step * a for a in config.limits.acceleration)
        self._range = tuple(zip(config.limits.lower, config.limits.upper, strict=True))
        self._zeros = [0.0] * 7

    def start(self, state: BoxState) -> None:
        """Start at the present position and velocity of the arm."""
        state.q_d[:], state.dq_d[:] = state.q, state.dq

    def advance(self, state: BoxState) -> None:
        """Write q_d, dq_d and ddq_d of one cycle, in place."""
        if any(state.dq_d):
            before = state.dq_d
            after = [
                max(v - step, 0.0) if v > 0.0 else min(v + step, 0.0)
                for v, step in zip(before, self._step, strict=True)
            ]
            self._move(state, before, after)
        elif any(state.ddq_d):
            state.ddq_d[:] = self._zeros

    def _move(self, state: BoxState, before: list[float], after: list[float]) -> None:
        dt = self._dt
        state.ddq_d[:] = [(b - a) / dt for a, b in zip(before, after, strict=True)]
        # The braking motion ends at the position limit; a desired position already beyond it may stay there.
        rows = zip(state.q_d, after, self._range, strict=True)
        state.q_d[:] = [min(max(q + dt * v, min(q, low)), max(q, high)) for q, v, (low, high) in rows]
        state.dq_d[:] = after
        state.desired_changed()
