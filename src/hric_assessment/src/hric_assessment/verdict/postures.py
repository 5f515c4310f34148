"""Findings of postures: RULA and REBA of each arm over the recording."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from hric_assessment.ergonomics import reba, rula
from hric_assessment.ergonomics.posture import ANGLES, Posture, Task, of_joints
from hric_assessment.ergonomics.scoring import Scores, needed
from hric_assessment.findings import Finding, Outcome
from hric_assessment.tables import PostureTable, VerdictTable, reba_table, rula_table, verdict_table
from hric_assessment.verdict.person import Person
from hric_assessment.verdict.result import thinned
from hric_bags.records.human_record import HumanRecord
from hric_control.geometry import FloatArray
from hric_human.control.kinematics import GRAVITY

GROUP = "posture"
BLOCK = 10_000
"""Instants that are scored at once: arrays of some MB."""
UNSEEN = ("shoulder_elevation",)
"""Angles that no body here has a joint for; a verdict does not wait for them."""
Score = Callable[[Posture, Task], Scores]
IntArray = np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True)
class Scored:
    """Scores of one arm over time.

    Attributes:
        method: RULA or REBA.
        side: of the arm.
        time: shape (n,) [s].
        score, stricter, looser: shape (n,).
        assumptions: of all blocks.
        chosen: thresholds that no source has.
        reasons: of an instant with the score that counts.
        unknown: angles that the table needs, and that are not known for most of the time.
        counts: the score that counts.
    """

    method: str
    side: str
    time: FloatArray
    score: IntArray
    stricter: IntArray
    looser: IntArray
    assumptions: tuple[str, ...]
    chosen: tuple[str, ...]
    reasons: tuple[str, ...]
    unknown: tuple[str, ...]
    counts: int

    def timeline(self) -> dict[str, Any]:
        """For the JSON."""
        rows = thinned(self.time, *(getattr(self, name).astype(np.float64) for name in ("score", "stricter", "looser")))
        curves = {name: getattr(self, name)[rows].tolist() for name in ("score", "stricter", "looser")}
        return {"side": self.side, "time": self.time[rows].tolist(), **curves}


def scored(person: Person, record: HumanRecord | None) -> list[Scored]:
    """RULA and REBA of each arm."""
    found = []
    for side in person.sides:
        load = _load(person, record, side)
        for method, score, table in (("RULA", rula.score, rula_table()), ("REBA", reba.score, reba_table())):
            found.append(_scored(method, score, table, person, side, load))
    return found


def _load(person: Person, record: HumanRecord | None, side: str) -> FloatArray | None:
    """Force on a hand over g at the instants of the joint states, shape (n,) [kg]; None: nothing says it."""
    segment = person.body.segments.get(f"{side}_hand")
    if record is None or segment is None or not record.grips:
        return None
    total = np.zeros(len(person.time))
    for grip in record.grips.values():
        for body in (grip.holder, grip.held):
            if body.rpartition("::")[2] == segment.link:
                force = np.linalg.norm(grip.force, axis=1)
                total += np.interp(person.time, grip.time, force, 0.0, 0.0) / float(np.linalg.norm(GRAVITY))
    return total


def _scored(
    method: str, score: Score, table: PostureTable, person: Person, side: str, load: FloatArray | None
) -> Scored:
    n, step = len(person.time), verdict_table()["angle"]
    blocks = [slice(begin, min(begin + BLOCK, n)) for begin in range(0, n, BLOCK)]

    def of(rows: slice | IntArray) -> Scores:
        q = np.radians(step * np.round(np.degrees(person.q[rows]) / step))
        return score(of_joints(person.names, q, side), Task(load=None if load is None else load[rows]))

    parts = [of(block) for block in blocks]
    values = {
        name: np.concatenate([_rows(getattr(p, name), b) for p, b in zip(parts, blocks, strict=True)])
        for name in ("score", "stricter", "looser")
    }
    counts = lasting(person.time, values["score"], verdict_table()["lasting"])
    at = of(np.flatnonzero(values["score"] >= counts)[:1])
    unknown = _unknown(of_joints(person.names, person.q, side), table)
    assumptions = dict.fromkeys(line for part in parts for line in part.assumptions)
    return Scored(
        parts[0].method,
        side,
        person.time,
        values["score"],
        values["stricter"],
        values["looser"],
        tuple(assumptions),
        tuple(f"{name} {chosen.value:g} deg" for name, chosen in table.chosen.items()),
        tuple(at.reasons(0)),
        tuple(unknown),
        counts,
    )


def _unknown(posture: Posture, table: PostureTable) -> list[str]:
    """Angles that a table needs, and that are not known for most of the time."""
    found = []
    for name in needed(table):
        angle = getattr(posture, name)
        if name in ANGLES and name not in UNSEEN:
            known = 0.0 if angle is None else float(np.isfinite(angle).mean())
            found += [name] if known < verdict_table()["known"] else []
    return found


def _rows(values: IntArray, block: slice) -> IntArray:
    """Of one value the same for all of a block."""
    return np.broadcast_to(values, block.stop - block.start)


def lasting(time: FloatArray, score: IntArray, seconds: float) -> int:
    """The highest score that is reached or exceeded for so long, all stretches together; of a shorter recording its
    lowest.

    Args:
        time: shape (n,) [s].
        score: shape (n,).
        seconds: [s].
    """
    period = _periods(time)
    for one in range(int(score.max()), int(score.min()), -1):
        if period[score >= one].sum() >= seconds - 1e-9:
            return one
    return int(score.min())


def _periods(time: FloatArray) -> FloatArray:
    """Time of each sample, shape (n,) [s]."""
    return np.gradient(time) if len(time) > 1 else np.zeros(len(time))


def posture_finding(one: Scored, person: Person) -> Finding:
    """Held against the levels."""
    table = verdict_table()
    values, window = _values(one, table), _longest(one)
    outcome, reason = _judged(one, table)
    shown = rula_table() if one.method.startswith("RULA") else reba_table()
    notes = (
        f"counts: the highest score that is reached for {table['lasting']:g} s, all stretches together "
        f"({table.mark_of(table.lasting)}); at its first instant: {'; '.join(one.reasons) or 'nothing adds to it'}",
        f"angles are rounded to {table['angle']:g} deg ({table.mark_of(table.angle)}): no body is known better",
        f"thresholds chosen here: {'; '.join(one.chosen)}",
        f"assumed: {'; '.join(one.assumptions)}",
    )
    missing = tuple(f"the angle {name}" for name in one.unknown)
    return Finding(
        f"{one.method.split(' ')[0]} of the {one.side} arm",
        outcome,
        reason,
        one.method or shown.name,
        None,
        values,
        window,
        person.signals,
        missing,
        notes,
        GROUP,
    )


def _judged(one: Scored, table: VerdictTable) -> tuple[Outcome, str]:
    name = "rula" if one.method.startswith("RULA") else "reba"
    within, warning = (table.values[f"{name}_{what}"] for what in ("within", "warning"))
    level = (rula_table() if name == "rula" else reba_table()).level(one.counts)
    reason = (
        f"score {one.counts}: {level}; up to {within.value:g} is within limits, up to {warning.value:g} a warning "
        f"({table.mark_of(within)})"
    )
    if one.counts > warning.value:
        return Outcome.ABOVE, reason
    if one.counts > within.value:
        return Outcome.WARNING, reason
    if one.unknown:
        return Outcome.NOT_ASSESSABLE, f"{reason}; it can only be higher, and not all angles are known"
    return Outcome.WITHIN, reason


def _values(one: Scored, table: VerdictTable) -> dict[str, float | None]:
    period, seconds = _periods(one.time), table["lasting"]
    total = max(float(period.sum()), 1e-12)
    levels = (rula_table() if one.method.startswith("RULA") else reba_table()).levels
    bounds = [0, *(int(highest) for highest in levels)]
    shares = {
        f"share of time at {low + 1} to {high} [1]": float(period @ ((one.score > low) & (one.score <= high))) / total
        for low, high in pairwise(bounds)
    }
    return {
        "score that counts": float(one.counts),
        "largest score": float(one.score.max()),
        "mean score": float((one.score * period).sum() / total),
        "score that counts, chosen thresholds 5 deg smaller": float(lasting(one.time, one.stricter, seconds)),
        "score that counts, chosen thresholds 5 deg larger": float(lasting(one.time, one.looser, seconds)),
        **shares,
    }


def _longest(one: Scored) -> tuple[float, float]:
    """The longest stretch with the score that counts, or a higher one [s]."""
    rows = np.flatnonzero(one.score >= one.counts)
    groups = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    group = max(groups, key=lambda rows: one.time[rows[-1]] - one.time[rows[0]])
    return float(one.time[group[0]]), float(one.time[group[-1]])
