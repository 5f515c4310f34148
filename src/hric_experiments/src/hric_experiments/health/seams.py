"""Judges where two parts of a recording meet: their order, and whether a stream goes on without a gap from the one to the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from hric_experiments.health import checks
from hric_experiments.health.checks import NOTE, PROBLEM, Finding
from hric_experiments.health.streams import Stream


@dataclass(frozen=True)
class Seam:
    """Where a part ends and the next one begins.

    Attributes:
        before, after: names of the two bags.
        overlap: how long both recorded; negative: between them neither did [s]. NaN: one of them is empty.
        findings: what is to be told.
    """

    before: str
    after: str
    overlap: float
    findings: list[Finding]

    def render(self, quiet: bool = False) -> str:
        """The seam as text; quiet: its findings only."""
        told = f"recorded together for {self.overlap:.3f} s" if self.overlap >= 0.0 else f"are {-self.overlap:.3f} s apart"
        head = f"\n{self.before} and {self.after}: {'one of them is empty' if np.isnan(self.overlap) else told}\n"
        return ("" if quiet else head) + "".join(f"{f.level}: {f.topic}{': ' if f.topic else ''}{f.text}\n" for f in self.findings)


def of_parts(parts: Sequence[tuple[Path, Sequence[Stream]]]) -> list[Seam]:
    """All seams of a recording; of each part, in their order, its bag and its topics."""
    return [_seam(before[0].name, before[1], after[0].name, after[1]) for before, after in pairwise(parts)]


def _seam(before: str, old: Sequence[Stream], after: str, new: Sequence[Stream]) -> Seam:
    times = [np.concatenate([stream.recorded for stream in streams]) if streams else np.empty(0) for streams in (old, new)]
    if not all(map(len, times)):
        return Seam(before, after, float("nan"), [])
    overlap = float(times[0].max() - times[1].min()) * 1e-9
    found = []
    if times[1].min() < times[0].min():
        found.append(Finding(PROBLEM, "", f"{after} begins before {before}: the parts are not in order"))
    later = {stream.topic: stream for stream in new}
    ended = []
    for stream in old:
        if stream.topic in later:
            found += _stream(stream, later[stream.topic])
        elif checks.is_regular(stream) and float(times[0].max() - stream.recorded.max()) * 1e-9 <= _longest(stream):
            ended.append(stream.topic)
    found += [Finding(NOTE, topic, f"is not in {after}, although it went on to the end of {before}") for topic in ended]
    return Seam(before, after, overlap, found)


def _stream(before: Stream, after: Stream) -> list[Finding]:
    if before.latched:
        return []
    if before.counts:
        return _numbers(before, after)
    if before.stamps is None or after.stamps is None or not checks.is_regular(before):
        return []
    gap = float(after.stamps.min() - before.stamps.max()) * 1e-9
    if gap <= _longest(before):
        return []
    return [Finding(PROBLEM, before.topic, f"a gap of {gap:.3f} s between the parts; its period is {before.period:.4f} s")]


def _numbers(before: Stream, after: Stream) -> list[Finding]:
    if after.first > before.next:
        text = f"{after.first - before.next} {before.counts} are missing between the parts, from number {before.next} on"
        return [Finding(PROBLEM, before.topic, text)]
    if after.first < before.next and after.recorded.min() > before.recorded.max():
        return [Finding(PROBLEM, before.topic, f"the {before.counts} of the two parts overlap in number but not in time: the source began anew")]
    return []


def _longest(stream: Stream) -> float:
    """The longest time between two stamps that is no gap [s]."""
    return max(checks.GAP_FACTOR * stream.period, stream.period + checks.LEAST_GAP)
