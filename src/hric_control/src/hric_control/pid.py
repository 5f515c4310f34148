"""PID of one joint with the parameters of ros_control (control_toolbox): p, i, d, i_clamp, i_clamp_min, i_clamp_max."""

import math
from dataclasses import dataclass

from hric_core.parameters import Settings, anything, number, refused


@dataclass(frozen=True)
class PidGains(Settings):
    """Gains of a joint's PID controller: effort per rad (or m) of position error, or per rad/s (m/s) of speed error."""

    p: float = number(text="proportional gain")
    i: float = number(0.0, text="integral gain, per second")
    d: float = number(0.0, text="derivative gain, in seconds")
    i_clamp: float = number(0.0, unit="N m or N", text="largest magnitude of the integral term; 0: no integral term")
    i_clamp_min: float = number(0.0, unit="N m or N", text="lower bound of the integral term; 0: -i_clamp")
    i_clamp_max: float = number(0.0, unit="N m or N", text="upper bound of the integral term; 0: i_clamp")
    antiwindup: object = anything(None, text="no effect; accepted as existing YAML files have it")
    publish_state: object = anything(None, text="no effect; accepted as existing YAML files have it")

    @property
    def i_bounds(self) -> tuple[float, float]:
        """Bounds of the integral term [N m or N]; if both are zero there is no integral term, as in control_toolbox."""
        return self.i_clamp_min or -abs(self.i_clamp), self.i_clamp_max or abs(self.i_clamp)

    def check(self, where: str) -> None:
        """Refuse a lower bound of the integral term that is above the upper one."""
        low, high = self.i_bounds
        if low > high:
            raise refused(f"{where}i_clamp_min", low, f"up to i_clamp_max, {high:g} N m or N")


class Pid:
    """PID controller of one joint, on plain floats, for use in the control loop."""

    __slots__ = ("_gains", "_i_bounds", "_integral", "_last", "_limit")

    def __init__(self, gains: PidGains, effort_limit: float = math.inf) -> None:
        self._gains, self._i_bounds, self._limit = gains, gains.i_bounds, effort_limit
        self.reset()

    def reset(self) -> None:
        """Reset the integral term to zero and forget the last error."""
        self._integral, self._last = 0.0, math.nan

    def effort(self, error: float, period: float, error_rate: float | None = None) -> float:
        """Return the effort p e + I + d de/dt, clamped to the effort limit [N m or N].

        I is the integral of i e over time, clamped to its bounds.

        Args:
            error: error e, setpoint minus measured value [rad, rad/s, m or m/s].
            period: time since the last call [s].
            error_rate: de/dt [error unit per second]; None: the difference of the last two errors over `period`.
        """
        gains, (i_min, i_max) = self._gains, self._i_bounds
        self._integral = min(max(self._integral + gains.i * error * period, i_min), i_max)
        if error_rate is None:
            error_rate = 0.0 if math.isnan(self._last) else (error - self._last) / period
        self._last = error
        tau = gains.p * error + self._integral + gains.d * error_rate
        return min(max(tau, -self._limit), self._limit)
