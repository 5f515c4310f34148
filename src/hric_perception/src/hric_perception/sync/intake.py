"""Intake of one source of the synchroniser: stored samples, refused samples by reason, starvation. No ROS."""

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
    "stamped by another clock",
    "malformed",
    "without the requested values",
)
NOT_YET = "no message yet"
"""Reason why a source starves that has not sent yet during startup: not a failure."""
REFUSALS = (OUT_OF_ORDER, FOREIGN, MALFORMED)
"""Reasons by which refused samples count as losses; messages without the requested values do not."""


class Intake:
    """Received samples of one source of the synchroniser.

    Args:
        source: description of the source.
        now: start time by a monotonic clock [s].
        delay: how long an instant waits for a delayed source [s]; it waits at least for the source's time-out.

    Attributes:
        samples: number of accepted samples.
        refused: number of refused samples by reason.
        late: number of samples that arrived after their instants had been returned.
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
        """Queue samples, or one sample as (stamp [ns], values), for `collect`; arrived: in [s]. Thread-safe."""
        self._waiting.append((arrived, samples))

    def collect(self) -> tuple[float, MessageSamples] | None:
        """Return (arrival of the last queued message [s], all queued samples in order of arrival); None without any."""
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
        """Store samples that are later than the stored ones; refuse and count the others.

        Args:
            stamps: stamps in any order, shape (n,) [ns].
            values: values, shape (n, columns).
            verdict: relation of the stamps to the common time; foreign samples are refused.
            sent: last instant that was returned [ns]; samples before it are late.
            arrived: arrival time by the monotonic clock [s].
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
        """Return the samples that are of the same run as the last of them, and later than all before them."""
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
        """Count samples that are refused for a reason."""
        self.refused[reason] += count
        self._trouble = reason

    def starving(self, now: float) -> str:
        """Return why no usable sample arrived for longer than the source's time-out; empty if one did.

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
            return NOT_YET if now - since <= START else "no message since the start"
        return f"silent for {now - since:.1f} s" if now - since < 100 else "silent"

    def awaited(self, busy: float) -> bool:
        """Return True if an instant waits for this source, at a time of the `BusyClock` [s]."""
        return busy - self._busy <= self._patience

    def restart(self, now: float, busy: float) -> None:
        """Remove the stored samples, because robot time restarts; queued samples stay."""
        self.buffer.clear()
        self._last, self._begun, self._busy = None, now, busy

    def rate(self) -> float:
        """Return the rate of the stored samples of the last second [Hz]; 0: fewer than two."""
        stamps = self.buffer.stamps
        if not len(stamps):
            return 0.0
        recent = stamps[np.searchsorted(stamps, stamps[-1] - 1_000_000_000) :]
        return float((len(recent) - 1) / ((recent[-1] - recent[0]) * NS)) if len(recent) > 1 else 0.0
