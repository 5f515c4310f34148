"""Findings about repetitive work: the OCRA checklist of each arm, with shares of postures from the recording."""

import math
from collections.abc import Mapping

import numpy as np

from hric_assessment.ergonomics import ocra, use
from hric_assessment.ergonomics.ocra import Ends
from hric_assessment.findings import REPETITION, BoolArray, Evidence, Finding, Outcome
from hric_assessment.tables import ocra_table, verdict_table
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_assessment.verdict.posture_input import posture_of, repeats_of, spread_of
from hric_assessment.verdict.tasks import TaskMethod, judged
from hric_assessment.work import RepetitiveTask, Work

HIGHEST_FREQUENCY = 100.0
"""Technical actions per minute that count as the worst if they are not stated; the checklist ends at 70 [1/min]."""
JOINTS = ("shoulder", "elbow", "wrist")
NOTES = (
    "the recording counts as a typical part of the work; a screening, not the OCRA index",
    "shares of the time with the upper arm at shoulder height, wide movements of the elbow, and a bent wrist are "
    "measured; grip, forces, breaks and pace cannot be measured",
)


class Repetition(TaskMethod):
    """OCRA checklist of each arm in the repetitive work of a work file."""

    def findings(self, source: AssessmentInput, person: AssessedPerson, work: Work) -> list[Finding]:
        """Return the findings about a person's arms."""
        window = source.recording.begin, source.recording.end
        return [
            _finding(person, task, side, window)
            for task in work.repetitive
            for side in (person.sides if len(person.time) else ())
        ]


def _finding(person: AssessedPerson, task: RepetitiveTask, side: str, window: tuple[float, float]) -> Finding:
    table, shares = ocra_table(), _shares(person, side, window)
    rated = ocra.rate(task.options, _actions(person, side, task), shares, task.minutes)
    unknown = [name.replace("_", " ") for name in rated.unknown]
    unknown += ["technical actions per minute"] * (task.actions is None)
    unknown += [f"posture of the {name}" for name in JOINTS if shares[name].worst > shares[name].high]
    low, high, worst = rated.score
    reason = f"OCRA score {high:.3g}" if low == high else f"OCRA score {low:.3g} to {high:.3g}"
    reason += f", up to {worst:.3g} with all that is not known" if worst > high else ""
    levels = dict.fromkeys((table.level(low), table.level(worst)))
    reason += f": {' to '.join(levels)}; up to {table['within']:g} is within limits, "
    reason += f"up to {table['warning']:g} a warning"
    values: dict[str, float | None] = {
        "OCRA score [1]": high,
        "OCRA score, better end [1]": low,
        "OCRA score, unknown at its worst [1]": worst,
    }
    values |= {f"{name} [1]": value for name, value in rated.parts.items()}
    values |= {f"share of time, {name} [1]": share.high for name, share in shares.items()}
    subject, share = f"repetitive work of the {side} arm", high / table["warning"]
    about = (share, values, window, person.signals, (), NOTES, (), side)
    finding = Finding(subject, Outcome.NOT_ASSESSABLE, reason, table.name, *about, group=REPETITION, person=person.name)
    return judged(finding, _outcome(high), _outcome(worst), unknown)


def _outcome(score: float) -> Outcome:
    table = ocra_table()
    if score > table["warning"]:
        return Outcome.ABOVE
    return Outcome.WARNING if score > table["within"] else Outcome.WITHIN


def _actions(person: AssessedPerson, side: str, task: RepetitiveTask) -> Ends:
    """Return the technical actions per minute; not stated: at least the arm's back-and-forth motions."""
    if task.actions is not None:
        return Ends(task.actions, task.actions, task.actions)
    measured = float(np.min(repeats_of(person, posture_of(person, side)[0], side)[0]))
    return Ends(measured, measured, HIGHEST_FREQUENCY)


def _shares(person: AssessedPerson, side: str, window: tuple[float, float]) -> Mapping[str, Ends]:
    """Return the shares of the time by posture; times without data are not known."""
    table, posture, spread = ocra_table(), posture_of(person, side)[0], spread_of(person, side)
    count = len(person.time)

    def beyond(name: str, degrees: float) -> tuple[BoolArray, BoolArray, BoolArray]:
        """Return three masks, shape (n,): an angle certainly beyond +-degrees, possibly beyond, and not known."""
        angle = getattr(posture, name)
        size = np.full(count, np.nan) if angle is None else np.abs(np.broadcast_to(angle, count))
        half, limit = np.broadcast_to(spread.get(name, 0.0), count), math.radians(degrees)
        return size - half >= limit, size + half >= limit, np.isnan(size)

    def either(*parts: tuple[BoolArray, BoolArray, BoolArray]) -> Ends:
        certain, possible, missing = (np.any(masks, axis=0) for masks in zip(*parts, strict=True))
        covered = Evidence.of(person.time, ~missing, window, verdict_table()["max_gap"])
        known = covered.known / covered.requested if covered.requested > 0.0 else 0.0
        low, high = (float(mask[~missing].mean()) if known else 0.0 for mask in (certain, possible))
        return Ends(low * known, high * known, high * known + 1.0 - known)

    flexion = np.full(count, np.nan) if posture.elbow_flexion is None else np.asarray(posture.elbow_flexion)
    wide = use.wide(person.time, flexion, math.radians(table["elbow_travel"]), table["elbow_window"])
    moving = wide, wide, np.isnan(flexion)  # a constant error of the angle has no effect
    return {
        "shoulder": either(beyond("upper_arm_flexion", table["shoulder_angle"])),
        "raised": either(beyond("upper_arm_flexion", table["raised_angle"])),
        "elbow": either(moving, beyond("pronation", table["elbow_travel"])),
        "wrist": either(
            beyond("wrist_flexion", table["wrist_flexion"]), beyond("wrist_deviation", table["wrist_deviation"])
        ),
    }
