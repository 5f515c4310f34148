"""From what a driver receives to chunks in the time of the run. No ROS."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hric_perception.chunk import Chunk, FloatArray, Layout, Merger
from hric_perception.health import StreamHealth
from hric_perception.sample_clock import SampleClock

NS = 1_000_000_000
BREAK = 1.5
"""Stamps that differ by so many sample periods more than the others have a gap between them (our choice)."""


class SampleStream:
    """One thread calls it.

    Args:
        run_time: monotonic time [ns] -> time of the run [s], None while that is not known.
        health: is told.
        on_chunk: gets the chunks.
        duration: of a chunk [s].

    Attributes:
        untimed: samples that came before the time of the run was known.
        duration: as given.
    """

    def __init__(
        self, run_time: Callable[[int], float | None], health: StreamHealth, on_chunk: Callable[[Chunk], None], duration: float = 0.01
    ) -> None:
        self._run_time, self._health, self.duration = run_time, health, duration
        self._merger = Merger(duration, on_chunk)
        self._clock: SampleClock | None = None
        self.untimed = 0

    def begin(self, layout: Layout, latency: float | None = None) -> None:
        """Another stream. latency: where times are arrivals, see SampleClock."""
        self._merger.flush()
        self._clock = SampleClock(layout, self._at, latency)
        self._health.began(layout)

    def stamped(self, times: FloatArray, data: FloatArray) -> None:
        """Samples with a stamp each.

        Args:
            times: monotonic clock, shape (samples,) [s].
            data: shape (samples, channels).
        """
        steps = np.diff(times)
        begins = [0]
        if len(steps):
            usual = float(np.median(steps))
            begins += (np.flatnonzero(np.abs(steps - usual) > BREAK * max(usual, 0.0)) + 1).tolist()
        for begin, end in zip(begins, [*begins[1:], len(data)], strict=True):
            self.arrived(float(times[end - 1]), data[begin:end])

    def arrived(self, time: float, data: FloatArray, missing: int | None = None) -> None:
        """Samples without gap.

        Args:
            time: when the last one was stamped or arrived, monotonic clock [s].
            data: shape (samples, channels).
            missing: before them, where the source has numbers of its own.
        """
        clock = self._clock
        if clock is None or not len(data):
            return
        if self._at(time) is None:
            self.untimed += len(data)
            self._health.untimed()
            return
        lost, jumps = clock.lost, clock.jumps
        placed = clock.add(time, data, missing)
        self._health.took(data, clock.lost - lost, clock.jumps - jumps)
        for chunk in placed:
            self._merger.add(chunk)

    def end(self) -> None:
        """The stream is over."""
        if self._clock is not None:
            for chunk in self._clock.flush():
                self._merger.add(chunk)
        self._merger.flush()
        self._clock = None

    def _at(self, monotonic: float) -> float | None:
        """[s] -> [s]"""
        return self._run_time(round(monotonic * NS))
