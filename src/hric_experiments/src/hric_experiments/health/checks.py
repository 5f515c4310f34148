"""Judges what was found in a bag: damage, and problems of its streams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hric_experiments.health.bag_records import BagScan
from hric_experiments.health.streams import FloatArray, Stream

GAP_FACTOR = 3.0
"""A regular stream has a gap where two stamps are further apart than this many of its periods; our choice [1]."""
LEAST_GAP = 0.02
"""And at least by this beyond a period; our choice [s]."""
REGULAR_SHARE = 0.8
"""A stream is regular where this share of its periods is within half of the median; our choice [1]."""
LEAST_MESSAGES = 20
"""Below this number a stream is taken for events; our choice [1]."""
LATE, EARLY = 1.0, 0.1
"""A stamp is wrong that is older than the recording by more than LATE, or younger by more than EARLY; our choice [s]."""
JUMP = 1.0
"""The clock went back where a message was recorded this much before the one before it; our choice [s]."""
DAMAGED, PROBLEM, NOTE = "damaged", "problem", "note"


@dataclass(frozen=True)
class Finding:
    """One thing that is to be told.

    Attributes:
        level: DAMAGED: readers fail, or miss something; PROBLEM: a stream is not as it should be; NOTE: worth knowing.
        topic: empty: the whole bag.
        text: what, where, how much.
    """

    level: str
    topic: str
    text: str


def is_regular(stream: Stream) -> bool:
    """Whether messages come evenly, by their header stamps; false of events, and of what is latched or has no header."""
    if stream.stamps is None or len(stream.stamps) < LEAST_MESSAGES or stream.latched:
        return False
    periods = np.diff(np.unique(stream.stamps) * 1e-9)
    median = float(np.median(periods)) if len(periods) else 0.0
    return median > 0.0 and float(np.mean(np.abs(periods - median) < 0.5 * median)) >= REGULAR_SHARE


def of_file(scan: BagScan) -> list[Finding]:
    """Damage of the file; `scan` after its pass."""
    told = []
    if scan.open_chunk is not None:
        told.append(f"the last chunk was not closed ({scan.open_chunk} bytes of it are there): the recorder was killed")
    if scan.truncated:
        told.append("the file ends within a record: it was cut off")
    for offset in scan.unreadable:
        told.append(f"the chunk at byte {offset} is damaged; what follows its damage is lost")
    if not scan.indexed:
        told.append("it has no index: readers cannot open it")
    return [Finding(DAMAGED, "", text) for text in told]


def of_streams(streams: list[Stream]) -> list[Finding]:
    """Problems of the streams of a bag."""
    offset = _clock_offset(streams)
    found = []
    if abs(offset) > LATE:
        found.append(Finding(NOTE, "", f"stamps and times of recording are on different clocks, {offset:+.3f} s apart"))
    found += [finding for stream in streams for finding in (*_numbers(stream), *_gaps(stream), *_order(stream), *_clock(stream, offset))]
    return found


def _numbers(stream: Stream) -> list[Finding]:
    return [
        Finding(PROBLEM, stream.topic, f"{sum(count for _, count in spans)} {stream.counts} {word}, first {spans[0][1]} from number {spans[0][0]} on")
        for word, spans in (("are missing", stream.missing), ("came twice, or the source began anew", stream.repeated))
        if spans
    ]


def _gaps(stream: Stream) -> list[Finding]:
    """Gaps of a stream without running number, by its stamps."""
    if stream.counts or stream.stamps is None or len(stream.stamps) < LEAST_MESSAGES or stream.latched:
        return []
    stamps = np.unique(stream.stamps) * 1e-9
    periods = np.diff(stamps)
    if not len(periods):
        return [Finding(PROBLEM, stream.topic, f"all {len(stream.stamps)} stamps are the same")]
    if not is_regular(stream):
        return []
    median = float(np.median(periods))
    gaps = np.flatnonzero(periods > max(GAP_FACTOR * median, median + LEAST_GAP))
    if not len(gaps):
        return []
    longest = gaps[np.argmax(periods[gaps])]
    at = stamps[longest] - stamps[0]
    text = f"{len(gaps)} gap{'s' * (len(gaps) > 1)}, the longest {periods[longest]:.3f} s from {at:.3f} s on; its period is {median:.4f} s"
    return [Finding(PROBLEM, stream.topic, text)]


def _order(stream: Stream) -> list[Finding]:
    """Stamps that go back, of each publisher for itself: nobody puts the messages of several nodes on one topic into an order."""
    if stream.stamps is None or stream.latched:
        return []
    found = []
    for index, name in enumerate(stream.publishers):
        steps = np.diff(stream.stamps[stream.published_by == index])
        back = np.flatnonzero(steps < 0)
        if not len(back):
            continue
        many = f"{len(back)} stamps are" if len(back) > 1 else "1 stamp is"
        message = f"message {back[0] + 1}" if len(stream.publishers) == 1 else f"its message {back[0] + 1}"
        text = f"{many} older than the one before, the first at {message}, by up to {-steps.min() * 1e-9:.3f} s"
        found.append(Finding(PROBLEM, stream.topic, text if not name else f"{text}; published by {name}"))
    return found


def _clock(stream: Stream, offset: float) -> list[Finding]:
    found = []
    back = np.diff(stream.recorded) * 1e-9
    if len(back) and back.min() < -JUMP:
        at = int(np.argmin(back)) + 1
        found.append(Finding(PROBLEM, stream.topic, f"the clock of the recording went back by {-back.min():.3f} s at message {at}"))
    if stream.stamps is None or stream.latched:
        return found
    age = _ages(stream) - offset
    zero = (stream.stamps == 0) & (stream.recorded * 1e-9 - offset > JUMP)
    if zero.any():
        found.append(Finding(PROBLEM, stream.topic, f"{int(zero.sum())} messages have no stamp (0)"))
    wrong = ~zero & ((age > LATE) | (age < -EARLY))
    if wrong.any():
        worst = float(age[wrong][np.argmax(np.abs(age[wrong]))])
        text = f"{int(wrong.sum())} stamps are {'older' if worst > 0 else 'younger'} than their recording by up to {abs(worst):.3f} s"
        found.append(Finding(PROBLEM, stream.topic, text))
    return found


def _ages(stream: Stream) -> FloatArray:
    """Time of recording minus stamp, shape (n,) [s]; the stream must have stamps."""
    assert stream.stamps is not None
    return np.asarray((stream.recorded - stream.stamps) * 1e-9, dtype=float)


def _clock_offset(streams: list[Stream]) -> float:
    """How far the clock of the recording is from that of the stamps: the median of all topics [s]; 0 where they are the same."""
    medians = [float(np.median(_ages(stream))) for stream in streams if stream.stamps is not None and not stream.latched and len(stream.stamps)]
    typical = float(np.median(medians)) if medians else 0.0
    return typical if abs(typical) > LATE else 0.0
