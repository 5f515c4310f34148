"""From what a driver receives to chunks in robot time, and how the stream goes. No ROS."""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hric_control.parameters import number
from hric_perception.chunk import Chunk, FloatArray, Layout, Merger
from hric_perception.sample_clock import SampleClock

OK, WARN, ERROR = 0, 1, 2
"""Levels as in diagnostic_msgs/DiagnosticStatus."""
SILENT = 0.5
"""A stream that says nothing for so long is silent [s]. The constants of this file are project defaults,
unconfirmed."""
START = 10.0
"""While all nodes start, a source of which nothing was received yet is waited for, and is no error [s of wall time];
project default, unconfirmed."""
MEMORY = 5.0
"""So long an event is reported [s]."""
RATE_SPAN = 2.0
"""Of the past from which the rate is computed [s]."""
RATE_TOLERANCE = 0.02
"""Share by which the measured rate may differ from the declared one."""
CHUNK: Any = number(0.01, minimum=0.0, maximum=1.0, unit="s", name="chunk", text="duration of a message")
NS = 1_000_000_000
BREAK = 1.5
"""Stamps that differ by so many sample periods more than the others have a gap between them (project default,
unconfirmed)."""


class Health(NamedTuple):
    """A level, a sentence and figures."""

    level: int
    text: str
    values: dict[str, str]


class StreamHealth:
    """Informed by a driver's thread, read by another one.

    Args:
        expected: what is waited for, e.g. "lsl stream of type EMG".

    Attributes:
        samples, lost, not_finite, jumps, begun: counts since the start.
    """

    def __init__(self, expected: str) -> None:
        self.samples = self.lost = self.not_finite = self.jumps = self.begun = 0
        self._layout: Layout | None = None
        self._trouble = f"waiting for {expected}"
        self._last, self._made = -1.0, time.monotonic()
        self._events: deque[tuple[float, str]] = deque(maxlen=20)
        self._arrived: deque[tuple[float, int]] = deque()

    def began(self, layout: Layout) -> None:
        """A stream is there."""
        before, self._layout, self._trouble = self._layout, layout, ""
        self.begun += 1
        self._last = time.monotonic()
        self._arrived.clear()
        if before is not None:
            self.event("the source began again")
        if before is not None and before.rate != layout.rate:
            self.event(f"the rate changed from {before.rate:g} to {layout.rate:g} Hz")
        if before is not None and before.channels != layout.channels:
            self.event(f"the channels changed to {', '.join(layout.channels)}")

    def trouble(self, text: str) -> None:
        """The stream cannot be had, and why; until `began`."""
        self._trouble = text

    def event(self, text: str) -> None:
        """Something that passed."""
        self._events.append((time.monotonic(), text))

    def took(self, data: FloatArray, lost: int = 0, jumps: int = 0) -> None:
        """Samples came; shape (samples, channels). lost, jumps: with them."""
        now = time.monotonic()
        self._last = now
        self.samples += len(data)
        self._arrived.append((now, len(data)))
        while self._arrived[0][0] < now - RATE_SPAN:
            self._arrived.popleft()
        bad = ~np.isfinite(data)
        if bad.any():
            self.not_finite += int(bad.sum())
            assert self._layout is not None
            names = [self._layout.channels[column] for column in np.flatnonzero(bad.sum(axis=0))]
            self._event_once(f"not finite: {', '.join(names)}")
        if lost:
            self.lost += lost
            self.event(f"{lost} samples lost")
        if jumps:
            self.jumps += jumps
            self.event("a clock was set again")

    def untimed(self) -> None:
        """Samples came whose robot time is not known."""
        self._last = time.monotonic()
        self._event_once("samples come, but the time of the run is not known yet")

    def report(self, standing: bool = False) -> Health:
        """How it goes. standing: the run is paused, and an emulated source with it."""
        now = time.monotonic()
        values = {
            "samples": str(self.samples),
            "lost": str(self.lost),
            "not finite": str(self.not_finite),
            "clock jumps": str(self.jumps),
            "begun": str(self.begun),
            "rate [Hz]": f"{self._rate(now):.0f}",
        }
        recent = list(dict.fromkeys(text for at, text in list(self._events) if at > now - MEMORY))
        if self._trouble or self._layout is None:
            starts = not self.begun and now - self._made < START
            return Health(WARN if starts else ERROR, "; ".join([self._trouble, *recent]), values)
        if now - self._last > SILENT:
            if standing:
                return Health(WARN, "the run is paused or has not begun; no samples", values)
            return Health(ERROR, f"{self._layout.source} has been silent for {now - self._last:.1f} s", values)
        if recent:
            return Health(WARN, "; ".join(recent), values)
        return Health(
            OK, f"{self._layout.source}: {len(self._layout.channels)} channels at {self._layout.rate:g} Hz", values
        )

    def _rate(self, now: float) -> float:
        """Samples per second of wall time; 0 where few came."""
        arrived = list(self._arrived)
        span = now - arrived[0][0] if arrived else 0.0
        return sum(count for _, count in arrived[1:]) / span if span > 0 else 0.0

    def _event_once(self, text: str) -> None:
        if not self._events or self._events[-1][1] != text:
            self.event(text)
        else:
            self._events[-1] = (time.monotonic(), text)


class Driver:
    """Reads a device in a thread of its own, from `start` to `close`; a subclass overrides `_run`.

    Args:
        name: of the thread.
        timeout: how long `close` waits for it [s].
    """

    def __init__(self, name: str, timeout: float = 2.0) -> None:
        self._stop, self._timeout = threading.Event(), timeout
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End."""
        self._stop.set()
        self._thread.join(self._timeout)

    def _run(self) -> None:
        """Read until `_stop` is set."""
        raise NotImplementedError


class SampleStream:
    """One thread calls it.

    Args:
        robot_time: monotonic time [ns] -> time of the run [s], None while that is not known.
        health: is informed of what came.
        on_chunk: gets the chunks.
        duration: of a chunk [s].

    Attributes:
        untimed: samples that came before the time of the run was known.
        duration: as given.
    """

    def __init__(
        self,
        robot_time: Callable[[int], float | None],
        health: StreamHealth,
        on_chunk: Callable[[Chunk], None],
        duration: float = 0.01,
    ) -> None:
        self._robot_time, self._health, self.duration = robot_time, health, duration
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
        return self._robot_time(round(monotonic * NS))
