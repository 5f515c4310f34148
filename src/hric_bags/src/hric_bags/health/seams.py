"""Checks of seams, where one part of a recording follows another: order of the parts, gaps between them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from hric_bags.health import checks
from hric_bags.health.checks import NOTE, PROBLEM, HealthFinding
from hric_bags.health.streams import TopicStream


@dataclass(frozen=True)
class Seam:
    """Transition from one part of a recording to the next.

    Attributes:
        before, after: names of the two parts' files.
        overlap: time that both parts recorded [s]; negative: gap between them; NaN: one of them is empty.
        findings: problems of the transition.
    """

    before: str
    after: str
    overlap: float
    findings: list[HealthFinding]

    def render(self, quiet: bool = False) -> str:
        """Return the report on the seam as text; quiet: True for the findings only."""
        relation = (
            f"recorded together for {self.overlap:.3f} s" if self.overlap >= 0.0 else f"are {-self.overlap:.3f} s apart"
        )
        head = f"\n{self.before} and {self.after}: {'one of them is empty' if np.isnan(self.overlap) else relation}\n"
        return ("" if quiet else head) + "".join(f"{finding}\n" for finding in self.findings)


def of_parts(parts: Sequence[tuple[Path, Sequence[TopicStream]]]) -> list[Seam]:
    """Return all seams of a recording; parts: (path, topics) of each part, in order."""
    return [_seam(before[0].name, before[1], after[0].name, after[1]) for before, after in pairwise(parts)]


def _seam(before: str, old: Sequence[TopicStream], after: str, new: Sequence[TopicStream]) -> Seam:
    times = [
        np.concatenate([stream.recorded for stream in streams]) if streams else np.empty(0) for streams in (old, new)
    ]
    if not all(map(len, times)):
        return Seam(before, after, float("nan"), [])
    overlap = float(times[0].max() - times[1].min()) * 1e-9
    findings = []
    if times[1].min() < times[0].min():
        findings.append(HealthFinding(PROBLEM, "", f"{after} begins before {before}: the parts are not in order"))
    later = {stream.topic: stream for stream in new}
    notes = []
    for stream in old:
        if stream.topic in later:
            findings += [HealthFinding(PROBLEM, stream.topic, text) for text in _problems(stream, later[stream.topic])]
            continue
        rest = float(times[0].max() - stream.recorded.max()) * 1e-9
        if checks.is_regular(stream) and rest <= checks.longest_period(stream.period):
            text = f"is not in {after}, although it went on to the end of {before}"
            notes.append(HealthFinding(NOTE, stream.topic, text))
    return Seam(before, after, overlap, findings + notes)


def _problems(before: TopicStream, after: TopicStream) -> Iterator[str]:
    """Yield texts on missing running numbers, or on a gap, of one topic between two parts."""
    if before.latched:
        return
    if before.counts and after.first > before.next:
        yield f"{after.first - before.next} {before.counts} are missing between the parts, from number {before.next} on"
    elif before.counts and after.first < before.next and after.recorded.min() > before.recorded.max():
        yield f"the {before.counts} of both parts overlap in number but not in time: the source restarted"
    elif before.counts or before.idle[-1]:
        return
    elif before.stamps is not None and after.stamps is not None and checks.is_regular(before):
        gap = float(after.stamps.min() - before.stamps.max()) * 1e-9
        if gap > checks.longest_period(before.period):
            yield f"a gap of {gap:.3f} s between the parts; the stream's period is {before.period:.4f} s"
