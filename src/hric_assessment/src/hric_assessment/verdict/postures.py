"""Findings about postures: scores of each arm by all scoring methods over the recording.

If uncertain angles allow several scores, the worst one decides. A finding is "within limits", or a warning, only if the
worst values of all unknown angles and times do not change it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from hric_assessment.ergonomics.posture import ANGLES, Posture, Task
from hric_assessment.ergonomics.scoring import IntArray, PostureMethod, Scores, methods, needed
from hric_assessment.findings import POSTURE, BoolArray, Evidence, Finding, Outcome
from hric_assessment.tables import PostureTable, ValueTable, verdict_table
from hric_assessment.verdict.person import AssessedPerson
from hric_assessment.verdict.posture_input import posture_of, repeats_of, spread_of, task_of
from hric_assessment.verdict.result import ScoreCurve, thinned
from hric_bags.records.human_record import HumanRecord
from hric_core.geometry import FloatArray

UNSEEN = ("shoulder_elevation",)
"""Angles for which no body model has a joint; a finding can be assessable although they are unknown."""
CURVES = ("score", "stricter", "looser")
INCLINATION = ("trunk_flexion", "trunk_bend")
"""Angles that are relative to the pelvis if the orientation of the root link is not known."""
RECORD_JOINTS = "record the joints of neck, trunk and legs; of a simulated person: human.parts:=whole_body"
RECORD_ROOT = (
    "record the pose of the body's root link (human/root, person/tracking, or a static transform from world to "
    "human_base), or assess the run folder"
)

AT_WORST = "it can be up to"
"""Words in a finding's reason that introduce the score with the worst values of all unknown angles and times."""


@dataclass(frozen=True)
class ArmScores:
    """Posture scores of one arm by one method over time.

    Attributes:
        key: key of the method, its title in lower case.
        side: side of the arm.
        time: times of the scores, shape (n,) [s].
        scores: scores with the most favourable value of each unknown angle.
        worst: highest scores, with the least favourable value of each unknown angle, shape (n,).
        unknown: angles that the table needs and that are never known.
        vertical: True if the trunk angles are to the vertical, False if they are to the pelvis.
        accurate: False if the uncertainty of the angles is not known.
        evidence: how much of the recording all other angles are known for.
    """

    key: str
    side: str
    time: FloatArray
    scores: Scores
    worst: IntArray
    unknown: tuple[str, ...]
    vertical: bool
    accurate: bool
    evidence: Evidence

    @property
    def unseen(self) -> bool:
        """True if nothing is known of the arm: neither the upper arm nor the elbow."""
        return {"upper_arm_flexion", "elbow_flexion"} <= set(self.unknown)

    @property
    def lacks_root(self) -> bool:
        """True if the trunk's angles to the pelvis are known, but not its inclination to the vertical."""
        return not self.vertical and INCLINATION[0] not in self.unknown

    def lasting(self, curve: str) -> int:
        """Return the score of a curve of `scores` that counts, since it lasts long enough; curve: its name."""
        return lasting(self.time, getattr(self.scores, curve), verdict_table()["lasting"])

    @property
    def worst_lasting(self) -> int:
        """Score that would count if all unknown times had the highest score of the table."""
        evidence, shortest = self.evidence, verdict_table()["lasting"]
        seconds = shortest - (evidence.requested - evidence.known)
        if seconds <= 0.0 or (evidence.requested < shortest and not evidence.complete):
            return int(list(self.scores.table.levels)[-1])
        return lasting(self.time, self.worst, seconds)

    def timeline(self) -> ScoreCurve:
        """Return the scores over time as a curve of the verdict."""
        curves = [getattr(self.scores, name) for name in CURVES]
        rows = thinned(self.time, *(curve.astype(np.float64) for curve in curves))
        return ScoreCurve(self.side, self.time[rows].tolist(), *(curve[rows].tolist() for curve in curves))


def scored(
    person: AssessedPerson,
    record: HumanRecord | None,
    window: tuple[float, float],
    versions: Mapping[str, str] = MappingProxyType({}),
) -> Iterator[ArmScores]:
    """Yield the scores of each arm by each method, one at a time since each takes some 100 MB per recorded hour.

    Args:
        person: assessed person; without any instant nothing is yielded.
        record: recorded signals of a simulated human, with its grips; None: not recorded.
        window: begin and end of the recording [s].
        versions: versions of the methods' tables, by key of the method.
    """
    for side in person.sides if len(person.time) else ():
        posture, vertical = posture_of(person, side)
        repeats = repeats_of(person, posture, side)
        for key, method in methods().items():
            task = task_of(person, record, posture, side, method.table(), repeats)
            yield _scored(key, method, person, (posture, task, vertical), side, window, versions.get(key, ""))


