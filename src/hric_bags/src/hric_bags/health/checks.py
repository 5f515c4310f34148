"""Checks of a bag for damage and for problems of its streams."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hric_bags.health.bag_records import BagScan
from hric_bags.health.streams import TopicStream
from hric_core.geometry import FloatArray

GAP_FACTOR = 3.0
"""Time between stamps of a regular stream that counts as a gap [median periods]; project default, unconfirmed."""
MIN_GAP = 0.02
"""Smallest excess of the time between stamps over the period that is a gap [s]; project default, unconfirmed."""
REGULAR_SHARE = 0.8
"""Share of periods that must be within 50 % of the median in a regular stream [1]; project default, unconfirmed."""
MIN_MESSAGES = 20
"""Minimum number of messages of a regular stream; fewer count as events; project default, unconfirmed."""
LATE, EARLY = 1.0, 0.1
"""Largest valid time by which a stamp is older (LATE) or younger (EARLY) than its recording [s].

Project defaults, unconfirmed.
"""
JUMP = 1.0
"""Backward step between recording times that counts as a jump of the clock [s]; project default, unconfirmed."""
DAMAGED, PROBLEM, NOTE = "damaged", "problem", "note"


@dataclass(frozen=True)
class HealthFinding:
    """One finding of a health report.

    Attributes:
        level: DAMAGED: readers fail or miss messages; PROBLEM: a stream is faulty; NOTE: information.
        topic: topic concerned; empty: the complete bag.
        text: description of the finding, with place and amount.
    """

    level: str
    topic: str
    text: str

    def __str__(self) -> str:
        return f"{self.level}: {self.topic}{': ' if self.topic else ''}{self.text}"


def is_regular(stream: TopicStream) -> bool:
    """Return True if header stamps are evenly spaced; False for events, latched topics and topics without header."""
    return stream.judged is not None and _are_even(np.diff(np.unique(stream.judged) * 1e-9))


def _are_even(periods: FloatArray) -> bool:
    if len(periods) < MIN_MESSAGES - 1:
        return False
    median = float(np.median(periods))
    return median > 0.0 and float(np.mean(np.abs(periods - median) < 0.5 * median)) >= REGULAR_SHARE


def of_file(scan: BagScan) -> list[HealthFinding]:
    """Return findings on damage of a file; scan: scan of which all messages were read."""
    return [HealthFinding(DAMAGED, "", text) for text in scan.damage]


def of_streams(streams: list[TopicStream]) -> list[HealthFinding]:
    """Return findings on problems of the streams of a bag."""
    offset = _clock_offset(streams)
    findings = [] if streams else [HealthFinding(PROBLEM, "", "the bag has no messages")]
    if abs(offset) > LATE:
        findings.append(
            HealthFinding(NOTE, "", f"header stamps and recording times are on different clocks, {offset:+.3f} s apart")
        )
    for stream in streams:
        problems = (*_numbers(stream), *_gaps(stream), *_order(stream), *_clock(stream, offset))
        findings += [HealthFinding(PROBLEM, stream.topic, text) for text in problems]
    return findings


def _numbers(stream: TopicStream) -> Iterator[str]:
    spans_by_word = {"are missing": stream.missing, "are repeated, or the source restarted": stream.repeated}
    for word, spans in spans_by_word.items():
        if spans:
            count, (first, length) = sum(count for _, count in spans), spans[0]
            yield f"{count} {stream.counts} {word}, first {length} from number {first} on"


def _gaps(stream: TopicStream) -> Iterator[str]:
    """Yield a text on gaps in the header stamps of a stream whose messages have no running number."""
    if stream.counts or stream.judged is None or len(stream.judged) < MIN_MESSAGES:
        return
    stamps, first = np.unique(stream.judged, return_index=True)
    periods, idle = np.diff(stamps * 1e-9), stream.idle[first][:-1]
    if not len(periods):
        yield f"all {len(stream.judged)} stamps are equal"
    for mode in (idle, ~idle):
        if not _are_even(periods[mode]):
            continue
        median = float(np.median(periods[mode]))
        gaps = np.flatnonzero(mode & (periods > longest_period(median)))
        if len(gaps):
            longest = gaps[np.argmax(periods[gaps])]
            yield (
                f"{len(gaps)} gap{'s' * (len(gaps) > 1)}, the longest {periods[longest]:.3f} s from "
                f"{(stamps[longest] - stamps[0]) * 1e-9:.3f} s on; the stream's period is {median:.4f} s"
            )


def longest_period(period: float) -> float:
    """Return the longest time between two stamps that is not a gap [s]; period: median period of the stream [s]."""
    return max(GAP_FACTOR * period, period + MIN_GAP)


def _order(stream: TopicStream) -> Iterator[str]:
    """Yield a text on stamps that go back, per publisher: several nodes on one topic have no common order."""
    if stream.judged is None:
        return
    its = "" if len(stream.publishers) == 1 else "its "
    for index, name in enumerate(stream.publishers):
        steps = np.diff(stream.judged[stream.published_by == index])
        back = np.flatnonzero(steps < 0)
        if len(back):
            many = f"{len(back)} stamps are" if len(back) > 1 else "1 stamp is"
            text = f"{many} older than the one before, the first at {its}message {back[0] + 1}"
            publisher = f"; published by {name}" if name else ""
            yield f"{text}, by up to {-steps.min() * 1e-9:.3f} s{publisher}"


def _clock(stream: TopicStream, offset: float) -> Iterator[str]:
    back = np.diff(stream.recorded) * 1e-9
    if len(back) and back.min() < -JUMP:
        at = int(np.argmin(back)) + 1
        yield f"the clock of the recording went back by {-back.min():.3f} s at message {at}"
    if stream.judged is None:
        return
    age = (stream.recorded - stream.judged) * 1e-9 - offset
    zero = (stream.judged == 0) & (stream.recorded * 1e-9 - offset > JUMP)
    if zero.any():
        yield f"{int(zero.sum())} messages have no stamp (0)"
    wrong = ~zero & ((age > LATE) | (age < -EARLY))
    if wrong.any():
        worst = float(age[wrong][np.argmax(np.abs(age[wrong]))])
        relation = "older" if worst > 0 else "younger"
        yield f"{int(wrong.sum())} stamps are {relation} than their recording by up to {abs(worst):.3f} s"


def _clock_offset(streams: list[TopicStream]) -> float:
    """Return the median offset of the recording clock from the stamps of all topics [s]; 0: the same clock."""
    medians = [
        float(np.median((stream.recorded - stream.judged) * 1e-9))
        for stream in streams
        if stream.judged is not None and len(stream.judged)
    ]
    typical = float(np.median(medians)) if medians else 0.0
    return typical if abs(typical) > LATE else 0.0
