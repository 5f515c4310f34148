"""The time of the synchroniser: which stamps belong to the run, and at which instants a sample goes out, as far as they
are due. No ROS."""

from enum import Enum
from fractions import Fraction

import numpy as np

from hric_perception.sync.buffer import StampBuffer, Stamps

NS = 1_000_000_000
AGREE = NS
"""Stamps within this of the newest one are of the same time [ns] (project default, unconfirmed; no sensor is as
late)."""
SILENCE = 0.5
"""Where nothing of the time so far came for as long, the next stamp begins another one [s of wall time] (project
default, unconfirmed)."""
STILL = 0.1
"""A silence of all sources counts as this long at most [s of wall time]; a time-out is longer (project default,
unconfirmed)."""
MAX_INSTANTS = 1000
"""Instants handed out at once (project default, unconfirmed): what remains comes with the next call, and messages are
received in between."""


class Verdict(Enum):
    """What a stamp is to the time so far."""

    SAME = "same"
    FOREIGN = "foreign"
    RESTARTED = "again"


class CommonTime:
    """Follows the newest stamp; a source whose clock jumped does not take the others with it.

    A jump of all of them, as when a run begins again, is followed: the sources whose stamps continue the time so far
    win, and where none is left, the first one to come sets the time.
    """

    def __init__(self) -> None:
        self.newest: int | None = None
        self._last = 0.0

    def see(self, stamps: Stamps, arrived: float) -> Verdict:
        """Judge stamps that came together, and go on to the last of them unless they are foreign.

        Args:
            stamps: in the order of their coming, shape (n,) [ns].
            arrived: by a clock that does not jump [s].
        """
        last = int(stamps[-1])
        if self.newest is None or self._reached(stamps, self.newest):
            self.newest = last if self.newest is None else max(self.newest, last)
            self._last = arrived
            return Verdict.SAME
        if arrived - self._last <= SILENCE:
            return Verdict.FOREIGN
        self.newest, self._last = last, arrived
        return Verdict.RESTARTED

    @staticmethod
    def _reached(stamps: Stamps, newest: int) -> bool:
        """Whether the time so far leads to the last stamp without a jump: what a process
        receives after a pause of seconds is still of the same time."""
        if abs(int(stamps[-1]) - newest) <= AGREE:
            return True
        jumps = np.flatnonzero(np.abs(np.diff(stamps)) > AGREE)
        begin = int(stamps[jumps[-1] + 1 if len(jumps) else 0])
        return begin - AGREE <= newest <= int(stamps[-1])


class BusyClock:
    """The time during which anything was received at all: where the run is paused, no source has to wait for
    another."""

    def __init__(self, now: float) -> None:
        self._busy, self._last = 0.0, now

    def at(self, now: float) -> float:
        """The time [s], at `now` of a clock that does not jump [s]."""
        return self._busy + min(now - self._last, STILL)

    def received(self, now: float) -> None:
        """Something came."""
        self._busy, self._last = self.at(now), now


class Ticks:
    """Whole multiples of a period, counted from robot time 0: the ticks of 100 Hz are among those of 1 kHz.

    Args:
        rate: [Hz].
    """

    def __init__(self, rate: float) -> None:
        period = NS / Fraction(rate).limit_denominator(1_000_000)
        self._period: Fraction | int = int(period) if period.denominator == 1 else period
        self._next: int | None = None

    def begin(self, stamp: int) -> None:
        """The first instant is the first tick from here on [ns]; without it there is none."""
        self._next = -int(-stamp // self._period)

    @property
    def begun(self) -> bool:
        """Whether there is a first instant."""
        return self._next is not None

    def restart(self) -> None:
        """Another time begins."""
        self._next = None

    def due(self, limit: int) -> Stamps:
        """The ticks after the last one handed out up to limit [ns], `MAX_INSTANTS` at most."""
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
    """The stamps of a source.

    Args:
        buffer: its samples.
    """

    def __init__(self, buffer: StampBuffer) -> None:
        self._buffer = buffer
        self._last: int | None = None

    def restart(self) -> None:
        """Another time begins."""
        self._last = None

    def due(self, limit: int) -> Stamps:
        """The stamps after the last one handed out up to limit [ns], `MAX_INSTANTS` at most."""
        stamps = self._buffer.stamps
        begin = 0 if self._last is None else int(np.searchsorted(stamps, self._last, side="right"))
        end = min(int(np.searchsorted(stamps, limit, side="right")), begin + MAX_INSTANTS)
        found = stamps[begin:end].copy()
        if len(found):
            self._last = int(found[-1])
        return found
