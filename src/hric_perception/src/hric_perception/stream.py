"""Conversion of a driver's samples to chunks in robot time, and the health of the stream. No ROS."""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hric_core.parameters import number
from hric_perception.chunk import Chunk, FloatArray, Layout, Merger
from hric_perception.sample_clock import SampleClock

OK, WARN, ERROR = 0, 1, 2
"""Levels as in diagnostic_msgs/DiagnosticStatus."""
SILENT = 0.5
"""Time after which a stream without samples is silent [s]. Constants here are project defaults, unconfirmed."""
START = 10.0
"""Startup time in which a source without samples is no error [s of wall time]; project default, unconfirmed."""
MEMORY = 5.0
"""Time for which a past event is reported in diagnostics [s]."""
RATE_SPAN = 2.0
"""Time span from which the sample rate is computed [s of wall time]."""
RATE_TOLERANCE = 0.02
"""Largest relative difference between measured and declared sample rate [1]."""
CHUNK: Any = number(0.01, minimum=0.0, maximum=1.0, unit="s", name="chunk", text="duration of a message")
NS = 1_000_000_000
BREAK = 1.5
"""Smallest deviation of a time step from the median step that is a gap, in median steps.

Project default, unconfirmed.
"""


class StreamReport(NamedTuple):
    """Health report of a stream for diagnostics: level, text, and values by name."""

    level: int
    text: str
    values: dict[str, str]


class StreamHealth:
    """Health of a sample stream: counts, rate and events; written by a driver's thread, read by another one.

    Args:
        expected: awaited stream, e.g. "lsl stream of type EMG".

    Attributes:
        samples, lost, not_finite, jumps, begun: numbers so far of samples received, samples lost, values that are not
            finite, clock resets, and starts of the stream.
    """

    def __init__(self, expected: str) -> None:
        self.samples = self.lost = self.not_finite = self.jumps = self.begun = 0
        self._layout: Layout | None = None
        self._trouble = f"waiting for {expected}"
        self._last, self._made = -1.0, time.monotonic()
        self._events: deque[tuple[float, str]] = deque(maxlen=20)
        self._arrived: deque[tuple[float, int]] = deque()

    def began(self, layout: Layout) -> None:
        """Note that a stream with a layout has begun."""
        before, self._layout, self._trouble = self._layout, layout, ""
        self.begun += 1
        self._last = time.monotonic()
        self._arrived.clear()
        if before is not None:
            self.event("the source restarted")
        if before is not None and before.rate != layout.rate:
            self.event(f"the rate changed from {before.rate:g} to {layout.rate:g} Hz")
        if before is not None and before.channels != layout.channels:
            self.event(f"the channels changed to {', '.join(layout.channels)}")

    def trouble(self, text: str) -> None:
        """Note why the stream is not available; valid until `began`."""
        self._trouble = text

    def event(self, text: str) -> None:
        """Note an event, which the next reports include."""
        self._events.append((time.monotonic(), text))

    def took(self, data: FloatArray, lost: int = 0, jumps: int = 0) -> None:
        """Count received samples, shape (samples, channels). lost, jumps: counts of this block."""
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
            self._event_once(f"values not finite: {', '.join(names)}")
        if lost:
            self.lost += lost
            self.event(f"{lost} samples lost")
        if jumps:
            self.jumps += jumps
            self.event("a clock jumped: that of the source, or robot time")

    def untimed(self) -> None:
        """Note that samples arrive while robot time is not known, so that they are dropped."""
        self._last = time.monotonic()
        self._event_once("samples arrive and are dropped: robot time is not known yet")

    def report(self, standing: bool = False) -> StreamReport:
        """Return the health report; standing: True if the run is paused, and with it emulated sources."""
        now = time.monotonic()
        values = {
            "samples": str(self.samples),
            "lost": str(self.lost),
            "not finite": str(self.not_finite),
            "clock jumps": str(self.jumps),
            "starts": str(self.begun),
            "rate [Hz]": f"{self._rate(now):.0f}",
        }
        recent = list(dict.fromkeys(text for at, text in list(self._events) if at > now - MEMORY))
        if self._trouble or self._layout is None:
            starts = not self.begun and now - self._made < START
            return StreamReport(WARN if starts else ERROR, "; ".join([self._trouble, *recent]), values)
        if now - self._last > SILENT:
            if standing:
                return StreamReport(WARN, "the run is paused or has not begun; no samples", values)
            return StreamReport(ERROR, f"{self._layout.source} has been silent for {now - self._last:.1f} s", values)
        if recent:
            return StreamReport(WARN, "; ".join(recent), values)
        return StreamReport(
            OK, f"{self._layout.source}: {len(self._layout.channels)} channels at {self._layout.rate:g} Hz", values
        )

    def _rate(self, now: float) -> float:
        """Return the samples per second of wall time; 0 if there are too few."""
        arrived = list(self._arrived)
        span = now - arrived[0][0] if arrived else 0.0
        return sum(count for _, count in arrived[1:]) / span if span > 0 else 0.0

    def _event_once(self, text: str) -> None:
        if not self._events or self._events[-1][1] != text:
            self.event(text)
        else:
            self._events[-1] = (time.monotonic(), text)


class Driver:
    """Thread that reads a device from `start` to `close`; a subclass overrides `_run`.

    Args:
        name: name of the thread.
        timeout: how long `close` waits for the thread [s].
    """

    def __init__(self, name: str, timeout: float = 2.0) -> None:
        self._stop, self._timeout = threading.Event(), timeout
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stop the thread."""
        self._stop.set()
        self._thread.join(self._timeout)

    def _run(self) -> None:
        """Read until `_stop` is set."""
        raise NotImplementedError


class SampleStream:
    """Converter of samples to chunks in robot time; called from one thread.

    Args:
        robot_time: function from monotonic time [ns] to robot time [s]; None while that is not known.
        health: health of the stream.
        on_chunk: callback for the chunks.
        duration: duration of a chunk [s].

    Attributes:
        untimed: number of samples that arrived before robot time was known.
        duration: duration of a chunk [s].
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
        """Begin a new stream; latency: minimum time from sample to arrival [s]; None: samples have stamps."""
        self._merger.flush()
        self._clock = SampleClock(layout, self._at, latency)
        self._health.began(layout)

    def stamped(self, times: FloatArray, data: FloatArray) -> None:
        """Process samples with a stamp each.

        Args:
            times: stamps by the monotonic clock, shape (samples,) [s].
            data: values, shape (samples, channels).
        """
        steps = np.diff(times)
        begins = [0]
        if len(steps):
            usual = float(np.median(steps))
            begins += (np.flatnonzero(np.abs(steps - usual) > BREAK * max(usual, 0.0)) + 1).tolist()
        for begin, end in zip(begins, [*begins[1:], len(data)], strict=True):
            self.arrived(float(times[end - 1]), data[begin:end])

    def arrived(self, time: float, data: FloatArray, missing: int | None = None) -> None:
        """Process consecutive samples without a gap between them.

        Args:
            time: stamp or arrival time of the last sample, by the monotonic clock [s].
            data: values, shape (samples, channels).
            missing: number of samples missing before them; None: the source has no sequence numbers.
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
        """End the stream, and pass on the samples that were held back."""
        if self._clock is not None:
            for chunk in self._clock.flush():
                self._merger.add(chunk)
        self._merger.flush()
        self._clock = None

    def _at(self, monotonic: float) -> float | None:
        """Return the robot time [s] at a monotonic time [s]; None while it is not known."""
        return self._robot_time(round(monotonic * NS))
