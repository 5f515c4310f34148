"""Robot time and sequence number of samples whose stamps jitter or jump, or that only have arrival times. No ROS."""

from collections import deque
from collections.abc import Callable
from itertools import islice

import numpy as np

from hric_core.robot_time.rising_line import SLOWEST
from hric_perception.chunk import Chunk, FloatArray, Layout

WINDOW = 2.0
"""Time window of the fit of a line, robot time over sample number [s].

The constants of this file are project defaults, unconfirmed.
"""
RATE_SPAN = 0.5
"""Time span of samples from which on the measured sample rate replaces the declared one [s]."""
RATE_LIMIT = 0.05
"""Largest relative difference of the measured from the declared sample rate [1]."""
EXACT = 0.5
"""Largest scatter of the time steps between blocks with which stamps count as exact [sample periods].

Exact stamps show a gap at once. With more scatter a gap must last for CONFIRM.
"""
CONFIRM, ARRIVAL_CONFIRM = 0.1, 0.5
"""Time for which a gap must last to be counted, with stamps and with arrival times [s]; samples wait meanwhile.

It is longer with arrival times, since delayed samples arrive in a burst afterwards.
"""
LEARN = 10
"""Number of sample blocks after which the scatter of their stamps is known."""
SPREADS = 6.0
"""Smallest offset of a block from the fitted line that counts as a gap [mean deviations of the stamps].

The largest of SPREADS, SAMPLES and ARRIVAL_GAP applies.
"""
SAMPLES = 1.5
"""Smallest offset of a block from the fitted line that counts as a gap [sample periods]."""
ARRIVAL_GAP = 0.1
"""Smallest offset of a block from the fitted line that counts as a gap, with arrival times, which are uneven [s]."""
PASSES, TRIM, FINE = 3, 5.0, 1e-5
"""Passes of the fit of robot time over sample number; outliers are beyond TRIM median deviations and FINE [s]."""
FIT_ALL, FIT_INTERVAL = 20, 4
"""Blocks at which the line is fitted: each of the first FIT_ALL, then every FIT_INTERVAL-th, to save time."""
STEPS = 51
"""Number of newest blocks from which the time between samples and its scatter are computed."""
DEVIATIONS = 3.0
"""Smallest gap by the monotonic clock [largest recent deviations of stamps from even steps]."""
CLOCK_STEP = 0.1
"""Jump of robot time beyond which it counts as a clock reset [s]."""
JUMP = 10.0
"""Length beyond which a gap counts as a clock reset, not as lost samples [s]."""


