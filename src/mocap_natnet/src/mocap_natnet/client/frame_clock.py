"""Exposure time of a frame by the monotonic clock of this machine.

The clocks of server and client differ by tens of parts per million. Their relation is a line, fitted to echoes, which
are requests that the server returns with its own time (Cristian 1989). Each echo moves the line a little, and on a busy
machine by milliseconds: a `RisingLine` follows it, so that exposures in order get times in order.
"""

import math
from collections import deque

from hric_core.robot_time.rising_line import Line, RisingLine, fit_line
from mocap_natnet.codec.types import Frame

WINDOW = 30.0
"""Age beyond which clock echoes are discarded [s]."""
ROUND_TRIP_SPREAD = 50e-6
"""Largest excess of an echo's round trip over the shortest one with which it is used [s]; others are less exact."""
SLOPE_SPAN = 2.0
"""Time span of echoes from which on clock drift is fitted [s] (project default, unconfirmed)."""
MAX_DRIFT = 500e-6
"""Largest relative difference in rate of two quartz clocks [1] (project default, unconfirmed)."""
RESTART_ERROR = 5e-3
"""Error of an echo, beyond its own and the shortest round trip, that shows that the server's clock changed [s]."""
RESTART_ECHOES = 3
"""Number of consecutive echoes or delays off the fit that restart it (project default, unconfirmed)."""
MINIMUM_WINDOW = 10.0
"""Time window of the running minimum of the frames' delays [s]."""
FAR = 1.0
"""Largest valid difference of a delay from the running minimum [s] (project default, unconfirmed)."""
NS = 1_000_000_000
LATEST, CLOCK_ERROR = 10 * NS, NS // 100
"""Largest age and largest lead of a valid exposure time, compared with the arrival [ns].

The age exceeds that of frames that wait while this machine stalls. Project default, unconfirmed.
"""


