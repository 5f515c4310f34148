"""Synchroniser: takes samples of many sources at their own rates, and returns samples at common instants. No ROS.

An instant is returned when every source that is not starving has a sample at or after it, so that later samples cannot
change it; at the latest when the newest stamp of all sources is `delay` past it. Time is that of the stamps: a paused
run pauses the synchroniser, and a recorded bag gives the same samples as the run did, at any speed.
"""

import threading
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hric_perception.sync.buffer import NS, Stamps, Values
from hric_perception.sync.extract import BATCHES, MalformedError, MessageSamples, NotForUsError, row_reader, stamp_of
from hric_perception.sync.instants import BusyClock, CommonTime, ReferenceStamps, StampRelation, Ticks
from hric_perception.sync.intake import MALFORMED, NOT_FOR_US, Intake
from hric_perception.sync.layout import APPROXIMATE, RESAMPLE, SyncPlan
from hric_perception.sync.sampling import Mask, SampledValues, picker, resampler

SPAN = 1_000_000_000
"""Time span of the statistics on skew and waiting time [ns]."""


class _Row(NamedTuple):
    stamp: int
    skews: Sequence[Values | None]
    valid: Mask
    waited: int


class Window:
    """Statistics of the last second: skew of each source, and waiting time of instants; computed on request.

    Args:
        sources: number of sources.
    """

    def __init__(self, sources: int) -> None:
        self._sources = sources
        self._rows: deque[_Row] = deque()

    def add(self, stamp: int, skews: Sequence[Values | None], valid: Mask, waited: int) -> None:
        """Add a batch of instants.

        Args:
            stamp: last instant of the batch [ns].
            skews: for each source, time between value and instant, shape (instants,) [s]; NaN without a value; None:
                values are interpolated at the instants.
            valid: validity of each source, shape (instants, sources).
            waited: waiting time of the first instant [ns].
        """
        self._rows.append(_Row(stamp, skews, valid, waited))
        while self._rows[0].stamp < stamp - SPAN:
            self._rows.popleft()

    def clear(self) -> None:
        """Remove all statistics."""
        self._rows.clear()

    def mean(self) -> list[float]:
        """Return the mean skew of each source [s], the time between value and instant; 0 if there was no sample."""
        return [float(skews.mean()) if len(skews) else 0.0 for skews in map(self._skews, range(self._sources))]

    def largest(self) -> list[float]:
        """Return the largest skew of each source [s], the time between value and instant."""
        return [float(self._skews(index).max(initial=0.0)) for index in range(self._sources)]

    def valid(self) -> list[float]:
        """Return the share of the instants at which each source was valid [1]; 1 if there were none."""
        if not self._rows:
            return [1.0] * self._sources
        return list(map(float, np.concatenate([row.valid for row in self._rows]).mean(axis=0)))

    def delay(self) -> float:
        """Return the longest time that an instant waited for samples [s]."""
        return max((row.waited for row in self._rows), default=0) * 1e-9

    def _skews(self, index: int) -> Values:
        known = [row.skews[index] for row in self._rows]
        skews = np.concatenate([np.zeros(0), *(skew for skew in known if skew is not None)])
        return np.asarray(skews[~np.isnan(skews)])


class SampleBatch(NamedTuple):
    """Batch of synchronised samples.

    Attributes:
        stamps: common instants, shape (n,) [ns].
        values: values of all sources, shape (n, values); NaN if there is none.
        age: instant minus stamp of the sample used, shape (n, sources) [s]; NaN if there is none.
        valid: True if all values of the source are finite, shape (n, sources).
    """

    stamps: Stamps
    values: Values
    age: Values
    valid: Mask


