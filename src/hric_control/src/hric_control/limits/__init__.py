"""Joint limits: values, loading, enforcement, and counts of limited commands. Import all names from here."""

from hric_control.limits.counts import LimitCounts
from hric_control.limits.effort import EffortLimiter, Limiter
from hric_control.limits.loading import DEFAULT_KINDS, ENFORCE_LIMITS, check_start, load_limits
from hric_control.limits.motion import PositionLimiter, VelocityLimiter, stopping_speed
from hric_control.limits.values import KINDS, JointLimits, check_kinds

__all__ = [
    "DEFAULT_KINDS",
    "ENFORCE_LIMITS",
    "KINDS",
    "EffortLimiter",
    "JointLimits",
    "LimitCounts",
    "Limiter",
    "PositionLimiter",
    "VelocityLimiter",
    "check_kinds",
    "check_start",
    "load_limits",
    "stopping_speed",
]
