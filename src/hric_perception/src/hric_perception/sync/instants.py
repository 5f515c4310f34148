"""Time of the synchroniser: which stamps belong to the current run, and which instants are due. No ROS."""

from enum import Enum
from fractions import Fraction

import numpy as np

from hric_perception.sync.buffer import NS, StampBuffer, Stamps

AGREE = NS
"""Largest difference of a stamp from the newest one with which both belong to the same run and clock [ns].

Project default, unconfirmed; it is larger than the delay of any sensor.
"""
SILENCE = 0.5
"""Time without a stamp of the current run, after which any stamp begins a new one [s of wall time].

Project default, unconfirmed.
"""
STILL = 0.1
"""Longest time that `BusyClock` counts while all sources are silent [s of wall time] (project default, unconfirmed).

It is shorter than a time-out, so that no source starves in a paused run.
"""
MAX_INSTANTS = 1000
"""Largest number of instants returned at once (project default, unconfirmed).

The others follow with the next call, so that messages are received in between.
"""


class StampRelation(Enum):
    """Relation of a stamp to the current run: of the same run, of a foreign clock, or of a restarted run."""

    SAME = "same"
    FOREIGN = "foreign"
    RESTARTED = "again"


class CommonTime:
    """Common time of all sources, which follows the newest stamp; a source whose clock jumped affects no other.

    If all sources jump, as in a restarted run, the common time jumps, too: while any stamps continue the current time,
    these have precedence; after SILENCE without any, the next stamp sets the time.
    """

    def __init__(self) -> None:
        self.newest: int | None = None
        self._last = 0.0

    def see(self, stamps: Stamps, arrived: float) -> StampRelation:
        """Classify stamps that arrived together, and advance to the last of them unless they are foreign.

        Args:
            stamps: stamps in the order of arrival, shape (n,) [ns].
            arrived: arrival time by a monotonic clock [s].
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
        """Return True if stamps lead from the current time to the last one without a jump.

        Samples that are received late, after a pause of the process, thus still belong to the same run.
        """
        if abs(int(stamps[-1]) - newest) <= AGREE:
            return True
        jumps = np.flatnonzero(np.abs(np.diff(stamps)) > AGREE)
        begin = int(stamps[jumps[-1] + 1 if len(jumps) else 0])
        return begin - AGREE <= newest <= int(stamps[-1])


class BusyClock:
    """Clock that runs only while any source sends, so that in a paused run no source times out."""

    def __init__(self, now: float) -> None:
        self._busy, self._last = 0.0, now

    def at(self, now: float) -> float:
        """Return this clock's time [s]; now: time of a monotonic clock [s]."""
        return self._busy + min(now - self._last, STILL)

    def received(self, now: float) -> None:
        """Note that a message of any source arrived; now: time of a monotonic clock [s]."""
        self._busy, self._last = self.at(now), now


class Ticks:
    """Instants at integer multiples of a period from robot time 0; those of 100 Hz are among those of 1 kHz.

    Args:
        rate: rate of the instants [Hz].
    """

    def __init__(self, rate: float) -> None:
        period = NS / Fraction(rate).limit_denominator(1_000_000)
        self._period: Fraction | int = int(period) if period.denominator == 1 else period
        self._next: int | None = None

    def begin(self, stamp: int) -> None:
        """Set the first instant to the first tick at or after `stamp` [ns]; before, there are no instants."""
        self._next = -int(-stamp // self._period)

    @property
    def begun(self) -> bool:
        """True if there is a first instant."""
        return self._next is not None

    def restart(self) -> None:
        """Forget the last instant, because robot time restarts."""
        self._next = None

    def due(self, limit: int) -> Stamps:
        """Return the instants after the last one returned, up to `limit` [ns], at most `MAX_INSTANTS`."""
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
    """Instants at the stamps of the reference source.

    Args:
        buffer: samples of the reference source.
    """

    def __init__(self, buffer: StampBuffer) -> None:
        self._buffer = buffer
        self._last: int | None = None

    def restart(self) -> None:
        """Forget the last instant, because robot time restarts."""
        self._last = None

    def due(self, limit: int) -> Stamps:
        """Return the stamps after the last one returned, up to `limit` [ns], at most `MAX_INSTANTS`."""
        stamps = self._buffer.stamps
        begin = 0 if self._last is None else int(np.searchsorted(stamps, self._last, side="right"))
        end = min(int(np.searchsorted(stamps, limit, side="right")), begin + MAX_INSTANTS)
        due_stamps = stamps[begin:end].copy()
        if len(due_stamps):
            self._last = int(due_stamps[-1])
        return due_stamps
