"""Torque commands from outside: what the box accepts."""

from __future__ import annotations

from collections.abc import Sequence
from operator import sub

from franka_hw_interface.robot_state import NO_ERRORS, Errors
from franka_sim.box.config import BoxConfig
from hric_control.errors import CommandError

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
        self._least_jump = min(self._jump)
        self._range = tuple(effort * (1.0 + 1e-9) for effort in limits.effort)
        self._least_range = min(self._range)

    def errors(self, tau: Sequence[float], before: Sequence[float]) -> Errors:
        """What is wrong with a command; tau: 7 floats [N m], before: the command accepted last.

        Raises:
            CommandError: not seven numbers; a mistake of the caller, not of the client.
        """
        if len(tau) != 7:
            raise CommandError(f"a torque command is 7 numbers [N m]; got {len(tau)}")
        # NaN passes no comparison, so that "not within" is true for it as well; the sum holds for every joint alone.
        if not sum(map(abs, map(sub, tau, before))) <= self._least_jump and not self._smooth(tau, before):
            return DISCONTINUITY
        if max(map(abs, tau)) > self._least_range and not all([abs(a) <= limit for a, limit in zip(tau, self._range, strict=True)]):
            return OUT_OF_RANGE
        return NO_ERRORS

    def _smooth(self, tau: Sequence[float], before: Sequence[float]) -> bool:
        return all([-j <= a - b <= j for a, b, j in zip(tau, before, self._jump, strict=True)])

    def limited(self, tau: Sequence[float], before: Sequence[float]) -> list[float]:
        """The nearest torque within the limits, 7 floats [N m]: for a box without reflexes."""
        rows = zip(tau, before, self._jump, self._range, strict=True)
        return [min(max(a, b - j, -limit), b + j, limit) for a, b, j, limit in rows]
