"""Time of the synchroniser: stamps that belong to the run, and instants that are due. No ROS."""

from enum import Enum
from fractions import Fraction

import numpy as np

from hric_perception.sync.buffer import NS, StampBuffer, Stamps

AGREE = NS
"""Largest difference of stamps from the newest one of the same time [ns].

Project default, unconfirmed; no sensor has such a delay.
"""
SILENCE = 0.5
"""Silence after which the next stamp begins another time [s of wall time] (project default, unconfirmed)."""
STILL = 0.1
"""Largest duration that a silence of all sources counts [s of wall time] (project default, unconfirmed).

A time-out is longer.
"""
MAX_INSTANTS = 1000
"""Largest number of instants returned at once (project default, unconfirmed).

The rest follows with the next call, and messages are received in between.
"""


class StampRelation(Enum):
    """Relation of a stamp to the current time."""

    SAME = "same"
    FOREIGN = "foreign"
    RESTARTED = "again"


class CommonTime:
    """Common time, which follows the newest stamp; a source whose clock jumped does not affect the others.

    A jump of all sources, as in a restarted run, is followed: sources whose stamps continue the current time have
    precedence, and without any, the first source to arrive sets the time.
    """

    def __init__(self) -> None:
        self.newest: int | None = None
        self._last = 0.0

    def see(self, stamps: Stamps, arrived: float) -> StampRelation:
        """Judge stamps that arrived together, and advance to the last of them unless they are foreign.

        Args:
            stamps: in the order of arrival, shape (n,) [ns].
            arrived: arrival by a monotonic clock [s].
        """
        last = int(stamps[-1])
        if self.newest is None or self._reached(stamps, self.newest):
            self.newest = last if self.newest is None else max(self.newest, last)
            self._last = arrived
            return StampRelation.SAME
        if arrived - self._last <= SILENCE:
            return StampRelation.FOREIGN
        self.newest, self._last = last, arrived
        return StampRelation.RESTARTED

    @staticmethod
    def _reached(stamps: Stamps, newest: int) -> bool:
        """Return True if the current time leads to the last stamp without a jump.

        Samples that a process receives after a pause of seconds are still of the same time.
        """
        if abs(int(stamps[-1]) - newest) <= AGREE:
            return True
        jumps = np.flatnonzero(np.abs(np.diff(stamps)) > AGREE)
        begin = int(stamps[jumps[-1] + 1 if len(jumps) else 0])
        return begin - AGREE <= newest <= int(stamps[-1])


class BusyClock:
    """Clock of the time during which anything was received: in a paused run no source has to wait for another."""

    def __init__(self, now: float) -> None:
        self._busy, self._last = 0.0, now

    def at(self, now: float) -> float:
        """Return the busy time [s] at `now` of a monotonic clock [s]."""
        return self._busy + min(now - self._last, STILL)

    def received(self, now: float) -> None:
        """Note that something was received."""
        self._busy, self._last = self.at(now), now


class Ticks:
    """Integer multiples of a period, counted from robot time 0: the ticks of 100 Hz are among those of 1 kHz.

    Args:
        rate: rate of the ticks [Hz].
    """

    def __init__(self, rate: float) -> None:
        period = NS / Fraction(rate).limit_denominator(1_000_000)
        self._period: Fraction | int = int(period) if period.denominator == 1 else period
        self._next: int | None = None

    def begin(self, stamp: int) -> None:
        """Set the first instant to the first tick from here on [ns]; without it there is none."""
        self._next = -int(-stamp // self._period)

    @property
    def begun(self) -> bool:
        """True if there is a first instant."""
        return self._next is not None

    def restart(self) -> None:
        """Restart with another time."""
        self._next = None

    def due(self, limit: int) -> Stamps:
        """Return the ticks after the last one returned up to limit [ns], at most `MAX_INSTANTS`."""
        if self._next is None:
            return np.zeros(0, np.int64)
        last = min(int(limit // self._period), self._next + MAX_INSTANTS - 1)
        if isinstance(self._period, int):
            ticks = np.arange(self._next, last + 1, dtype=np.int64) * self._period
        else:
            ticks = np.array([round(tick * self._period) for tick in range(self._next, last + 1)], np.int64)
        self._next = max(self._next, last + 1)
        return ticks


class ReferenceStamps:
    """Instants at the stamps of a source.

    Args:
        buffer: samples of the source.
    """

    def __init__(self, buffer: StampBuffer) -> None:
        self._buffer = buffer
        self._last: int | None = None

    def restart(self) -> None:
        """Restart with another time."""
        self._last = None

    def due(self, limit: int) -> Stamps:
        """Return the stamps after the last one returned up to limit [ns], at most `MAX_INSTANTS`."""
        stamps = self._buffer.stamps
        begin = 0 if self._last is None else int(np.searchsorted(stamps, self._last, side="right"))
        end = min(int(np.searchsorted(stamps, limit, side="right")), begin + MAX_INSTANTS)
        due_stamps = stamps[begin:end].copy()
        if len(due_stamps):
            self._last = int(due_stamps[-1])
        return due_stamps