class SampleClock:
    """Clock that assigns robot time to blocks of samples, by a line of robot time over sample number.

    Exact stamps are used as they are. Through stamps that scatter, the line is a least squares fit. Arrivals are late,
    never early: the line is the envelope of the earliest. If the line moves back, because robot time fell behind the
    source's clock, samples are placed closer together until they are on it again: time never goes back, unless the run
    or the clock of the source restarts.

    Args:
        layout: layout of the samples, with the declared rate.
        robot_time: function from monotonic time [s] to robot time [s]; None: not known. Later it may return other
            values for the past.
        latency: None: samples have stamps of the source; else they have arrival times, and this is the minimum time
            from sample to arrival [s].

    Attributes:
        lost: number of missing samples.
        jumps: number of clock resets.
        number: sequence number of the next sample.
    """

    def __init__(
        self, layout: Layout, robot_time: Callable[[float], float | None], latency: float | None = None
    ) -> None:
        self.layout, self._robot_time, self._latency = layout, robot_time, latency
        self.lost, self.jumps, self.number = 0, 0, 0
        self._points: deque[tuple[int, float]] = deque()
        self._line = (0, 0.0, 1.0 / layout.rate)  # sample number and time of its origin, and its slope
        self._unfitted = 0
        self._spread = 0.0
        self._held: deque[tuple[float, FloatArray, int | None]] = deque()
        self._monotonic = 0.0
        self._steps: deque[float] = deque(maxlen=STEPS)
        self._deviations: deque[float] = deque(maxlen=STEPS)
        self._exact = False
        self._known = self._end = float(
            "-inf"
        )  # robot time at the last block, and assigned time of the last sample of that block

    def add(self, monotonic: float, data: FloatArray, lost: int | None = None) -> list[Chunk]:
        """Add a block of samples without a gap between them.

        Args:
            monotonic: stamp or arrival time of the LAST sample of the block, by the monotonic clock [s].
            data: values, shape (samples, channels).
            lost: number of samples missing before the block by the source's sequence numbers; None: it has none, and
                gaps are detected from the times.

        Returns:
            chunks with robot times: none while a gap is not certain, afterwards all that were held back.
        """
        self._held.append((monotonic, data, lost))
        placed: list[Chunk] = []
        while self._held and (count := self._certain(monotonic)):
            placed += [self._assign_times(*self._held.popleft()) for _ in range(count)]
        return placed

    def flush(self) -> list[Chunk]:
        """Return the blocks that are still held back, as chunks with robot times."""
        held, self._held = self._held, deque()
        return [self._assign_times(*block) for block in held]

    def _certain(self, now: float) -> int:
        """Return how many held-back blocks can get their times; a gap that they confirm moves the line first."""
        if not self._points or self._fits(self._strayed(len(self._held))):
            return len(self._held)
        strayed = self._strayed(1)
        if self._fits(strayed):
            return 1
        if now - self._held[0][0] < (CONFIRM if self._latency is None else ARRIVAL_CONFIRM) and strayed > -JUMP:
            return 0
        count = 1 if self._exact else len(self._held)
        self._step(count)
        return count

    def _strayed(self, count: int) -> float:
        """Return by how much the last of the first `count` held-back blocks is later than the line [s]."""
        time = self._robot_time(self._held[count - 1][0])
        samples = self._samples(count)
        return 0.0 if time is None else time - (self._latency or 0.0) - self._at(self.number + samples - 1)

    def _fits(self, strayed: float) -> bool:
        return abs(strayed) <= self._limit() or (self._latency is not None and -JUMP < strayed < 0)

    def _limit(self) -> float:
        """Return the smallest offset of a block's time from the fitted line that counts as a gap [s]."""
        limit = max(SAMPLES / self.layout.rate, SPREADS * self._spread)
        return limit if self._latency is None else max(limit, ARRIVAL_GAP)

    def _step_length(self) -> float:
        """Return the usual time between samples by the monotonic clock [s]: the median, which ignores gaps."""
        return float(np.median(self._steps)) if self._steps else 1.0 / self.layout.rate

    def _step(self, count: int) -> None:
        """Account for a gap before `count` held-back blocks: skip numbers of lost samples, or begin a new line fit.

        Lost samples are a gap in monotonic and robot time. A gap in only one of them is a pause of the run, or a
        correction of robot time, and begins a new line fit.
        """
        strayed, length = self._strayed(count), self._step_length()
        missing = (self._held[count - 1][0] - self._monotonic) / length - self._samples(count)
        numbered = self._held[0][2] is not None
        clear = missing * length > DEVIATIONS * max(self._deviations, default=0.0)
        if not numbered and clear and 0 < strayed < JUMP and 0.5 < missing / (strayed * self.layout.rate) < 2.0:
            gap = round(strayed / self._line[2])
            self.number += gap
            self.lost += gap
            return
        self.jumps += abs(strayed) > CLOCK_STEP
        self._points.clear()

    def _samples(self, count: int) -> int:
        """Return the number of samples in `count` held-back blocks, plus those that the source counts as missing."""
        return sum(len(data) + (lost or 0) for _, data, lost in islice(self._held, count))

    def _assign_times(self, monotonic: float, data: FloatArray, lost: int | None) -> Chunk:
        self.number += lost or 0
        self.lost += lost or 0
        first, last = self.number, self.number + len(data) - 1
        known = self._robot_time(monotonic)
        time = self._at(last) if known is None else known - (self._latency or 0.0)
        if known is not None:
            if known < self._known - CLOCK_STEP:  # robot time was reset: stamps jitter by less
                self._end = float("-inf")
            self._known = known
        self.number += len(data)
        if self._points:
            self._note(monotonic - self._monotonic, last - self._points[-1][0])
        self._monotonic = monotonic
        self._points.append((last, time))
        while self._points[0][1] < time - WINDOW:
            self._points.popleft()
        self._unfitted += 1
        if self._exact:
            if len(self._points) == 1 or abs(time - self._at(last)) <= self._limit():
                self._line = (last, time, 1.0 / self.layout.rate)
        elif len(self._points) < FIT_ALL or self._unfitted >= FIT_INTERVAL:
            self._unfitted = 0
            self._fit()
        return self._after_last(first, data)

    def _after_last(self, first: int, data: FloatArray) -> Chunk:
        """Return a block as a chunk on the line, or closer together behind the last chunk, if that reaches further."""
        count, nominal, before = len(data), 1.0 / self.layout.rate, self._end
        start, pace = max(0.0, self._at(first)), 1.0
        if start <= before:
            period = max((self._at(first + count - 1) - before) / count, SLOWEST * nominal)
            start, pace = before + period, nominal / period
        self._end = start + (count - 1) * nominal / pace
        return Chunk(self.layout, start, first, data, pace)

    def _note(self, step: float, samples: int) -> None:
        """Update the scatter of the stamps with the time step between two blocks [s] and its number of samples."""
        self._steps.append(step / samples)
        self._deviations.append(abs(step - samples * self._step_length()))
        exact = (
            self._latency is None
            and len(self._steps) >= LEARN
            and float(np.median(self._deviations)) <= EXACT / self.layout.rate
        )
        if exact and not self._exact:
            self._spread = 0.0
        self._exact = exact

    def _at(self, number: int) -> float:
        """Return the robot time of a sample number on the line [s]."""
        origin, time, period = self._line
        return time + period * (number - origin)

    def _fit(self) -> None:
        points = np.array(self._points)
        k, t = points[:, 0] - points[-1, 0], points[:, 1] - points[-1, 1]
        nominal = 1.0 / self.layout.rate
        long = -k[0] * nominal >= (RATE_SPAN if self._latency is None else 0.9 * WINDOW)
        if self._latency is None:
            offset, period, self._spread = _trimmed_line(k, t, nominal, long and len(k) > 2)
        else:
            period = _envelope_period(k, t, nominal) if long else nominal
            rest = t - period * k
            offset, self._spread = float(rest.min()), float(np.abs(rest - rest.mean()).mean())
        self._line = (self._points[-1][0], self._points[-1][1] + offset, period)


