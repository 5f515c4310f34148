"""When the next millisecond of the robot begins: in lock-step with the client, or by the wall clock."""

from abc import ABC, abstractmethod
from enum import Enum

from hric_control.errors import UnknownNameError
from hric_control.parameters import number

PERIOD = 1e-3
"""A cycle of the robot [s]."""
PATIENCE = 0.5
"""How long a command may keep the lock-step clock waiting before it counts as lost [s]: longer than a busy machine
keeps a process from running, shorter than libfranka waits for a state (1 s)."""
TIME_OUT = 0.05
"""The same after a command that was lost, and on a network that loses them [s]: project default, unconfirmed, 20 lost
ones make 1 s."""
FIRST_WAIT = 0.05
"""Before the first command of a motion, after the two states that the client needs: pause to the next state, doubled up
to PATIENCE [s].

A client that computes its first command sends it for the newest state then, and the motion begins the same way each
time.
"""
STATES_BEFORE_FIRST = 2
"""libfranka reads until the modes are those it requested, and one state more, before it computes its first command."""
CATCH_UP = 0.02
"""Delay that a paced lock-step clock makes up for afterwards [s]."""


class Phase(Enum):
    """What the robot waits for."""

    IDLE = "no motion"
    STARTING = "no command of this motion has come yet"
    AWAITING = "the command for the last state has not come"
    ARRIVED = "the command for the last state has come"


class Clock(ABC):
    """Says how long to wait before the next cycle."""

    @abstractmethod
    def left(self, now: float, phase: Phase) -> float:
        """Time to wait before the next cycle [s]; not above 0: now. now: time.monotonic [s]."""

    @abstractmethod
    def ticked(self, now: float, phase: Phase) -> None:
        """A cycle begins now."""


class WallClock(Clock):
    """One state per period, whatever the client does. Its own delays make no burst of states: robot time does not
    advance meanwhile.

    Args:
        real_time_factor: robot time per wall time, above 0.
    """

    def __init__(self, real_time_factor: float = 1.0) -> None:
        factor = number(above=0.0).checked(real_time_factor, "the real-time factor of the wall clock")
        self._period, self._next = PERIOD / factor, 0.0

    def left(self, now: float, phase: Phase) -> float:
        """To the next deadline."""
        return self._next - now

    def ticked(self, now: float, phase: Phase) -> None:
        """Next deadline."""
        self._next = self._next + self._period if now < self._next + 0.5 * self._period else now + self._period


class LockStepClock(Clock):
    """In a motion, each state waits for the command for the one before; what does not come within PATIENCE, or
    within TIME_OUT after one that was lost, counts as lost.

    Args:
        real_time_factor: robot time per wall time at most; 0: as fast as the client sends (at idle: real time).
        lossy: on a network that loses datagrams, where TIME_OUT holds for all.
    """

    def __init__(self, real_time_factor: float = 1.0, lossy: bool = False) -> None:
        factor = number(minimum=0.0).checked(real_time_factor, "the real-time factor of the lock-step clock")
        self._paced, self._period = factor > 0.0, PERIOD / (factor or 1.0)
        self._last = self._next = 0.0
        self._starting = 0
        self._lossy, self._lost = lossy, False

    def left(self, now: float, phase: Phase) -> float:
        """To the command, or to the deadline of the paced clock."""
        if phase is Phase.AWAITING:
            return self._last + (TIME_OUT if self._lossy or self._lost else PATIENCE) - now
        if phase is Phase.STARTING and self._starting >= STATES_BEFORE_FIRST:
            wait = FIRST_WAIT * 2.0 ** min(self._starting - STATES_BEFORE_FIRST, 8)
            return self._last + min(wait, PATIENCE) - now
        if phase is Phase.ARRIVED and not self._paced:
            return 0.0
        return self._next - now

    def ticked(self, now: float, phase: Phase) -> None:
        """Next deadline."""
        self._starting = self._starting + 1 if phase is Phase.STARTING else 0
        self._lost = phase is Phase.AWAITING
        self._last = now
        self._next = max(self._next + self._period, now - CATCH_UP) if self._paced else now + self._period


def make_clock(name: str, real_time_factor: float, lossy: bool = False) -> Clock:
    """The clock "lock_step" (on a network that loses datagrams if `lossy`) or "wall". Raises UnknownNameError,
    ParameterError."""
    if name == "lock_step":
        return LockStepClock(real_time_factor, lossy)
    if name == "wall":
        return WallClock(real_time_factor)
    raise UnknownNameError("clock", name, ("lock_step", "wall"))
