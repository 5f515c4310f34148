"""The time and the running number of samples whose stamps jitter, jump, or are only the times at which they arrived. No
ROS."""

from collections import deque
from collections.abc import Callable
from itertools import islice

import numpy as np

from hric_control.robot_time.rising_line import SLOWEST
from hric_perception.chunk import Chunk, FloatArray, Layout

WINDOW = 2.0
"""Of the past that places the line [s]. The constants of this file are project defaults, unconfirmed."""
RATE_SPAN = 0.5
"""The past must span this much before its own rate counts [s]."""
RATE_LIMIT = 0.05
"""Share by which it may differ from the declared one."""
EXACT = 0.5
"""Stamps whose steps scatter by less than this share of a sample are taken as they are and show a gap at once; others
have to go on for ..."""
CONFIRM, ARRIVAL_CONFIRM = 0.1, 0.5
"""... so long [s], and samples are held back meanwhile; arrivals for longer, since what was held up arrives in a burst
afterwards."""
LEARN = 10
"""Blocks after which the scatter is known."""
SPREADS = 6.0
"""A gap is longer than this many mean deviations from the line, ..."""
SAMPLES = 1.5
"""... than this many samples, ..."""
ARRIVAL_GAP = 0.1
"""... and, where only arrivals are known, which come late in bursts, than this [s]."""
PASSES, TRIM, FINE = 3, 5.0, 1e-5
"""The line is fitted so many times, without what lies beyond so many medians of the deviations, and beyond this [s]."""
FIT_ALL, FIT_INTERVAL = 20, 4
"""The line is fitted at each of the first blocks, then at every fourth, which saves time."""
STEPS = 51
"""Blocks that give the length of a step."""
DEVIATIONS = 3.0
"""A gap is longer than so many of the largest recent deviations of the stamps from even steps."""
CLOCK_STEP = 0.1
"""The time of the run may move by less without being called another clock [s]."""
JUMP = 10.0
"""What would be a longer gap is a clock that was set again [s]."""


class SampleClock:
    """Places blocks of samples on a line of robot time over sample number.

    Exact stamps count as they are. Others scatter about a line: least squares. Arrivals are late, never early: the line
    runs through the earliest. Where the line goes back, as when the run has lost time, samples lie closer until they
    are on it again: none is placed before one that came first, unless the run or the clock of the source restarts.

    Args:
        layout: of the samples, with the declared rate.
        robot_time: monotonic time [s] -> time of the run [s]; None: not known. It may say something else of the past
            later on.
        latency: None: the times are stamps of the source; else they are arrivals, and this is the minimum time from
            the sample to them [s].

    Attributes:
        lost: samples that are missing in the numbers.
        jumps: times that the clock was set again.
        number: of the next sample.
    """

    def __init__(
        self, layout: Layout, robot_time: Callable[[float], float | None], latency: float | None = None
    ) -> None:
        self.layout, self._robot_time, self._latency = layout, robot_time, latency
        self.lost, self.jumps, self.number = 0, 0, 0
        self._points: deque[tuple[int, float]] = deque()
        self._line = (0, 0.0, 1.0 / layout.rate)  # number and time of its origin, period
        self._unfitted = 0
        self._spread = 0.0
        self._held: deque[tuple[float, FloatArray, int | None]] = deque()
        self._monotonic = 0.0
        self._steps: deque[float] = deque(maxlen=STEPS)
        self._deviations: deque[float] = deque(maxlen=STEPS)
        self._exact = False
        self._known = self._end = float(
            "-inf"
        )  # time of the run at the last block, and of its last sample as it was placed

    def add(self, monotonic: float, data: FloatArray, lost: int | None = None) -> list[Chunk]:
        """Take a block of samples without gap.

        Args:
            monotonic: when the LAST sample was stamped or arrived, monotonic clock [s].
            data: shape (samples, channels).
            lost: samples before the block that the source's own numbers miss; None: it does not number them, and the
                times show what is missing.

        Returns:
            what is placed: nothing while a gap is not certain, then all that was held back.
        """
        self._held.append((monotonic, data, lost))
        placed: list[Chunk] = []
        while self._held and (count := self._certain(monotonic)):
            placed += [self._assign_times(*self._held.popleft()) for _ in range(count)]
        return placed

    def flush(self) -> list[Chunk]:
        """What is still held back."""
        held, self._held = self._held, deque()
        return [self._assign_times(*block) for block in held]

    def _certain(self, now: float) -> int:
        """How many of the blocks that are held back can be placed, after a step of the line where they show one."""
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
        """How far the last of so many blocks lies behind the line [s]."""
        time = self._robot_time(self._held[count - 1][0])
        samples = self._samples(count)
        return 0.0 if time is None else time - (self._latency or 0.0) - self._at(self.number + samples - 1)

    def _fits(self, strayed: float) -> bool:
        return abs(strayed) <= self._limit() or (self._latency is not None and -JUMP < strayed < 0)

    def _limit(self) -> float:
        """[s]"""
        limit = max(SAMPLES / self.layout.rate, SPREADS * self._spread)
        return limit if self._latency is None else max(limit, ARRIVAL_GAP)

    def _step_length(self) -> float:
        """Between samples by the monotonic clock, pauses left out [s]."""
        return float(np.median(self._steps)) if self._steps else 1.0 / self.layout.rate

    def _step(self, count: int) -> None:
        """Number what follows a gap, or begin another line, before so many blocks.

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
        """In so many blocks, with what is missing before them by the source's own numbers."""
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
        """The chunk on the line, or behind the last one and closer together."""
        count, nominal, before = len(data), 1.0 / self.layout.rate, self._end
        start, pace = max(0.0, self._at(first)), 1.0
        if start <= before:
            period = max((self._at(first + count - 1) - before) / count, SLOWEST * nominal)
            start, pace = before + period, nominal / period
        self._end = start + (count - 1) * nominal / pace
        return Chunk(self.layout, start, first, data, pace)

    def _note(self, step: float, samples: int) -> None:
        """Learn the scatter of the stamps from a step by the monotonic clock [s]."""
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
        """The line [s]."""
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
    """(offset, period, mean deviation) of the least-squares line without outliers; `sloping`: its own period, else the
    nominal one."""
    kept = np.ones(len(k), dtype=bool)
    offset, period, rest = 0.0, nominal, t
    for _ in range(PASSES):
        x, y = k[kept], t[kept]
        middle = x.mean()
        spread = (x - middle) @ (x - middle)
        if sloping and spread > 0:
            period = float((x - middle) @ y / spread)
            period = min(max(period, nominal / (1 + RATE_LIMIT)), nominal / (1 - RATE_LIMIT))
        offset = float((y - period * x).mean())
        rest = np.abs(t - period * k - offset)
        kept = rest <= max(TRIM * float(np.median(rest)), FINE)
    return offset, period, float(rest[kept].mean())


def _envelope_period(k: FloatArray, t: FloatArray, nominal: float) -> float:
    """The period of the line from the earliest point of the first third to that of the last third."""
    rest = t - nominal * k
    third = max(1, len(k) // 3)
    a, b = int(rest[:third].argmin()), len(k) - third + int(rest[-third:].argmin())
    period = float((t[b] - t[a]) / (k[b] - k[a])) if k[b] > k[a] else nominal
    return min(max(period, nominal / (1 + RATE_LIMIT)), nominal / (1 - RATE_LIMIT))
