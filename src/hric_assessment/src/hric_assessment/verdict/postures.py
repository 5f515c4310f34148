"""Findings of postures: RULA and REBA of each arm over the recording.

A finding is judged by the worse end of its scores, where uncertain angles give several. It is within limits, or a
warning, only where it would be so with the worst score at all times and of all angles that are not known.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from hric_assessment.ergonomics import reba, rula
from hric_assessment.ergonomics.posture import ANGLES, Posture, Task
from hric_assessment.ergonomics.scoring import Scores, needed
from hric_assessment.evidence import Evidence
from hric_assessment.findings import Finding, Outcome
from hric_assessment.tables import PostureTable, RulaTable, VerdictTable, reba_table, rula_table, verdict_table
from hric_assessment.verdict.person import Person
from hric_assessment.verdict.posture_input import posture_of, rounded, spread_of, task_of
from hric_assessment.verdict.result import thinned
from hric_bags.records.human_record import HumanRecord
from hric_control.geometry import FloatArray

GROUP = "posture"
BLOCK = 10_000
"""Instants that are scored at once: arrays of some MB."""
UNSEEN = ("shoulder_elevation",)
"""Angles that no body here has a joint for; a verdict does not wait for them."""
CURVES = ("score", "stricter", "looser")
INCLINATION = ("trunk_flexion", "trunk_bend")
"""Angles that are to the pelvis where the orientation of the root is not known."""
REMEDIES = {
    "knee": "record the joints of the legs (parts: whole_body)",
    "neck": "record the joints of neck and trunk (parts: upper_body)",
    "inclination": "record where the root link of the body is (human/root, person/tracking, a static transform from "
    "world to human_base), or assess the run folder",
    "": "record all joints of the arm, neck and trunk (parts: upper_body)",
}
"""Remedies by the beginning of what is not known."""
IntArray = np.ndarray[Any, np.dtype[np.int64]]
T = TypeVar("T", Posture, Task)


@dataclass(frozen=True)
class Scored:
    """Scores of one arm over time.

    Attributes:
        table: RULA's or REBA's.
        method: its name and version.
        side: side of the arm.
        time: shape (n,) [s].
        curves: score, stricter, looser, lowest, highest and worst, shape (n,) each; worst: highest with the angles
            that are not known where they score most.
        assumptions: assumptions of all blocks.
        reasons: steps of an instant with the score that counts.
        uncertain: those of them that the uncertainty of an angle decides.
        unknown: what the table needs, and is not known at any time.
        vertical: True if the inclination of the trunk is to the vertical, False if to the pelvis.
        evidence: time for which all other angles are known.
    """

    table: PostureTable
    method: str
    side: str
    time: FloatArray
    curves: Mapping[str, IntArray]
    assumptions: tuple[str, ...]
    reasons: tuple[str, ...]
    uncertain: tuple[str, ...]
    unknown: tuple[str, ...]
    vertical: bool
    evidence: Evidence

    @property
    def counts(self) -> int:
        """Score that counts: the worse end."""
        return self.lasting("highest")

    @property
    def worst(self) -> int:
        """Score that counts with all that is not known, angles and times, at its worst."""
        gaps = self.evidence.asked - self.evidence.known
        return self.lasting("worst", gaps)

    def lasting(self, curve: str, gaps: float = 0.0) -> int:
        """Return the score of a curve that counts; gaps: time with the highest score there is [s]."""
        seconds = verdict_table()["lasting"] - gaps
        if seconds <= 0.0:
            return int(list(self.table.levels)[-1])
        return lasting(self.time, self.curves[curve], seconds)

    def timeline(self) -> dict[str, Any]:
        """Return the curves for the JSON."""
        rows = thinned(self.time, *(self.curves[name].astype(np.float64) for name in CURVES))
        shown = {name: self.curves[name][rows].tolist() for name in CURVES}
        return {"side": self.side, "time": self.time[rows].tolist(), **shown}


def scored(
    person: Person, record: HumanRecord | None, window: tuple[float, float], version: str = rula.VERSIONS[0]
) -> list[Scored]:
    """Return RULA and REBA of each arm; none of a person without an instant.

    Args:
        person: the person.
        record: grips of a simulated human; None: not recorded.
        window: begin and end of the recording [s].
        version: version of RULA's table A.
    """
    sides = person.sides if len(person.time) else ()
    return [_scored(table, person, record, side, window, version) for side in sides for table in _tables()]


def _tables() -> tuple[PostureTable, ...]:
    return rula_table(), reba_table()


def _scored(
    table: PostureTable,
    person: Person,
    record: HumanRecord | None,
    side: str,
    window: tuple[float, float],
    version: str,
) -> Scored:
    posture, vertical = posture_of(person, side)
    task = task_of(person, record, posture, side, table)
    unknown, known = _known(posture, table, len(person.time))
    inclined = () if vertical or INCLINATION[0] in unknown else INCLINATION
    spread = spread_of(person, side)
    worst = {**spread, **dict.fromkeys((*unknown, *inclined), np.inf)}
    posture = rounded(posture)

    def of(rows: slice | IntArray, spread: Mapping[str, float]) -> Scores:
        one, use = _rows(posture, rows), _rows(task, rows)
        if isinstance(table, RulaTable):
            return rula.score(one, use, version, table, spread)
        return reba.score(one, use, reba_table(), spread)

    n = len(person.time)
    blocks = [slice(begin, min(begin + BLOCK, n)) for begin in range(0, n, BLOCK)]
    parts = [of(block, spread) for block in blocks]
    curves = {name: _joined([getattr(part, name) for part in parts], blocks) for name in (*CURVES, "lowest", "highest")}
    curves["worst"] = curves["highest"]
    if worst != spread:
        curves["worst"] = _joined([of(block, worst).highest for block in blocks], blocks)
    counts = lasting(person.time, curves["highest"], verdict_table()["lasting"])
    at = of(np.flatnonzero(curves["highest"] >= counts)[:1], spread)
    return Scored(
        table,
        parts[0].method,
        side,
        person.time,
        curves,
        tuple(dict.fromkeys(line for part in parts for line in part.assumptions)),
        tuple(at.reasons(0)),
        tuple(at.uncertain(0)),
        (*(f"the angle {name}" for name in unknown), *(("inclination of the trunk",) if inclined else ())),
        vertical,
        Evidence.of(person.time, known, window, verdict_table()["max_gap"]),
    )


def _known(posture: Posture, table: PostureTable, count: int) -> tuple[list[str], np.ndarray[Any, np.dtype[np.bool_]]]:
    """Return the angles that a table needs and that are never known, and at which instants all others are, (n,)."""
    never, known = [], np.ones(count, np.bool_)
    for name in needed(table):
        if name in ANGLES and name not in UNSEEN:
            finite = np.isfinite(np.nan if getattr(posture, name) is None else getattr(posture, name))
            if finite.any():
                known &= finite
            else:
                never.append(name)
    return never, known


def _rows(values: T, rows: slice | IntArray) -> T:
    """Return some instants of a posture or a task."""
    arrays = {field.name: getattr(values, field.name) for field in fields(values)}
    return replace(values, **{name: array[rows] for name, array in arrays.items() if isinstance(array, np.ndarray)})


def _joined(values: list[IntArray], blocks: list[slice]) -> IntArray:
    """Return the values of all blocks, some of which have one value for all of their instants, shape (n,)."""
    each = zip(values, blocks, strict=True)
    return np.concatenate([np.broadcast_to(value, block.stop - block.start) for value, block in each])


def lasting(time: FloatArray, score: IntArray, seconds: float) -> int:
    """Return the highest score that is reached or exceeded for so long, all stretches together; of a shorter recording
    its highest.

    Args:
        time: shape (n,) [s].
        score: shape (n,).
        seconds: [s].
    """
    period = _periods(time)
    if period.sum() < seconds - 1e-9:
        return int(score.max())
    return next(
        value
        for value in range(int(score.max()), int(score.min()) - 1, -1)
        if period[score >= value].sum() >= seconds - 1e-9
    )


def _periods(time: FloatArray) -> FloatArray:
    """Return the time of each sample, shape (n,) [s]."""
    return np.gradient(time) if len(time) > 1 else np.zeros(len(time))


def posture_finding(scores: Scored, person: Person) -> Finding:
    """Return the finding of the scores of one arm."""
    table = verdict_table()
    outcome, reason = _judged(scores, table)
    lacking = outcome == Outcome.NOT_ASSESSABLE
    return Finding(
        f"{scores.table.title} of the {scores.side} arm",
        outcome,
        reason,
        scores.method,
        None,
        _values(scores),
        _longest(scores),
        person.signals,
        scores.unknown,
        _notes(scores, table),
        GROUP,
        evidence=scores.evidence,
        remedy="; ".join(_remedies(scores)) if lacking else "",
    )


def _judged(scores: Scored, table: VerdictTable) -> tuple[Outcome, str]:
    name = scores.table.title.lower()
    within, warning = (table.values[f"{name}_{what}"] for what in ("within", "warning"))

    def graded(score: int) -> Outcome:
        return (
            Outcome.ABOVE if score > warning.value else Outcome.WARNING if score > within.value else Outcome.WITHIN
        )

    counts, worst, better = scores.counts, scores.worst, scores.lasting("lowest")
    band = f"{counts}" if better == counts else f"{better} to {counts}"
    reason = f"score {band}: {scores.table.level(counts)}"
    if better != counts:
        reason += f", decided by {', '.join(scores.uncertain)}"
    reason += f"; up to {within.value:g} is within limits, up to {warning.value:g} a warning ({table.mark_of(within)})"
    outcome = graded(counts)
    if outcome != Outcome.ABOVE and graded(worst) != outcome:
        lacks = [f"{what} is not known" for what in scores.unknown]
        lacks += [f"the posture is {scores.evidence.shortfall}"] if scores.evidence.shortfall else []
        return Outcome.NOT_ASSESSABLE, f"{reason}; it can be up to {worst}: {'; '.join(lacks)}"
    return outcome, reason


def _remedies(scores: Scored) -> list[str]:
    """Return how to get what is not known."""
    names = [what.removeprefix("the angle ") for what in scores.unknown]
    remedies = dict.fromkeys(
        next(remedy for begin, remedy in REMEDIES.items() if name.startswith(begin)) for name in names
    )
    gap = f"record the person's joint states over the whole recording, without gaps above {scores.evidence.max_gap:g} s"
    return [*remedies, *([gap] if scores.evidence.shortfall else [])]


def _notes(scores: Scored, table: VerdictTable) -> tuple[str, ...]:
    trunk = "to the vertical" if scores.vertical else "to the pelvis, whose inclination is not known"
    static = f"range of angles up to {table['held']:g} deg for more than {scores.table.static_time:g} s"
    if scores.evidence.asked <= scores.table.static_time:
        static += f": not judged beyond this recording of {scores.evidence.asked:.1f} s, and 1 more where it goes on"
    chosen = (f"{name} {threshold.value:g} deg" for name, threshold in scores.table.chosen.items())
    return (
        f"counts: the highest score that is reached for {table['lasting']:g} s, all stretches together "
        f"({table.mark_of(table.lasting)}); at its first instant: {'; '.join(scores.reasons) or 'nothing adds to it'}",
        f"angles are rounded to {table['angle']:g} deg ({table.mark_of(table.angle)}): no body is known better",
        f"inclination of the trunk: {trunk}; of the neck: to the trunk",
        f"static use: {static}; repeated use: there and back by more than {table['held']:g} deg, in any minute "
        f"({table.mark_of(table.held)})",
        f"thresholds chosen here: {'; '.join(chosen)}",
        f"assumed: {'; '.join(scores.assumptions)}",
    )


def _values(scores: Scored) -> dict[str, float | None]:
    period, score = _periods(scores.time), scores.curves["score"]
    total = max(float(period.sum()), 1e-12)
    bounds = [0, *(int(highest) for highest in scores.table.levels)]
    shares = {
        f"share of time at {low + 1} to {high} [1]": float(period @ ((score > low) & (score <= high))) / total
        for low, high in pairwise(bounds)
    }
    return {
        "score that counts": float(scores.counts),
        "score that counts, better end": float(scores.lasting("lowest")),
        "score that counts, unknown at its worst": float(scores.worst),
        "largest score": float(score.max()),
        "mean score": float((score * period).sum() / total),
        "score that counts, chosen thresholds 5 deg smaller": float(scores.lasting("stricter")),
        "score that counts, chosen thresholds 5 deg larger": float(scores.lasting("looser")),
        **shares,
    }


def _longest(scores: Scored) -> tuple[float, float]:
    """Return the longest stretch with the score that counts, or a higher one [s]."""
    rows = np.flatnonzero(scores.curves["highest"] >= scores.counts)
    groups = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    group = max(groups, key=lambda rows: scores.time[rows[-1]] - scores.time[rows[0]])
    return float(scores.time[group[0]]), float(scores.time[group[-1]])
