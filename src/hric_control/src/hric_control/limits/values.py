"""Limits of one joint, with checks of their values."""

import math
from dataclasses import dataclass, fields

from hric_core.errors import ParameterError

INFINITY = math.inf
KINDS = ("position", "velocity", "effort", "effort_rate", "acceleration", "jerk", "soft")
"""Kinds of joint limit; the valid names in the parameter `enforce_limits`."""

_KIND_FIELDS: dict[str, dict[str, float]] = {
    "position": {"lower": -INFINITY, "upper": INFINITY},
    "velocity": {"velocity": INFINITY},
    "effort": {"effort": INFINITY},
    "effort_rate": {"effort_rate": INFINITY},
    "acceleration": {"acceleration": INFINITY},
    "jerk": {"jerk": INFINITY},
    "soft": {"k_position": 0.0, "k_velocity": 0.0, "soft_lower": -INFINITY, "soft_upper": INFINITY},
}


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint. Units are those of a revolute joint; for a prismatic one, m and N replace rad and N m.

    An infinite limit, or a gain of 0, means that nothing is limited.

    Attributes:
        name: joint name.
        lower, upper: position range [rad].
        velocity: largest speed [rad/s].
        effort: largest effort [N m].
        effort_rate: largest rate of effort [N m/s].
        acceleration: largest acceleration [rad/s^2]; used for velocity and position commands.
        jerk: largest jerk [rad/s^3]; for motion planners, no limiter enforces it.
        k_position: allowed speed per distance to the soft position limit [1/s]; 0: no soft limits.
        k_velocity: allowed effort per difference to the allowed speed [N m s/rad]; 0: hard velocity limit for effort
            commands.
        soft_lower, soft_upper: soft position limits, inside the range [rad].
        unit: unit of the position, "rad" or "m".
    """

    name: str
    lower: float = -INFINITY
    upper: float = INFINITY
    velocity: float = INFINITY
    effort: float = INFINITY
    effort_rate: float = INFINITY
    acceleration: float = INFINITY
    jerk: float = INFINITY
    k_position: float = 0.0
    k_velocity: float = 0.0
    soft_lower: float = -INFINITY
    soft_upper: float = INFINITY
    unit: str = "rad"

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, float) and math.isnan(value):
                raise ParameterError(f"limits of joint {self.name}: {item.name} is not a number")
        for name in ("velocity", "effort", "effort_rate", "acceleration", "jerk", "k_position", "k_velocity"):
            if getattr(self, name) < 0.0:
                raise ParameterError(
                    f"limits of joint {self.name}: {name} is {getattr(self, name):g}; it must be 0 or more"
                )
        for low, high in (("lower", "upper"), ("soft_lower", "soft_upper")):
            if getattr(self, low) > getattr(self, high):
                raise ParameterError(
                    f"limits of joint {self.name}: {low} {getattr(self, low):g} is above {high} {getattr(self, high):g}"
                )

    @property
    def has_soft_range(self) -> bool:
        """True if the allowed speed decreases to zero near a soft position limit."""
        return self.k_position > 0.0 and (self.soft_lower > -INFINITY or self.soft_upper < INFINITY)

    def only(self, kinds: tuple[str, ...] | list[str]) -> "JointLimits":
        """Return a copy in which all kinds of limit that are not named are set to "not limited".

        Raises:
            ParameterError: there is no such kind.
        """
        check_kinds(kinds)
        dropped = {
            key: value for kind, values in _KIND_FIELDS.items() if kind not in kinds for key, value in values.items()
        }
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return JointLimits(**{**values, **dropped})

    def soft_speeds(self, position: float) -> tuple[float, float]:
        """Return the smallest and largest velocity [rad/s] that the soft limits allow at a position q [rad].

        They are -k_position (q - soft limit), clamped to the velocity limit."""
        low, high = -self.velocity, self.velocity
        if self.k_position > 0.0:
            low = min(max(-self.k_position * (position - self.soft_lower), low), high)
            high = min(max(-self.k_position * (position - self.soft_upper), -self.velocity), high)
        return low, high

    def full_speed_range(self, low: float, high: float) -> tuple[float, float]:
        """Return the part of a position range [low, high] in which the soft limits allow the full velocity [rad]."""
        if not self.has_soft_range:
            return low, high
        reach = self.velocity / self.k_position
        return max(low, self.soft_lower + reach), min(high, self.soft_upper - reach)


def check_kinds(kinds: tuple[str, ...] | list[str]) -> None:
    """Check names of kinds of limit.

    Raises:
        ParameterError: a name does not exist; the message lists the valid ones.
    """
    unknown = [str(kind) for kind in kinds if kind not in KINDS]
    if unknown:
        raise ParameterError(f"unknown kind of joint limit: {', '.join(unknown)}; valid: {', '.join(KINDS)}")
