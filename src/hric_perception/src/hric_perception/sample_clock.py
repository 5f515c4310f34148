"""Time and sequence number of samples whose stamps jitter, jump, or are only arrival times. No ROS."""

from collections import deque
from collections.abc import Callable
from itertools import islice

import numpy as np

from hric_core.robot_time.rising_line import SLOWEST
from hric_perception.chunk import Chunk, FloatArray, Layout

WINDOW = 2.0
"""Time window of the line fit [s]. The constants of this file are project defaults, unconfirmed."""
RATE_SPAN = 0.5
"""Time span from which on the measured rate is used [s]."""
RATE_LIMIT = 0.05
"""Largest relative difference from the declared rate."""
EXACT = 0.5
"""Scatter of the steps, relative to a sample, below which stamps count as exact and show a gap at once.

With more scatter a gap must last for CONFIRM.
"""
CONFIRM, ARRIVAL_CONFIRM = 0.1, 0.5
"""Times for which a gap must last, for stamps and for arrivals [s]; samples are held back meanwhile.

It is longer for arrivals, since delayed ones arrive in a burst afterwards.
"""
LEARN = 10
"""Number of blocks after which the scatter is known."""
SPREADS = 6.0
"""Smallest gap, in mean deviations from the line; all of the following limits apply, too."""
SAMPLES = 1.5
"""Smallest gap in samples."""
ARRIVAL_GAP = 0.1
"""Smallest gap if only arrivals are known, which come late in bursts [s]."""
PASSES, TRIM, FINE = 3, 5.0, 1e-5
"""Passes of the line fit; outliers beyond TRIM medians of the deviations, and beyond FINE [s], are left out."""
FIT_ALL, FIT_INTERVAL = 20, 4
"""Schedule of the line fit: at each of the first FIT_ALL blocks, then at every FIT_INTERVAL-th, to save time."""
STEPS = 51
"""Number of blocks from which the length of a step is computed."""
DEVIATIONS = 3.0
"""Smallest gap, in the largest recent deviations of the stamps from even steps."""
CLOCK_STEP = 0.1
"""Jump of the run's time beyond which it counts as another clock [s]."""
JUMP = 10.0
"""Length beyond which a gap counts as a clock reset [s]."""


class SampleClock:
    """Assignment of sample blocks to a line of robot time over sample number.

    Exact stamps are used as they are. Others scatter about a line: least squares. Arrivals are late, never early: the
    line is the envelope of the earliest. If the line goes back, as when the run has lost time, samples are placed
    closer together until they are on it again: time never goes back, unless the run or the clock of the source
    restarts.

    Args:
        layout: layout of the samples, with the declared rate.
        robot_time: monotonic time [s] -> time of the run [s]; None: not known. It may correct past values later.
        latency: None: the times are stamps of the source; else they are arrivals, and this is the minimum time from the
            sample to them [s].

    Attributes:
        lost: number of missing samples.
        jumps: number of clock resets.
        number: number of the next sample.
    """

    def __init__(
        self, layout: Layout, robot_time: Callable[[float], float | None], latency: float | None = None
    ) -> None:
        self.layout, self._robot_time, self._latency = layout, robot_time, latency
        self.lost, self.jumps, self.number = 0, 0, 0
        self._points: deque[tuple[int, float]] = deque()
        self._line = (0, 0.0, 1.0 / layout.rate)  # number and time of its origin, and its period
        self._unfitted = 0
        self._spread = 0.0
        self._held: deque[tuple[float, FloatArray, int | None]] = deque()
        self._monotonic = 0.0
        self._steps: deque[float] = deque(maxlen=STEPS)
        self._deviations: deque[float] = deque(maxlen=STEPS)
        self._exact = False
        self._known = self._end = float(
            "-inf"
        )  # time of the run at the last block, and assigned time of its last sample

    def add(self, monotonic: float, data: FloatArray, lost: int | None = None) -> list[Chunk]:
        """Add a block of samples without gap.

        Args:
            monotonic: stamp or arrival time of the LAST sample, monotonic clock [s].
            data: values, shape (samples, channels).
            lost: samples missing before the block by the source's sequence numbers; None: it has none, and gaps are
                detected from the times.

        Returns:
            chunks with times: none while a gap is not certain, then all that were held back.
        """
        self._held.append((monotonic, data, lost))
        placed: list[Chunk] = []
        while self._held and (count := self._certain(monotonic)):
            placed += [self._assign_times(*self._held.popleft()) for _ in range(count)]
        return placed

    def flush(self) -> list[Chunk]:
        """Return the chunks that are still held back."""
        held, self._held = self._held, deque()
        return [self._assign_times(*block) for block in held]

    def _certain(self, now: float) -> int:
        """Return how many held-back blocks can be placed, after a step of the line if they show one."""
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
        """Return how far the last of `count` blocks is behind the line [s]."""
        time = self._robot_time(self._held[count - 1][0])
        samples = self._samples(count)
        return 0.0 if time is None else time - (self._latency or 0.0) - self._at(self.number + samples - 1)

    def _fits(self, strayed: float) -> bool:
        return abs(strayed) <= self._limit() or (self._latency is not None and -JUMP < strayed < 0)

    def _limit(self) -> float:
        """Return the smallest length of a gap [s]."""
        limit = max(SAMPLES / self.layout.rate, SPREADS * self._spread)
        return limit if self._latency is None else max(limit, ARRIVAL_GAP)

    def _step_length(self) -> float:
        """Return the time between samples by the monotonic clock, without pauses [s]."""
        return float(np.median(self._steps)) if self._steps else 1.0 / self.layout.rate

    def _step(self, count: int) -> None:
        """Assign numbers to the samples after a gap, or begin another line, before the last of `count` blocks.

        A gap shows on both clocks; a pause of the run, or a line through its pairs that moves, shows on one of them.
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
        """Return the samples in `count` blocks, including those missing before them by the source's numbers."""
        return sum(len(data) + (lost or 0) for _, data, lost in islice(self._held, count))

    def _assign_times(self, monotonic: float, data: FloatArray, lost: int | None) -> Chunk:
        self.number += lost or 0
        self.lost += lost or 0
        first, last = self.number, self.number + len(data) - 1
        known = self._robot_time(monotonic)
        time = self._at(last) if known is None else known - (self._latency or 0.0)
        if known is not None:
            if known < self._known - CLOCK_STEP:  # stamps jitter by less
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
        """Return the chunk on the line, or behind the last one and closer together."""
        count, nominal, before = len(data), 1.0 / self.layout.rate, self._end
        start, pace = max(0.0, self._at(first)), 1.0
        if start <= before:
            period = max((self._at(first + count - 1) - before) / count, SLOWEST * nominal)
            start, pace = before + period, nominal / period
        self._end = start + (count - 1) * nominal / pace
        return Chunk(self.layout, start, first, data, pace)

    def _note(self, step: float, samples: int) -> None:
        """Update the scatter of the stamps with a step by the monotonic clock [s]."""
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
        """Return the time of a sample number on the line [s]."""
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
    """Return (offset, period, mean deviation) of the least-squares line without outliers.

    The period is fitted if `sloping`, else the nominal one.
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
    """Return the period of the line from the earliest point of the first third to that of the last third."""
    rest = t - nominal * k
    third = max(1, len(k) // 3)
    a, b = int(rest[:third].argmin()), len(k) - third + int(rest[-third:].argmin())
    period = float((t[b] - t[a]) / (k[b] - k[a])) if k[b] > k[a] else nominal
    return min(max(period, nominal / (1 + RATE_LIMIT)), nominal / (1 - RATE_LIMIT))
