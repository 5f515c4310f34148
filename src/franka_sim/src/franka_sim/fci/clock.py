"""Clock of the robot's cycles: in lock-step with the client, or by wall time."""

from abc import ABC, abstractmethod
from enum import Enum

from hric_core.errors import UnknownNameError
from hric_core.parameters import number

PERIOD = 1e-3
"""Cycle time of the robot [s]."""
PATIENCE = 0.5
"""Maximum wait of the lock-step clock for a command, then it is lost [s].

It is longer than a busy machine suspends a process, and shorter than libfranka waits for a state (1 s).
"""
TIME_OUT = 0.05
"""Maximum wait after a lost command, and on a lossy network [s]: project default, unconfirmed, 1 s for 20 losses."""
FIRST_WAIT = 0.05
"""Pause to the next state before the first command of a motion, doubled each time up to PATIENCE [s].

The pause follows the two states that the client needs. A client that computes its first command sends it for the
newest state, and so each motion starts in the same way.
"""
STATES_BEFORE_FIRST = 2
"""States that libfranka reads before it computes its first command: up to the requested modes, and one more."""
CATCH_UP = 0.02
"""Delay that a paced lock-step clock makes up for afterwards [s]."""


class MotionPhase(Enum):
    """Phases of a motion, by the command that the robot waits for."""

    IDLE = "no motion"
    STARTING = "no command of this motion has come yet"
    AWAITING = "the command for the last state has not come"
    ARRIVED = "the command for the last state has come"


class CycleClock(ABC):
    """Interface that determines the wait before the next cycle."""

    @abstractmethod
    def left(self, now: float, phase: MotionPhase) -> float:
        """Return the time to wait before the next cycle [s], not above 0 if it is due. now: time.monotonic [s]."""

    @abstractmethod
    def ticked(self, now: float, phase: MotionPhase) -> None:
        """Register that a cycle starts now."""


class PeriodicClock(CycleClock):
    """Clock with one state per period, independent of the client.

    After a delay of its process there is no burst of states: robot time does not advance during the delay.

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
    """Clock that waits in a motion for the command for the last state.

    A command that does not come within PATIENCE, or within TIME_OUT after a lost one, is lost.

    Args:
        real_time_factor: maximum robot time per wall time; 0: as fast as the client sends (in idle mode: real time).
        lossy: True on a network that loses datagrams: TIME_OUT applies to all commands.
    """

    def __init__(self, real_time_factor: float = 1.0, lossy: bool = False) -> None:
        factor = number(minimum=0.0).checked(real_time_factor, "the real-time factor of the lock-step clock")
        self._paced, self._period = factor > 0.0, PERIOD / (factor or 1.0)
        self._last = self._next = 0.0
        self._starting = 0
        self._lossy, self._lost = lossy, False

    def left(self, now: float, phase: MotionPhase) -> float:
        """Return the time to the command's timeout, or to the deadline of the paced clock [s]."""
        if phase is MotionPhase.AWAITING:
            return self._last + (TIME_OUT if self._lossy or self._lost else PATIENCE) - now
        if phase is MotionPhase.STARTING and self._starting >= STATES_BEFORE_FIRST:
            wait = FIRST_WAIT * 2.0 ** min(self._starting - STATES_BEFORE_FIRST, 8)
            return self._last + min(wait, PATIENCE) - now
        if phase is MotionPhase.ARRIVED and not self._paced:
            return 0.0
        return self._next - now

    def ticked(self, now: float, phase: MotionPhase) -> None:
        """Set the next deadline."""
        self._starting = self._starting + 1 if phase is MotionPhase.STARTING else 0
        self._lost = phase is MotionPhase.AWAITING
        self._last = now
        self._next = max(self._next + self._period, now - CATCH_UP) if self._paced else now + self._period


def make_clock(name: str, real_time_factor: float, lossy: bool = False) -> CycleClock:
    """Return the clock "lock_step" or "wall"; lossy: on a lossy network. Raises UnknownNameError, ParameterError."""
    if name == "lock_step":
        return LockStepClock(real_time_factor, lossy)
    if name == "wall":
        return PeriodicClock(real_time_factor)
    raise UnknownNameError("clock", name, ("lock_step", "wall"))
