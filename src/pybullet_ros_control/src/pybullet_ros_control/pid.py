"""PID gains as in `gazebo_ros_control/pid_gains/<joint>`, for joints that are driven by effort towards a position or velocity."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hric_control.errors import ParameterError

_KEYS = ("p", "i", "d", "i_clamp", "i_clamp_min", "i_clamp_max", "antiwindup")


@dataclass(frozen=True)
class PidGains:
    """Gains per rad (or m) of a position error, or per rad/s (or m/s) of a velocity error.

    Attributes:
        p, i, d: proportional, integral (per second) and derivative (seconds) gain.
        i_min, i_max: bounds of the integral term [N m or N]; both zero switch it off, as in control_toolbox.
    """

    p: float
    i: float
    d: float
    i_min: float
    i_max: float

    @classmethod
    def from_parameter(cls, value: Any, where: str) -> PidGains:
        """Read {p, i, d, i_clamp} or {p, i, d, i_clamp_min, i_clamp_max}.

        Raises:
            ParameterError: unknown key, a missing p, or a value that is not a number.
        """
        if not isinstance(value, Mapping) or "p" not in value:
            raise ParameterError(f"{where} must be {{p, i, d, i_clamp}} with p at least; got {value!r}")
        unknown = sorted(set(value) - set(_KEYS))
        if unknown:
            raise ParameterError(f"{where}: unknown key {', '.join(unknown)}; valid: {', '.join(_KEYS)}")
        numbers = {key: value.get(key, 0.0) for key in _KEYS[:-1]}
        for key, number in numbers.items():
            if isinstance(number, bool) or not isinstance(number, (int, float)) or not math.isfinite(number):
                raise ParameterError(f"{where}/{key} must be a number; got {number!r}")
        clamp = abs(numbers["i_clamp"])
        i_min, i_max = numbers["i_clamp_min"] or -clamp, numbers["i_clamp_max"] or clamp
        if i_min > i_max:
            raise ParameterError(f"{where}: i_clamp_min {i_min} is above i_clamp_max {i_max}")
        return cls(float(numbers["p"]), float(numbers["i"]), float(numbers["d"]), float(i_min), float(i_max))


class Pid:
    """One joint's PID law, on plain floats."""

    __slots__ = ("_gains", "_integral", "_last", "_limit")

    def __init__(self, gains: PidGains, effort_limit: float) -> None:
        self._gains, self._limit = gains, effort_limit
        self.reset()

    def reset(self) -> None:
        """Forget the integral and the last error."""
        self._integral, self._last = 0.0, math.nan

    def effort(self, error: float, period: float) -> float:
        """tau = p e + I + d de/dt within the effort limit, I = sum of i e dt within its bounds [N m or N].

        Args:
            error: command minus measured value [rad, rad/s, m or m/s].
            period: time since the last call [s].
        """
        gains = self._gains
        self._integral = min(max(self._integral + gains.i * error * period, gains.i_min), gains.i_max)
        rate = 0.0 if math.isnan(self._last) else (error - self._last) / period
        self._last = error
        tau = gains.p * error + self._integral + gains.d * rate
        return min(max(tau, -self._limit), self._limit)
