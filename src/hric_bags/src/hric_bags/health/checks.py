"""Judges what was found in a bag: damage, and problems of its streams."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hric_bags.health.bag_records import BagScan
from hric_bags.health.streams import Stream

GAP_FACTOR = 3.0
"""A regular stream has a gap where two stamps are further apart than this many of its periods; project default,
unconfirmed [1]."""
MIN_GAP = 0.02
"""And at least by this beyond a period; project default, unconfirmed [s]."""
REGULAR_SHARE = 0.8
"""A stream is regular where this share of its periods is within half of the median; project default, unconfirmed
[1]."""
MIN_MESSAGES = 20
"""Below this number a stream is taken for events; project default, unconfirmed [1]."""
LATE, EARLY = 1.0, 0.1
"""A stamp is wrong that is older than the recording by more than LATE, or younger by more than EARLY; project default,
unconfirmed [s]."""
JUMP = 1.0
"""The clock went back where a message was recorded this much before the one before it; project default, unconfirmed
[s]."""
DAMAGED, PROBLEM, NOTE = "damaged", "problem", "note"


@dataclass(frozen=True)
class Finding:
    """One thing that a report lists.

    Attributes:
        level: DAMAGED: readers fail, or miss something; PROBLEM: a stream is not as it should be; NOTE: worth knowing.
        topic: empty: the whole bag.
        text: what, where, how much.
    """

    level: str
    topic: str
    text: str

    def __str__(self) -> str:
        return f"{self.level}: {self.topic}{': ' if self.topic else ''}{self.text}"


def is_regular(stream: Stream) -> bool:
    """Whether messages come evenly, by their header stamps; false of events, and of what is latched or has no
    header."""
    if stream.judged is None or len(stream.judged) < MIN_MESSAGES:
        return False
    periods = np.diff(np.unique(stream.judged) * 1e-9)
    median = float(np.median(periods)) if len(periods) else 0.0
    return median > 0.0 and float(np.mean(np.abs(periods - median) < 0.5 * median)) >= REGULAR_SHARE


def of_file(scan: BagScan) -> list[Finding]:
    """Return the damage of the file; scan: after its pass."""
    return [Finding(DAMAGED, "", text) for text in scan.damage]


def of_streams(streams: list[Stream]) -> list[Finding]:
    """Problems of the streams of a bag."""
    offset = _clock_offset(streams)
    found = []
    if abs(offset) > LATE:
        found.append(Finding(NOTE, "", f"stamps and times of recording are on different clocks, {offset:+.3f} s apart"))
    for stream in streams:
        problems = (*_numbers(stream), *_gaps(stream), *_order(stream), *_clock(stream, offset))
        found += [Finding(PROBLEM, stream.topic, text) for text in problems]
    return found


def _numbers(stream: Stream) -> Iterator[str]:
    spans_by_word = {"are missing": stream.missing, "came twice, or the source began again": stream.repeated}
    for word, spans in spans_by_word.items():
        if spans:
            count, (first, length) = sum(count for _, count in spans), spans[0]
            yield f"{count} {stream.counts} {word}, first {length} from number {first} on"


def _gaps(stream: Stream) -> Iterator[str]:
    """Gaps of a stream without running number, by its stamps."""
    if stream.counts or stream.judged is None or len(stream.judged) < MIN_MESSAGES:
        return
    stamps = np.unique(stream.judged) * 1e-9
    periods = np.diff(stamps)
    if not len(periods):
        yield f"all {len(stream.judged)} stamps are the same"
    elif is_regular(stream):
        median = float(np.median(periods))
        gaps = np.flatnonzero(periods > longest_period(median))
        if len(gaps):
            longest = gaps[np.argmax(periods[gaps])]
            yield (
                f"{len(gaps)} gap{'s' * (len(gaps) > 1)}, the longest {periods[longest]:.3f} s from "
                f"{stamps[longest] - stamps[0]:.3f} s on; its period is {median:.4f} s"
            )


def longest_period(period: float) -> float:
    """The longest time between two stamps that is no gap [s]; period: of the stream [s]."""
    return max(GAP_FACTOR * period, period + MIN_GAP)


def _order(stream: Stream) -> Iterator[str]:
    """Stamps that go back, of each publisher for itself: nobody puts the messages of several nodes on one topic into an
    order."""
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


def _clock(stream: Stream, offset: float) -> Iterator[str]:
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


def _clock_offset(streams: list[Stream]) -> float:
    """How far the clock of the recording is from that of the stamps: the median of all topics [s]; 0 where they are the
    same."""
    medians = [
        float(np.median((stream.recorded - stream.judged) * 1e-9))
        for stream in streams
        if stream.judged is not None and len(stream.judged)
    ]
    typical = float(np.median(medians)) if medians else 0.0
    return typical if abs(typical) > LATE else 0.0