def _scored(
    key: str,
    method: PostureMethod,
    person: AssessedPerson,
    state: tuple[Posture, Task, bool],
    side: str,
    window: tuple[float, float],
    version: str,
) -> ArmScores:
    posture, task, vertical = state
    unknown, known = _known(posture, method.table(), len(person.time))
    if task.load is not None:
        known &= np.isfinite(task.load)
    accurate = person.deviation is not None or bool(np.isfinite(person.uncertainty))
    spread, open_ended = spread_of(person, side), (*unknown, *(() if vertical else INCLINATION))
    open_ended = open_ended if accurate else ANGLES
    scores = method.score(posture, task, version, spread)
    curves: Any = {name: _bridged(getattr(scores, name), known) for name in (*CURVES, "lowest", "highest")}
    scores, worst = replace(scores, **curves), curves["highest"]
    if open_ended:
        spread = spread | dict.fromkeys(open_ended, np.inf)
        worst = _bridged(method.highest(posture, task, version, spread), known)
    evidence = Evidence.of(person.time, known, window, verdict_table()["max_gap"])
    return ArmScores(key, side, person.time, scores, worst, tuple(unknown), vertical, accurate, evidence)


def _bridged(curve: IntArray, known: BoolArray) -> IntArray:
    """Return scores, at unknown instants raised to the higher score of both known neighbours."""
    rows = np.flatnonzero(known)
    if known.all() or not len(rows):
        return curve
    after = np.searchsorted(rows, np.arange(len(known))).clip(max=len(rows) - 1)
    before, after = rows[(np.searchsorted(rows, np.arange(len(known)), side="right") - 1).clip(min=0)], rows[after]
    return np.where(known, curve, np.maximum(curve, np.maximum(curve[before], curve[after])))


def _known(posture: Posture, table: PostureTable, count: int) -> tuple[list[str], BoolArray]:
    """Return the angles that a table needs and that are never known, and True for instants with all others, (n,)."""
    never, known = [], np.ones(count, np.bool_)
    for name in needed(table):
        if name in ANGLES and name not in UNSEEN:
            angle = getattr(posture, name)
            if angle is None or not np.isfinite(angle).any():
                never.append(name)
            else:
                known &= np.isfinite(angle)
    return never, known


def lasting(time: FloatArray, score: IntArray, seconds: float) -> int:
    """Return the highest score that is reached or exceeded for a required total time.

    For a recording shorter than that it is the highest score.

    Args:
        time: times of the scores, shape (n,) [s].
        score: scores, shape (n,).
        seconds: required total time [s].
    """
    period, highest = _periods(time), int(score.max())
    enough = (value for value in range(highest, 0, -1) if period[score >= value].sum() >= seconds - 1e-9)
    return next(enough, highest)


def _periods(time: FloatArray) -> FloatArray:
    """Return the duration that each sample represents, shape (n,) [s]."""
    return np.gradient(time) if len(time) > 1 else np.zeros(len(time))


def posture_finding(arm: ArmScores, person: AssessedPerson) -> Finding:
    """Return the finding about the posture scores of one arm."""
    outcome, reason = _judged(arm)
    remedies = [RECORD_JOINTS] * bool(arm.unknown) + [RECORD_ROOT] * arm.lacks_root
    if arm.evidence.shortfall:
        remedies.append(f"record the joint states without gaps longer than {arm.evidence.max_gap:g} s")
    return Finding(
        f"{arm.scores.table.title} of the {arm.side} arm",
        outcome,
        reason,
        arm.scores.method,
        None,
        {} if arm.unseen else _values(arm),
        _longest(arm),
        person.signals,
        (*(f"the angle {name}" for name in arm.unknown), *["inclination of the trunk"] * arm.lacks_root),
        _notes(arm, verdict_table()),
        group=POSTURE,
        evidence=arm.evidence,
        remedy="; ".join(remedies) if AT_WORST in reason else "",
    )