def _trimmed_line(k: FloatArray, t: FloatArray, nominal: float, sloping: bool) -> tuple[float, float, float]:
    """Return (offset, period, mean deviation) [s] of the least-squares line t = offset + period k without outliers.

    If `sloping`, the period is fitted, else it is the nominal one.
    """
    inliers = np.ones(len(k), dtype=bool)
    offset, period, rest = 0.0, nominal, t
    for _ in range(PASSES):
        x, y = k[inliers], t[inliers]
        middle = x.mean()
        spread = (x - middle) @ (x - middle)
        if sloping and spread > 0:
            period = float((x - middle) @ y / spread)
            period = min(max(period, nominal / (1 + RATE_LIMIT)), nominal / (1 - RATE_LIMIT))
        offset = float((y - period * x).mean())
        rest = np.abs(t - period * k - offset)
        inliers = rest <= max(TRIM * float(np.median(rest)), FINE)
    return offset, period, float(rest[inliers].mean())


def _envelope_period(k: FloatArray, t: FloatArray, nominal: float) -> float:
    """Return the slope [s] of the line from the earliest point (k, t) in the first third to that in the last third."""
    rest = t - nominal * k
    third = max(1, len(k) // 3)
    a, b = int(rest[:third].argmin()), len(k) - third + int(rest[-third:].argmin())
    period = float((t[b] - t[a]) / (k[b] - k[a])) if k[b] > k[a] else nominal
    return min(max(period, nominal / (1 + RATE_LIMIT)), nominal / (1 - RATE_LIMIT))
