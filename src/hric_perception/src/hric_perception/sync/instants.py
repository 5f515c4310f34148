"""At which instants a synchronised sample goes out, as far as they are due. No ROS."""

from __future__ import annotations

from fractions import Fraction
from typing import Protocol

import numpy as np

from hric_perception.sync.buffer import StampBuffer, Stamps

NS = 1_000_000_000
MOST = 1000
"""Instants handed out at once (our choice): what remains comes with the next call, and messages are heard in between."""


class Instants(Protocol):
    """A series of instants."""

    def due(self, limit: int) -> Stamps:
        """The instants from the last one handed out up to limit [ns], `MOST` at most."""

    def restart(self) -> None:
        """Another time begins."""


class Ticks:
    """Whole multiples of a period, counted from run time 0: the ticks of 100 Hz are among those of 1 kHz.

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
        """The ticks that are due."""
        if self._next is None:
            return np.zeros(0, np.int64)
        last = min(int(limit // self._period), self._next + MOST - 1)
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
        """The stamps that are due."""
        stamps = self._buffer.stamps
        begin = 0 if self._last is None else int(np.searchsorted(stamps, self._last, side="right"))
        end = min(int(np.searchsorted(stamps, limit, side="right")), begin + MOST)
        found = stamps[begin:end].copy()
        if len(found):
            self._last = int(found[-1])
        return found
