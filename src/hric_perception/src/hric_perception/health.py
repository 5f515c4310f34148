"""How a stream of samples goes, in one sentence and in figures. No ROS."""

from __future__ import annotations

import time
from collections import deque
from typing import NamedTuple

import numpy as np

from hric_perception.chunk import FloatArray, Layout

OK, WARN, ERROR = 0, 1, 2
"""Levels as in diagnostic_msgs/DiagnosticStatus."""
SILENT = 0.5
"""A stream that says nothing for so long is silent [s]. The constants of this file are our choice."""
MEMORY = 5.0
"""So long an event is told [s]."""
RATE_SPAN = 2.0
"""Of the past that tells the rate [s]."""
RATE_TOLERANCE = 0.02
"""Share by which the measured rate may differ from the declared one."""


class Health(NamedTuple):
    """A level, a sentence and figures."""

    level: int
    text: str
    values: dict[str, str]


class StreamHealth:
    """Told by a driver's thread, asked by another one.

    Args:
        wanted: what is waited for, e.g. "lsl stream of type EMG".

    Attributes:
        samples, lost, not_finite, jumps, begun: counts since the start.
    """

    def __init__(self, wanted: str) -> None:
        self._wanted = wanted
        self.samples = self.lost = self.not_finite = self.jumps = self.begun = 0
        self._layout: Layout | None = None
        self._trouble = f"waiting for {wanted}"
        self._last = -1.0
        self._events: deque[tuple[float, str]] = deque(maxlen=20)
        self._arrived: deque[tuple[float, int]] = deque()

    def began(self, layout: Layout) -> None:
        """A stream is there."""
        before, self._layout, self._trouble = self._layout, layout, ""
        self.begun += 1
        self._last = time.monotonic()
        self._arrived.clear()
        if before is not None:
            self.event("the source began anew")
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
            self._tell_once(f"no number in {', '.join(names)}")
        if lost:
            self.lost += lost
            self.event(f"{lost} samples lost")
        if jumps:
            self.jumps += jumps
            self.event("a clock was set anew")

    def untimed(self) -> None:
        """Samples came which nobody can place in the run."""
        self._last = time.monotonic()
        self._tell_once("samples come, but the time of the run is not known yet")

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
            return Health(ERROR, "; ".join([self._trouble, *recent]), values)
        if now - self._last > SILENT:
            if standing:
                return Health(WARN, "the run is paused or has not begun; no samples", values)
            return Health(ERROR, f"{self._layout.source} has been silent for {now - self._last:.1f} s", values)
        if recent:
            return Health(WARN, "; ".join(recent), values)
        return Health(OK, f"{self._layout.source}: {len(self._layout.channels)} channels at {self._layout.rate:g} Hz", values)

    def _rate(self, now: float) -> float:
        """Samples per second of wall time; 0 where few came."""
        arrived = list(self._arrived)
        span = now - arrived[0][0] if arrived else 0.0
        return sum(count for _, count in arrived[1:]) / span if span > 0 else 0.0

    def _tell_once(self, text: str) -> None:
        if not self._events or self._events[-1][1] != text:
            self.event(text)
        else:
            self._events[-1] = (time.monotonic(), text)
