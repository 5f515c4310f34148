"""PID of several joints, with the parameter names of ros_control: p, i, d, i_clamp.

    u = p e + clamp(i * integral of e, -i_clamp, i_clamp) + d de/dt

The integral itself is limited to what the clamp allows (anti-windup).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from hric_core.parameters import Settings, anything, number


@dataclass(frozen=True)
class PidGains(Settings):
    """Gains of one joint; u is an effort [N m or N] when e is a position."""

    p: float = number(minimum=0.0, unit="N m/rad", text="effort version only")
    i: float = number(0.0, minimum=0.0, unit="N m/(rad s)")
    d: float = number(0.0, minimum=0.0, unit="N m s/rad")
    i_clamp: float = number(0.0, minimum=0.0, unit="N m", text="largest integral term; 0: no integral action")
    antiwindup: object = anything(None, text="accepted for the sake of existing YAML, without effect; so the following")
    i_clamp_min: object = anything(None)
    i_clamp_max: object = anything(None)
    publish_state: object = anything(None)


class Pid:
    """Set of PID controllers, one per joint; `update` is made for the control loop."""

    def __init__(self, gains: Sequence[PidGains]) -> None:
        self._gains = [(g.p, g.i, g.d, g.i_clamp) for g in gains]
        self._integral = [0.0] * len(self._gains)

    def reset(self) -> None:
        """Reset the integrals to zero."""
        self._integral = [0.0] * len(self._gains)

    def update(self, errors: Sequence[float], error_rates: Sequence[float], period: float) -> list[float]:
        """Return the efforts, n floats.

        Args:
            errors: desired minus measured position, n floats.
            error_rates: desired minus measured velocity, n floats.
            period: period of the loop [s].
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
