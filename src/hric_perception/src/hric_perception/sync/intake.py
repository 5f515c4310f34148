"""Intake of one source: its samples, refused ones with the reason, and starvation. No ROS."""

from collections import Counter, deque

import numpy as np

from hric_perception.stream import START
from hric_perception.sync.buffer import StampBuffer, Stamps, Values
from hric_perception.sync.extract import MessageSamples
from hric_perception.sync.instants import AGREE, StampRelation
from hric_perception.sync.layout import SyncSource

NS = 1e-9
OUT_OF_ORDER, FOREIGN, MALFORMED, NOT_FOR_US = (
    "not later than the sample before",
    "stamped with another time",
    "malformed",
    "without the requested values",
)
NOT_YET = "no message yet"
"""Reason of a source without messages during startup: no failure."""
REFUSALS = (OUT_OF_ORDER, FOREIGN, MALFORMED)
"""Reasons for which refused samples are losses; messages for others on the same topic are none."""


class Intake:
    """Samples of one source.

    Args:
        source: description of the source.
        now: start time by a monotonic clock [s].
        delay: how long an instant waits for a delayed source [s]; at least its time-out.

    Attributes:
        samples: number of accepted samples.
        refused: reason -> samples.
        late: samples that arrived after their instants had gone out.
    """

    def __init__(self, source: SyncSource, now: float, delay: float) -> None:
        self.source, self.topic = source, source.topic
        self._patience = max(source.timeout, delay)
        self.buffer = StampBuffer(source.capacity, len(source.columns))
        self.samples = self.late = 0
        self.refused: Counter[str] = Counter()
        self._waiting: deque[tuple[float, MessageSamples | tuple[int, list[float]]]] = deque()
        self._last: float | None = None
        self._begun, self._busy = now, 0.0
        self._trouble = ""

    def put(self, samples: MessageSamples | tuple[int, list[float]], arrived: float) -> None:
        """Put samples, or stamp [ns] and values of one, that arrived then [s], for `collect`; thread-safe."""
        self._waiting.append((arrived, samples))

    def collect(self) -> tuple[float, MessageSamples] | None:
        """Return (arrival of the last one [s], waiting samples with stamps in any order); None if there are none."""
        count = len(self._waiting)
        if not count:
            return None
        waiting = [self._waiting.popleft() for _ in range(count)]
        arrived = waiting[-1][0]
        if all(isinstance(sample, MessageSamples) for _, sample in waiting):
            chunks = [sample for _, sample in waiting if isinstance(sample, MessageSamples)]
            if count == 1:
                return arrived, chunks[0]
            return arrived, MessageSamples(
                np.concatenate([sample.stamps for sample in chunks]),
                np.concatenate([sample.values for sample in chunks]),
            )
        return arrived, MessageSamples(
            np.array([sample[0] for _, sample in waiting], np.int64),
            np.array([sample[1] for _, sample in waiting], np.float64),
        )

    def take(
        self, stamps: Stamps, values: Values, verdict: StampRelation, sent: int | None, arrived: float, busy: float
    ) -> None:
        """Accept samples that are later than the previous ones.

        Args:
            stamps: in any order, shape (n,) [ns].
            values: shape (n, columns).
            verdict: judgement of the common time; foreign samples are refused.
            sent: last instant that went out [ns]; samples before it are late.
            arrived: arrival by the monotonic clock [s].
            busy: time of the `BusyClock` [s].
        """
        if verdict is StampRelation.FOREIGN:
            self.refuse(FOREIGN, len(stamps))
            return
        last = self.buffer.last
        if (last is not None and stamps[0] <= last) or (len(stamps) > 1 and (stamps[1:] <= stamps[:-1]).any()):
            stamps, values = self._in_order(stamps, values, last)
            if not len(stamps):
                return
        if sent is not None and stamps[0] <= sent:
            self.late += int(np.searchsorted(stamps, sent, side="right"))
        self.buffer.extend(stamps, values)
        self.samples += len(stamps)
        self._last, self._busy, self._trouble = arrived, busy, ""

    def _in_order(self, stamps: Stamps, values: Values, last: int | None) -> tuple[Stamps, Values]:
        """Return the samples that are of the same time as the last of them, and later than all before them."""
        same = np.abs(stamps - stamps[-1]) <= AGREE
        if not same.all():
            self.refuse(FOREIGN, int((~same).sum()))
            stamps, values = stamps[same], values[same]
        begin = stamps[0] - 1 if last is None else last
        fresh = stamps > np.concatenate([[begin], np.maximum.accumulate(np.maximum(stamps, begin))[:-1]])
        if not fresh.all():
            self.refuse(OUT_OF_ORDER, int((~fresh).sum()))
        return stamps[fresh], values[fresh]

    def refuse(self, reason: str, count: int = 1) -> None:
        """Count samples that are not accepted."""
        self.refused[reason] += count
        self._trouble = reason

    def starving(self, now: float) -> str:
        """Return why nothing usable came for longer than the time-out, as text; empty if it came.

        Args:
            now: time of the monotonic clock [s].
        """
        since = self._begun if self._last is None else self._last
        if now - since <= self.source.timeout:
            return ""
        if self._trouble:
            return (
                f"only samples that are {self._trouble}"
                if self._trouble != NOT_FOR_US
                else f"only messages {NOT_FOR_US}"
            )
        if self._last is None:
            return NOT_YET if now - since <= START else "never heard"
        return f"silent for {now - since:.1f} s" if now - since < 100 else "silent"

    def awaited(self, busy: float) -> bool:
        """Return True if an instant waits for this source, at a time of the `BusyClock` [s]."""
        return busy - self._busy <= self._patience

    def restart(self, now: float, busy: float) -> None:
        """Restart with another time; waiting samples are judged again."""
        self.buffer.clear()
        self._last, self._begun, self._busy = None, now, busy

    def rate(self) -> float:
        """Return samples per second over the stored samples of the last second [Hz]; 0: fewer than two."""
        stamps = self.buffer.stamps
        if not len(stamps):
            return 0.0
        recent = stamps[np.searchsorted(stamps, stamps[-1] - 1_000_000_000) :]
        return float((len(recent) - 1) / ((recent[-1] - recent[0]) * NS)) if len(recent) > 1 else 0.0
