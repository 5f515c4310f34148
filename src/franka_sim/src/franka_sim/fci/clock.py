"""Clocks that time the robot's 1 ms cycles: in lock-step with the client, or by wall time."""

import math
from abc import ABC, abstractmethod
from enum import Enum

from hric_core.errors import UnknownNameError
from hric_core.parameters import number

PERIOD = 1e-3
"""Cycle time of the robot [s]."""
PATIENCE = 0.5
"""Maximum wait of the lock-step clock for a command [s]; then the command counts as lost.

It is longer than a busy machine suspends a process, and shorter than libfranka waits for a state (1 s).
"""
TIME_OUT = 0.05
"""Maximum wait for a command after a lost one, and on a lossy network [s]; 20 losses then take 1 s.

Project default, unconfirmed.
"""
FIRST_WAIT = 0.05
"""Wall time between states before the first command of a motion [s], doubled each time up to PATIENCE.

The waits begin after the two states that the client needs. The client's first command then always refers to the newest
state, however long it takes to compute, and every motion starts in the same way.
"""
STATES_BEFORE_FIRST = 2
"""Number of states that libfranka reads before its first command: the one with the requested modes and one more."""
SILENT = 20
"""Number of states without a command after which a world of several arms no longer waits for this one.

Project default, unconfirmed: the number of lost commands that ends a motion.
"""
CATCH_UP = 0.02
"""Maximum delay that a lock-step clock with a real-time factor makes up for by faster cycles [s]."""


class MotionPhase(Enum):
    """Phase of a motion: whether a command is awaited, and which."""

    IDLE = "no motion"
    STARTING = "no command of this motion has come yet"
    AWAITING = "the command for the last state has not come"
    ARRIVED = "the command for the last state has come"


class CycleClock(ABC):
    """Interface of a clock that determines when the next cycle of the robot starts."""

    @abstractmethod
    def left(self, now: float, phase: MotionPhase) -> float:
        """Return the time to wait before the next cycle [s], not above 0 if it is due. now: time.monotonic [s]."""

    @abstractmethod
    def ticked(self, now: float, phase: MotionPhase) -> None:
        """Register that a cycle starts now."""


class PeriodicClock(CycleClock):
    """Clock that starts a cycle in each period of wall time, whether or not the client keeps up.

    If this process is delayed, robot time stops meanwhile, so no burst of states follows.

    Args:
        real_time_factor: robot time per wall time, above 0.
    """

    def __init__(self, real_time_factor: float = 1.0) -> None:
        factor = number(above=0.0).checked(real_time_factor, "the real-time factor of the wall clock")
        self._period, self._next = PERIOD / factor, 0.0

    def left(self, now: float, phase: MotionPhase) -> float:
        """Return the time to the next deadline [s]."""
        return self._next - now

    def ticked(self, now: float, phase: MotionPhase) -> None:
        """Set the next deadline."""
        self._next = self._next + self._period if now < self._next + 0.5 * self._period else now + self._period


class LockStepClock(CycleClock):
    """Clock that waits, during a motion, for the client's command to the last state.

    A command that does not come within PATIENCE counts as lost; after a lost command the limit is TIME_OUT.

    Args:
        real_time_factor: maximum robot time per wall time; 0: as fast as the client sends (in idle mode: real time).
        lossy: True on a network that loses datagrams: TIME_OUT applies to all commands.
        alone: True for the only arm of a world; False: do not wait for a client that was silent for SILENT states.
    """

    def __init__(self, real_time_factor: float = 1.0, lossy: bool = False, alone: bool = True) -> None:
        factor = number(minimum=0.0).checked(real_time_factor, "the real-time factor of the lock-step clock")
        self._paced, self._period = factor > 0.0, PERIOD / (factor or 1.0)
        self._last = self._next = 0.0
        self._starting = self._lost = 0
        self._lossy, self._silent = lossy, math.inf if alone else SILENT

    def left(self, now: float, phase: MotionPhase) -> float:
        """Return the time to the command's timeout, or to the deadline of the paced clock [s]."""
        if phase is MotionPhase.AWAITING and self._lost < self._silent:
            return self._last + (TIME_OUT if self._lossy or self._lost else PATIENCE) - now
        if phase is MotionPhase.STARTING and STATES_BEFORE_FIRST <= self._starting < self._silent:
            wait = FIRST_WAIT * 2.0 ** min(self._starting - STATES_BEFORE_FIRST, 8)
            return self._last + min(wait, PATIENCE) - now
        if phase is MotionPhase.ARRIVED and not self._paced:
            return 0.0
        return self._next - now

    def ticked(self, now: float, phase: MotionPhase) -> None:
        """Set the next deadline."""
        self._starting = self._starting + 1 if phase is MotionPhase.STARTING else 0
        self._lost = self._lost + 1 if phase is MotionPhase.AWAITING else 0
        self._last = now
        self._next = max(self._next + self._period, now - CATCH_UP) if self._paced else now + self._period


def make_clock(name: str, real_time_factor: float, lossy: bool = False, alone: bool = True) -> CycleClock:
    """Return the clock "lock_step" or "wall"; arguments: see LockStepClock. Raises UnknownNameError, ParameterError."""
    if name == "lock_step":
        return LockStepClock(real_time_factor, lossy, alone)
    if name == "wall":
        return PeriodicClock(real_time_factor)
    raise UnknownNameError("clock", name, ("lock_step", "wall"))