class Synchroniser:
    """Synchroniser of all sources of a plan.

    `push_message` and `push` may be called from any threads in parallel to that of `take`, and are cheap.

    Args:
        plan: sources and policy.
        now: current time of the monotonic clock that all calls use [s].

    Attributes:
        intakes: intake of each source.
        last: last instant that was returned [ns]; None: none was.
        restarts: number of times that the stamps of all sources jumped, as in a restarted run.
        sent: number of samples returned; incomplete: of these, with an invalid source; dropped: instants left out.
    """

    def __init__(self, plan: SyncPlan, now: float) -> None:
        self.plan = plan
        self.intakes = [Intake(source, now, plan.delay) for source in plan.sources]
        self.window = Window(len(plan.sources))
        self.restarts = self.sent = self.incomplete = self.dropped = 0
        self._time, self._busy = CommonTime(), BusyClock(now)
        self.last: int | None = None
        self._delay = round(plan.delay * NS)
        self._lock = threading.Lock()
        self._instants: Ticks | ReferenceStamps
        if plan.policy == RESAMPLE:
            self._instants = Ticks(plan.rate)
            self._samplers = [resampler(source) for source in plan.sources]
        else:
            assert plan.reference is not None
            self._instants = ReferenceStamps(self.intakes[plan.reference].buffer)
            tolerance = plan.tolerance if plan.policy == APPROXIMATE else 0.0
            self._samplers = [picker(source, tolerance) for source in plan.sources]
        self._readers = [_reader(intake) for intake in self.intakes]

    def push_message(self, index: int, message: Any, arrived: float) -> None:
        """Add a message of source `index`; arrived: monotonic time [s]. Unusable samples are only counted."""
        intake = self.intakes[index]
        try:
            intake.put(self._readers[index](message), arrived)
        except (NotForUsError, MalformedError) as error:
            with self._lock:
                intake.refuse(NOT_FOR_US if isinstance(error, NotForUsError) else MALFORMED)

    def push(self, index: int, stamps: Stamps, values: Values, arrived: float) -> None:
        """Add samples of source `index`.

        Args:
            index: index of the source.
            stamps: stamps of the samples, shape (n,) [ns].
            values: values, shape (n, columns of the source).
            arrived: arrival time by the monotonic clock [s].
        """
        if len(stamps):
            self.intakes[index].put(MessageSamples(stamps, values), arrived)

    def take(self, now: float) -> SampleBatch | None:
        """Return the synchronised samples that are due, at most `instants.MAX_INSTANTS`; None if there are none.

        Args:
            now: time of the monotonic clock [s].
        """
        with self._lock, np.errstate(all="ignore"):  # infinite values are allowed
            self._collect()
            limit = self._limit(now)
            stamps = self._instants.due(limit) if limit is not None else None
            if stamps is None or not len(stamps):
                return None
            self.last = int(stamps[-1])
            sampled = [
                sample(intake.buffer, stamps) for sample, intake in zip(self._samplers, self.intakes, strict=True)
            ]
            return self._assemble(stamps, sampled)

    def _collect(self) -> None:
        """Store the samples that arrived since the last call, in the order of their arrival."""
        collected = [
            (*batch, index) for index, intake in enumerate(self.intakes) if (batch := intake.collect()) is not None
        ]
        for arrived, samples, index in sorted(collected, key=lambda batch: batch[0]):
            self._busy.received(arrived)
            busy = self._busy.at(arrived)
            verdict = self._time.see(samples.stamps, arrived)
            if verdict is StampRelation.RESTARTED:
                self._restart(arrived, busy)
            self.intakes[index].take(samples.stamps, samples.values, verdict, self.last, arrived, busy)

    def starving(self, now: float) -> dict[str, str]:
        """Return the topics that have been silent for longer than their time-out, and why."""
        with self._lock:
            reasons = {intake.topic: intake.starving(now) for intake in self.intakes}
        return {topic: reason for topic, reason in reasons.items() if reason}

    def _limit(self, now: float) -> int | None:
        """Return the robot time up to which instants are due [ns]; None before the first instant."""
        if self._time.newest is None:
            return None
        busy = self._busy.at(now)
        waited = [intake.buffer for intake in self.intakes if intake.awaited(busy)]
        if isinstance(self._instants, Ticks) and not self._instants.begun and not self._begin(waited):
            return None
        forced = self._time.newest - self._delay
        return max(min((buffer.last or 0 for buffer in waited), default=forced), forced)

    def _begin(self, waited: Sequence[Any]) -> bool:
        """Begin the ticks at the first time when every source that is not starving has a sample."""
        firsts = [buffer.first for buffer in waited]
        if not firsts or None in firsts:
            return False
        assert isinstance(self._instants, Ticks)
        self._instants.begin(max(firsts))
        return True

    def _assemble(self, stamps: Stamps, sampled: list[SampledValues]) -> SampleBatch | None:
        valid = np.array([part.valid for part in sampled]).T
        batch = SampleBatch(
            stamps,
            np.concatenate([part.values for part in sampled], axis=1),
            np.array([part.age for part in sampled]).T,
            valid,
        )
        count = len(stamps)
        complete: Mask = np.all(valid, axis=1)
        self.window.add(
            int(stamps[-1]), [part.skew for part in sampled], valid, (self._time.newest or 0) - int(stamps[0])
        )
        if not self.plan.mark and not complete.all():
            count = int(complete.sum())
            batch = SampleBatch(stamps[complete], batch.values[complete], batch.age[complete], valid[complete])
            self.dropped += len(stamps) - count
        else:
            self.incomplete += count - int(complete.sum())
        self.sent += count
        return batch if count else None

    def _restart(self, now: float, busy: float) -> None:
        self.restarts += 1
        self.last = None
        self._instants.restart()
        self.window.clear()
        for intake in self.intakes:
            intake.restart(now, busy)


def _reader(intake: Intake) -> Any:
    """Return a function that reads samples from a message of the source."""
    source = intake.source
    leaves = [column.leaf for column in source.columns]
    if source.batched:
        return BATCHES[source.message._type](leaves, source.topic)
    read = row_reader(leaves)

    return lambda message: (stamp_of(message), read(message))