def _judged(arm: ArmScores) -> tuple[Outcome, str]:
    if arm.unseen:
        return Outcome.NOT_ASSESSABLE, f"nothing is known of the {arm.side} arm; {AT_WORST} {arm.worst_lasting}"
    table = arm.scores.table
    within, warning = table.within, table.warning

    def graded(score: int) -> Outcome:
        return Outcome.ABOVE if score > warning.value else Outcome.WARNING if score > within.value else Outcome.WITHIN

    better, counts, worst = arm.lasting("lowest"), arm.lasting("highest"), arm.worst_lasting
    band = "" if better == counts else f"{better} to "
    reason = f"score {band}{counts}: {table.level(counts)}"
    if band:
        reason += f", decided by {', '.join(arm.scores.uncertain(_first(arm)))}"
    reason += f"; up to {within.value:g} is within limits, up to {warning.value:g} a warning ({table.mark_of(within)})"
    outcome = graded(counts)
    if outcome == Outcome.ABOVE or graded(worst) == outcome:
        return outcome, reason
    outcome = Outcome.NOT_ASSESSABLE if graded(worst) == Outcome.ABOVE else Outcome.WARNING
    names = ", ".join([*arm.unknown, *["inclination of the trunk"] * arm.lacks_root])
    lacks = [f"{names} not known"] * bool(names)
    lacks += ["the uncertainty of the angles is not known"] * (not arm.accurate)
    lacks += [f"the posture is {arm.evidence.shortfall}"] * bool(arm.evidence.shortfall)
    return outcome, f"{reason}; {AT_WORST} {worst}: {'; '.join(lacks)}"


def _notes(arm: ArmScores, table: ValueTable) -> tuple[str, ...]:
    scale = arm.scores.table
    trunk = "to the vertical" if arm.vertical else "to the pelvis, whose inclination is not known"
    static = f"range of angles up to {table['held']:g} deg for more than {scale.static_time:g} s"
    if arm.evidence.requested <= scale.static_time:
        static += (
            f" (this recording of {arm.evidence.requested:.1f} s is too short to judge it; the score would be 1 higher "
            "if the posture were held on)"
        )
    chosen = (f"{name} {threshold.value:g} deg" for name, threshold in scale.chosen.items())
    return (
        f"counts: the highest score that is reached for {table['lasting']:g} s in total "
        f"({table.value_mark('lasting')}); at its first instant: "
        f"{'; '.join(arm.scores.reasons(_first(arm))) or 'no points are added'}",
        f"angles are rounded to {table['angle']:g} deg ({table.value_mark('angle')}), since no posture is known better",
        f"inclination of the trunk: {trunk}; of the neck: to the trunk",
        f"static use: {static}; repeated use: back-and-forth motions of more than {table['held']:g} deg, counted in "
        f"any minute ({table.value_mark('held')})",
        f"thresholds chosen here: {'; '.join(chosen)}",
        f"assumed: {'; '.join(arm.scores.assumptions)}",
    )


def _values(arm: ArmScores) -> dict[str, float | None]:
    period, score = _periods(arm.time), arm.scores.score
    total = max(float(period.sum()), 1e-12)
    bounds = [0, *(int(highest) for highest in arm.scores.table.levels)]
    shares = {
        f"share of time at {low + 1} to {high} [1]": float(period @ ((score > low) & (score <= high))) / total
        for low, high in pairwise(bounds)
    }
    return {
        "score that counts": float(arm.lasting("highest")),
        "score that counts, better end": float(arm.lasting("lowest")),
        "score that counts, unknown at its worst": float(arm.worst_lasting),
        "largest score": float(score.max()),
        "mean score": float((score * period).sum() / total),
        "score that counts, chosen thresholds 5 deg smaller": float(arm.lasting("stricter")),
        "score that counts, chosen thresholds 5 deg larger": float(arm.lasting("looser")),
        **shares,
    }


def _first(arm: ArmScores) -> int:
    """Return the index of the first instant with the score that counts."""
    return int(np.argmax(arm.scores.highest >= arm.lasting("highest")))


def _longest(arm: ArmScores) -> tuple[float, float]:
    """Return begin and end of the longest uninterrupted time with at least the score that counts [s]."""
    rows = np.flatnonzero(arm.scores.highest >= arm.lasting("highest"))
    groups = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    group = max(groups, key=lambda rows: arm.time[rows[-1]] - arm.time[rows[0]])
    return float(arm.time[group[0]]), float(arm.time[group[-1]])
