"""Which stamps belong to the run: the time that the sources agree on. No ROS."""

from __future__ import annotations

from enum import Enum

import numpy as np

from hric_perception.sync.buffer import Stamps

NS = 1_000_000_000
AGREE = NS
"""Stamps within this of the newest one are of the same time [ns] (our choice; no sensor is as late)."""
SILENCE = 0.5
"""Where nothing of the time so far came for as long, the next stamp begins another one [s of wall time] (our choice)."""


class Verdict(Enum):
    """What a stamp is to the time so far."""

    SAME = "same"
    FOREIGN = "foreign"
    ANEW = "anew"


class CommonTime:
    """Follows the newest stamp; a source whose clock jumped does not take the others with it.

    A jump of all of them, as when a run begins anew, is followed: the sources that still keep to the time so far win, and where none is left, the
    first one to come sets the time.
    """

    def __init__(self) -> None:
        self.newest: int | None = None
        self._heard = 0.0

    def see(self, stamps: Stamps, arrived: float) -> Verdict:
        """Judge stamps that came together, and go on to the last of them unless they are foreign.

        Args:
            stamps: in the order of their coming, shape (n,) [ns].
            arrived: by a clock that does not jump [s].
        """
        last = int(stamps[-1])
        if self.newest is None or self._reached(stamps, self.newest):
            self.newest = last if self.newest is None else max(self.newest, last)
            self._heard = arrived
            return Verdict.SAME
        if arrived - self._heard <= SILENCE:
            return Verdict.FOREIGN
        self.newest, self._heard = last, arrived
        return Verdict.ANEW

    @staticmethod
    def _reached(stamps: Stamps, newest: int) -> bool:
        """Whether the time so far leads to the last stamp without a jump: what a process hears that stood for seconds is still of the same time."""
        if abs(int(stamps[-1]) - newest) <= AGREE:
            return True
        jumps = np.flatnonzero(np.abs(np.diff(stamps)) > AGREE)
        begin = int(stamps[jumps[-1] + 1 if len(jumps) else 0])
        return begin - AGREE <= newest <= int(stamps[-1])


STILL = 0.1
"""A silence of all sources counts as this long at most [s of wall time]; a time-out is longer (our choice)."""


class BusyClock:
    """Tells the time for which anything was heard at all: where the run is paused, no source has to wait for another."""

    def __init__(self, now: float) -> None:
        self._busy, self._heard = 0.0, now

    def at(self, now: float) -> float:
        """The time [s], at `now` of a clock that does not jump [s]."""
        return self._busy + min(now - self._heard, STILL)

    def hear(self, now: float) -> None:
        """Something came."""
        self._busy, self._heard = self.at(now), now
