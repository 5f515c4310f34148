"""Torque commands from outside: what the box accepts."""

from __future__ import annotations

from collections.abc import Sequence

from franka_hw_interface.robot_state import NO_ERRORS, Errors
from franka_sim.box.config import BoxConfig
from hric_control.errors import CommandError
from hric_control.vectors import near, smaller

DISCONTINUITY: Errors = frozenset(("controller_torque_discontinuity",))
OUT_OF_RANGE: Errors = frozenset(("tau_j_range_violation",))


class TorqueChecks:
    """Torque and torque-rate limits of a command, with libfranka's numbers.

    What is no number, or changes faster than the limit of the torque rate, is a controller_torque_discontinuity; what is larger than the limit of the
    torque a tau_j_range_violation. (libfranka names the errors; which of the two a NaN is, is our choice.)
    """

    def __init__(self, config: BoxConfig) -> None:
        limits = config.limits
        per_cycle = (1.0 + config.torque_rate_tolerance) * config.time_step
        self._jump = tuple(rate * per_cycle for rate in limits.effort_rate)
        self._range = tuple(effort * (1.0 + 1e-9) for effort in limits.effort)

    def errors(self, tau: Sequence[float], before: Sequence[float]) -> Errors:
        """What is wrong with a command; tau: 7 floats [N m], before: the command accepted last.

        Raises:
            CommandError: not seven numbers; a mistake of the caller, not of the client.
        """
        if len(tau) != 7:
            raise CommandError(f"a torque command is 7 numbers [N m]; got {len(tau)}")
        if not near(tau, before, self._jump):  # NaN is near nothing
            return DISCONTINUITY
        return NO_ERRORS if smaller(tau, self._range) else OUT_OF_RANGE

    def limited(self, tau: Sequence[float], before: Sequence[float]) -> list[float]:
        """The nearest torque within the limits, 7 floats [N m]: for a box without reflexes."""
        rows = zip(tau, before, self._jump, self._range, strict=True)
        return [min(max(a, b - j, -limit), b + j, limit) for a, b, j, limit in rows]
