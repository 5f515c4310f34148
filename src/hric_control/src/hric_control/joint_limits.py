"""Joint limits: values, reading them, enforcing them, counting what they did. This is the module to import from."""

from hric_control.effort_limiter import EffortLimiter, Limiter
from hric_control.limit_counts import LimitCounts, merged
from hric_control.limit_loading import load_limits
from hric_control.limit_values import KINDS, JointLimits, check_kinds
from hric_control.motion_limiters import PositionLimiter, VelocityLimiter, stopping_speed

__all__ = [
    "KINDS",
    "EffortLimiter",
    "JointLimits",
    "LimitCounts",
    "Limiter",
    "PositionLimiter",
    "VelocityLimiter",
    "check_kinds",
    "load_limits",
    "merged",
    "stopping_speed",
]
