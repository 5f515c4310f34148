"""Conversion of synchronised samples, their layout and status to ROS messages."""

from collections.abc import Iterator
from typing import Any

import genpy
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from hric_msgs.msg import SyncLayout, SyncStatus
from hric_perception.sync.buffer import NS
from hric_perception.sync.core import SampleBatch, Synchroniser
from hric_perception.sync.intake import NOT_YET, REFUSALS
from hric_perception.sync.layout import RESAMPLE, SyncPlan, SyncSource


def samples(batch: SampleBatch, blanks: Iterator[Any]) -> Iterator[Any]:
    """Yield a hric_msgs/SyncedSample for each instant of a batch.

    Args:
        batch: synchronised samples.
        blanks: infinite iterator of messages to fill; they are reused, because creating one takes longer than sending
            it.
    """
    rows = zip(batch.stamps.tolist(), batch.values.tolist(), batch.age.tolist(), batch.valid.tolist(), strict=True)
    for nanoseconds, values, age, valid in rows:
        message = next(blanks)
        message.values, message.age, message.valid = values, age, valid
        message.header.stamp.secs, message.header.stamp.nsecs = divmod(nanoseconds, NS)
        yield message


class Units:
    """Units of synchronised values; those missing in the plan are read from a source's first SampleChunk.

    Args:
        plan: plan of the synchronisation.
    """

    def __init__(self, plan: SyncPlan) -> None:
        self._reported: dict[str, list[str]] = {}
        self._open = {
            source.topic
            for source in plan.sources
            if source.message._type == "hric_msgs/SampleChunk" and not all(_units(source))
        }

    def see(self, source: SyncSource, message: Any) -> bool:
        """Read the units from a message of a source; return True if some were missing before."""
        if source.topic not in self._open:
            return False
        names, words = list(message.channels), message.unit.split()
        by_channel = (
            dict(zip(names, words, strict=True)) if len(words) == len(names) else dict.fromkeys(names, message.unit)
        )
        steps = [column.leaf.steps[0].element for column in source.columns]
        self._reported[source.topic] = [
            by_channel.get(names[step] if isinstance(step, int) and step < len(names) else str(step), "")
            for step in steps
        ]
        self._open.discard(source.topic)
        return True

    def of(self, source: SyncSource) -> list[str]:
        """Return the unit of each value of a source; empty if it is not known."""
        known = _units(source)
        return [unit or reported for unit, reported in zip(known, self._reported.get(source.topic, known), strict=True)]


def _units(source: SyncSource) -> list[str]:
    return [column.unit for column in source.columns]


def layout(plan: SyncPlan, units: Units, topics: list[str]) -> Any:
    """Return the hric_msgs/SyncLayout of a plan.

    Args:
        plan: plan of the synchronisation.
        units: units of the values.
        topics: full names of the sources' topics.
    """
    pairs = list(zip(plan.sources, topics, strict=True))
    return SyncLayout(
        names=[f"{topic}.{column.leaf}" for source, topic in pairs for column in source.columns],
        units=[unit for source in plan.sources for unit in units.of(source)],
        sources=[topic for source, topic in pairs for _ in source.columns],
        interpolations=[column.interpolation for source in plan.sources for column in source.columns],
        policy=plan.policy,
        rate=plan.rate if plan.policy == RESAMPLE else 0.0,
        reference="" if plan.reference is None else topics[plan.reference],
    )


def status(synchroniser: Synchroniser, now: float, topics: list[str]) -> Any:
    """Return the hric_msgs/SyncStatus; now: monotonic time [s]; topics: full names of the sources' topics."""
    intakes, window, starving = synchroniser.intakes, synchroniser.window, synchroniser.starving(now)
    message = SyncStatus(
        sources=topics,
        samples=[intake.samples for intake in intakes],
        rate=[intake.rate() for intake in intakes],
        starving=[intake.topic in starving for intake in intakes],
        reasons=[starving.get(intake.topic, "") for intake in intakes],
        refused=[sum(intake.refused[reason] for reason in REFUSALS) for intake in intakes],
        late=[intake.late for intake in intakes],
        skew_mean=window.mean(),
        skew_max=window.largest(),
        sent=synchroniser.sent,
        incomplete=synchroniser.incomplete,
        dropped=synchroniser.dropped,
        delay=window.delay(),
    )
    message.header.stamp = genpy.Time(*divmod(synchroniser.last or 0, NS))
    return message


def diagnostics(current: Any, synchroniser: Synchroniser, before: Any, standing: bool) -> Any:
    """Return a DiagnosticStatus of the synchroniser; the caller sets its name.

    Args:
        current: current SyncStatus.
        synchroniser: synchroniser of the status.
        before: SyncStatus of the previous diagnostics; None: there are none yet.
        standing: True if the run is paused or has not begun.
    """
    starving = [f"{topic}: {reason}" for topic, reason in zip(current.sources, current.reasons, strict=True) if reason]
    losses = [f"{topic}: {what}" for topic, what in _losses(current, synchroniser.window.valid(), before)]
    if standing and len(starving) == len(current.sources):
        level, text = DiagnosticStatus.WARN, "the run is paused or has not begun"
    elif starving and {*current.reasons} <= {"", NOT_YET}:
        level, text = DiagnosticStatus.WARN, "waiting for sources: " + "; ".join(starving)
    elif starving:
        level, text = DiagnosticStatus.ERROR, "starving: " + "; ".join(starving)
    elif losses:
        level, text = DiagnosticStatus.WARN, "; ".join(losses)
    else:
        level, text = DiagnosticStatus.OK, f"{len(current.sources)} sources"
    return DiagnosticStatus(
        level=level, message=text, values=[KeyValue(key, str(value)) for key, value in _figures(current, synchroniser)]
    )


def _losses(current: Any, shares: list[float], before: Any) -> Iterator[tuple[str, str]]:
    """Yield (topic, description of its losses since the status `before`); shares: valid share of each source."""
    for index, (topic, share) in enumerate(zip(current.sources, shares, strict=True)):
        if share < 1.0:
            yield topic, f"valid {100 * share:.0f} % of the time"
        for word, now, was in (
            ("refused", current.refused, before and before.refused),
            ("late", current.late, before and before.late),
        ):
            if grown := now[index] - (was[index] if was else 0):
                yield topic, f"{grown} samples {word}"


def _figures(current: Any, synchroniser: Synchroniser) -> Iterator[tuple[str, object]]:
    yield "sent", current.sent
    yield "incomplete", current.incomplete
    yield "dropped", current.dropped
    yield "longest delay [ms]", f"{1e3 * current.delay:.1f}"
    yield "restarts", synchroniser.restarts
    for index, (topic, intake) in enumerate(zip(current.sources, synchroniser.intakes, strict=True)):
        yield f"{topic} rate [Hz]", f"{current.rate[index]:.1f}"
        yield f"{topic} samples", current.samples[index]
        yield f"{topic} largest skew [ms]", f"{1e3 * current.skew_max[index]:.3f}"
        yield f"{topic} late", current.late[index]
        for reason, count in intake.refused.copy().items():
            yield f"{topic} {reason}", count


TOPIC = "hric/perception/sync"


def rate_topic(topic: str, rate: float) -> str:
    """Return the topic of synchronised samples at one of several rates, e.g. hric/perception/sync_100hz."""
    return f"{topic}_{f'{rate:g}'.replace('.', '_')}hz"
