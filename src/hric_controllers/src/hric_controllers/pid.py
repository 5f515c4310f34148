"""PID of several joints, with the parameter names of ros_control: p, i, d, i_clamp.

    u = p e + clamp(i * integral of e, -i_clamp, i_clamp) + d de/dt

The integral itself is kept within what the clamp lets through, so that it does not wind up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hric_control.errors import ParameterError


@dataclass(frozen=True)
class PidGains:
    """Gains of one joint; u is an effort [N m or N] when e is a position.

    Attributes:
        p: [N m/rad].
        i: [N m/(rad s)].
        d: [N m s/rad].
        i_clamp: largest size of the integral term [N m]; zero without one means no integral action.
    """

    p: float
    i: float = 0.0
    d: float = 0.0
    i_clamp: float = 0.0

    def check(self, where: str) -> None:
        """Refuse gains that are negative or not finite.

        Raises:
            ParameterError: names the gain and `where` it stands.
        """
        for name in ("p", "i", "d", "i_clamp"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value < 0.0:
                raise ParameterError(f"{where}/{name} is {value!r}; valid: a finite number, not below zero")


class Pid:
    """One PID per joint; `update` is made for the control loop."""

    def __init__(self, gains: Sequence[PidGains]) -> None:
        self._gains = [(g.p, g.i, g.d, g.i_clamp) for g in gains]
        self._integral = [0.0] * len(self._gains)

    def reset(self) -> None:
        """Forget the integrals."""
        self._integral = [0.0] * len(self._gains)

    def update(self, errors: Sequence[float], error_rates: Sequence[float], period: float) -> list[float]:
        """Efforts, n floats.

        Args:
            errors: desired minus measured position, n floats.
            error_rates: desired minus measured velocity, n floats.
            period: [s].
        """
        result = []
        for index, ((p, i, d, clamp), error, rate) in enumerate(zip(self._gains, errors, error_rates, strict=True)):
            effort = p * error + d * rate
            if i:
                bound = clamp / i
                integral = min(max(self._integral[index] + error * period, -bound), bound)
                self._integral[index] = integral
                effort += i * integral
            result.append(effort)
        return result
