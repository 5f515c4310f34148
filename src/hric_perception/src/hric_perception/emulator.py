"""Sends what an emulated sensor measures, in the time of the run, from a thread of its own. No ROS."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from hric_perception.chunk import FloatArray
from hric_perception.emulation import EvenSensor
from mocap_natnet.server.stream_time import Clock

NS = 1e-9
PERIOD = 0.01
"""Between sendings [s of wall time] (our choice)."""


class Outlet(Protocol):
    """Where the samples go."""

    def push(self, times: FloatArray, data: FloatArray) -> None:
        """Send: monotonic times, shape (n,) [s]; data, shape (n, channels)."""

    def close(self) -> None:
        """No more."""


class Emulator:
    """Runs from `start` to `close`.

    Args:
        sensor: what is sampled.
        outlet: where it goes.
        clock: by which it goes: a `RunTime`, or a wall clock.
        period: between sendings [s of wall time].
        on_error: told once why the sending ended, if it did.
        on_sent: told after each sending (number of the next sample, samples sent so far, run time of the last one [s]).
    """

    def __init__(
        self,
        sensor: EvenSensor,
        outlet: Outlet,
        clock: Clock,
        period: float = PERIOD,
        on_error: Callable[[str], None] = lambda text: None,
        on_sent: Callable[[int, int, float], None] = lambda following, sent, last: None,
    ) -> None:
        self._sensor, self._outlet, self._clock, self._period, self._on_error = sensor, outlet, clock, period, on_error
        self._on_sent = on_sent
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="emulated sensor", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End."""
        self._stop.set()
        self._thread.join(2.0)
        self._outlet.close()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.wait(max(0.0, due - time.monotonic())):
            due = max(due + self._period, time.monotonic())
            now = self._clock.now()
            if now is None:
                continue
            try:
                self._send(now)
            except OSError as error:
                self._on_error(str(error))
                return

    def _send(self, now: float) -> None:
        for samples in self._sensor.due(now):
            first, last = (self._clock.monotonic(float(samples.times[index])) for index in (0, -1))
            if first is not None and last is not None:
                self._outlet.push(np.linspace(first * NS, last * NS, len(samples.times)), samples.data)
        sensor = self._sensor
        self._on_sent(sensor.following, sensor.sent, (sensor.following - 1) / sensor.rate)