class EchoClock:
    """Map from ticks of the server's clock to the local monotonic clock, fitted to echoes.

    Args:
        frequency: ticks per second of the server's clock [Hz].

    Attributes:
        round_trip: shortest round trip of the echoes in the window [s]; None before the first echo.
        restarts: number of times that the server's clock changed.
    """

    def __init__(self, frequency: float) -> None:
        self._frequency = frequency
        self.restarts = 0
        self._clear()

    def _clear(self) -> None:
        self._echoes: deque[tuple[float, float, float]] = (
            deque()
        )  # server time and offset, relative to the first echo, and round trip [s]
        self._origin: tuple[int, int] | None = None  # local time [ns] and ticks of the server
        self._offset = self._slope = 0.0
        self._map: RisingLine | None = None
        self._misses = 0
        self.round_trip: float | None = None

    @property
    def synchronised(self) -> bool:
        """True if the server has returned an echo, so that its clock is known."""
        return self._origin is not None

    @property
    def drift(self) -> float:
        """Drift of the server's clock: how much faster it runs [parts per million]."""
        return -1e6 * self._slope

    def add(self, sent: int, received: int, ticks: int) -> None:
        """Add an echo.

        Args:
            sent: local time at which the request was sent [ns].
            received: local time at which the response arrived [ns].
            ticks: ticks of the server's clock in the response.
        """
        if received < sent:
            return
        if self._origin is None:
            self._origin = ((sent + received) // 2, ticks)
        server = (ticks - self._origin[1]) / self._frequency
        offset = ((sent + received) / 2 - self._origin[0]) / NS - server
        round_trip = (received - sent) / NS
        if self._echoes and abs(offset - self._line(server)) > round_trip + (self.round_trip or 0.0) + RESTART_ERROR:
            self._misses += 1
            if self._misses < RESTART_ECHOES:
                return
            self._clear()
            self.restarts += 1
            self.add(sent, received, ticks)
            return
        self._misses = 0
        self._echoes.append((server, offset, round_trip))
        while self._echoes[0][0] < server - WINDOW:
            self._echoes.popleft()
        self._fit()

    def local(self, ticks: int) -> int | None:
        """Return the local time at which the server's clock showed `ticks` [ns]; None before the first echo."""
        if self._origin is None or self._map is None:
            return None
        return self._origin[0] + round(self._map.at(ticks) * NS)

    def settle(self, ticks: int) -> None:
        """Fix the results of `local` up to these ticks, so that later ticks get later times in spite of new echoes."""
        if self._map is not None:
            self._map.settle(ticks)

    def _line(self, server: float) -> float:
        return self._offset + self._slope * server

    def _fit(self) -> None:
        best = min(round_trip for _, _, round_trip in self._echoes)
        good = [
            (server, offset) for server, offset, round_trip in self._echoes if round_trip <= best + ROUND_TRIP_SPREAD
        ]
        self.round_trip = best
        spans = good[-1][0] - good[0][0] >= SLOPE_SPAN
        self._offset, self._slope = fit_line(good, MAX_DRIFT if spans else 0.0)
        if not spans:
            self._offset = sum(offset for _, offset in good) / len(good)
        assert self._origin is not None
        line = Line(self._origin[1], self._offset, 1.0 + self._slope, self._frequency)
        if self._map is None:
            self._map = RisingLine(line)
        else:
            self._map.meet(line, line.anchor)


class RunningMinimum:
    """Smallest difference of two clocks in a time window, which removes a varying delay.

    Attributes:
        restarts: number of times that one of the clocks changed.
    """

    def __init__(self) -> None:
        self.restarts = 0
        self._falling: deque[tuple[float, float]] = deque()
        self._misses = 0

    def add(self, time: float, difference: float) -> float | None:
        """Add a difference, and return the smallest one [s]; None if the added one is too far off to be valid.

        Several invalid differences in a row restart the window.
        """
        if self._falling and not abs(difference - self._falling[0][1]) < FAR:
            self._misses += 1
            if self._misses < RESTART_ECHOES:
                return None
            self._falling.clear()
            self.restarts += 1
        self._misses = 0
        while self._falling and self._falling[-1][1] >= difference:
            self._falling.pop()
        self._falling.append((time, difference))
        while self._falling[0][0] < time - MINIMUM_WINDOW:
            self._falling.popleft()
        return self._falling[0][1]


class StampClock:
    """Map from a server's time stamps to the local clock, without echoes: frames arrive late, never early."""

    def __init__(self) -> None:
        self._minimum, self._map, self._restarts = RunningMinimum(), RisingLine(Line(0, 0.0, 1.0, NS)), 0
        self._begun = False

    def local(self, stamp: float, received: int) -> int | None:
        """Return when a frame would arrive with the smallest recent delay [ns]; None: its time stamp is not valid.

        Args:
            stamp: time stamp of the frame [s].
            received: arrival of the frame by the local clock [ns].
        """
        minimum = self._minimum.add(received / NS, received / NS - stamp)
        if minimum is None:
            return None
        at = round(stamp * NS)
        line = Line(at, stamp + minimum, 1.0, NS)
        if not self._begun or self._minimum.restarts > self._restarts:
            self._map, self._begun, self._restarts = RisingLine(line), True, self._minimum.restarts
        else:
            self._map.meet(line, at)
        self._map.settle(at)
        return round(self._map.at(at) * NS)


class ExposureClock:
    """Clock for the middle of a frame's exposure, by the best available method; increasing for frames in order.

    Args:
        nominal_latency: time from the middle of the exposure to the arrival, if the server does not report it [s].
    """

    def __init__(self, nominal_latency: float) -> None:
        self._nominal = round(nominal_latency * NS)
        self._stamps = StampClock()
        self._last: int | None = None
        self.echo: EchoClock | None = None

    def restart(self, frequency: float) -> None:
        """Restart with another server, or the same one again.

        Args:
            frequency: ticks per second of the server's clock [Hz]; 0: it has no such clock.
        """
        self.echo = EchoClock(frequency) if frequency > 0 else None
        self._stamps = StampClock()

    def exposed(self, frame: Frame, received: int) -> tuple[int, str]:
        """Return the middle of a frame's exposure by the local clock [ns], and the method by which it is known.

        The method is "mid-exposure", "transmission", "time stamp" or "reception"; the time is not after the reception.
        """
        exposed, means = self._exposed(frame, received)
        if (
            self._last is not None and exposed <= self._last
        ):  # another method than for the last frame, or another server
            exposed = self._last + 1
        self._last = exposed
        return exposed, means

    def _exposed(self, frame: Frame, received: int) -> tuple[int, str]:
        suffix = frame.suffix
        if self.echo is not None and self.echo.synchronised and (suffix.mid_exposure or suffix.transmitted):
            ticks, means = (
                (suffix.mid_exposure, "mid-exposure") if suffix.mid_exposure else (suffix.transmitted, "transmission")
            )
            local = self.echo.local(ticks)
            if local is not None and not suffix.mid_exposure:
                local -= self._nominal
            if local is not None and -LATEST < local - received < CLOCK_ERROR:
                self.echo.settle(ticks)
                return min(local, received), means
        if suffix.time_stamp and math.isfinite(suffix.time_stamp):
            local = self._stamps.local(suffix.time_stamp, received)
            if local is not None:
                return min(local, received) - self._nominal, "time stamp"
        return received - self._nominal, "reception"
