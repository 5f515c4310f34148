"""Figures without limits: force, work and smoothness of the grips, and how long the arm is at rest or slowed."""

import numpy as np

from hric_assessment.ergonomics.effort import effort, log_dimensionless_jerk
from hric_assessment.findings import UnjudgedValue
from hric_assessment.tables import verdict_table
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.separating import PersonSeparation
from hric_bags.records import RecordedHumanEvent
from hric_bags.records.human_record import GripRecord
from hric_bags.records.safety_record import SLOWED, STOPPED, SafetyRecord

GROUP, WORK = "interaction", "productivity"


def interaction(source: AssessmentInput) -> list[UnjudgedValue]:
    """Return force, work and smoothness of each grip."""
    humans = source.recording.humans
    figures = []
    for human, grip in [(record, grip) for record in humans.values() for grip in record.grips.values()]:
        cost, what = effort(grip), f"grip {grip.name} of {grip.held}"
        rate = f"{len(grip.time) / max(np.ptp(grip.time), 1e-3):.0f} samples per second"
        what = f"{human.name}: {what}" if len(humans) > 1 else what
        if cost is None:
            figures.append(UnjudgedValue(GROUP, f"largest force, {what}", None, "N", "not closed for two messages"))
            continue
        figures += [
            UnjudgedValue(GROUP, f"largest force, {what}", cost.force_max, "N", f"mean {cost.force_mean:.2f} N"),
            UnjudgedValue(GROUP, f"work, {what}", cost.work, "J", f"absolute work {cost.work_absolute:.3g} J; {rate}"),
            _smooth(grip, human.events, what),
        ]
    return figures


def _smooth(grip: GripRecord, events: list[RecordedHumanEvent], what: str) -> UnjudgedValue:
    """Return the smoothness of a grip's motion, from start to end of the person's motion if these are known."""
    begin = max((event.time for event in events if event.kind == "started"), default=-np.inf)
    end = max((event.time for event in events if event.kind == "ended"), default=np.inf)
    during = grip.closed & (grip.time >= begin) & (grip.time <= (end if end > begin else np.inf))
    name, note = f"log dimensionless jerk, {what}", "nearer to zero is smoother; one minimum-jerk reach: -5.32"
    if during.sum() < 5:
        return UnjudgedValue(GROUP, name, None, "1", "the grip was closed for too short a time")
    time = grip.time[during]
    return UnjudgedValue(
        GROUP, name, log_dimensionless_jerk(time, np.gradient(grip.point[during], time, axis=0)), "1", note
    )


def productivity(apart: PersonSeparation | None, safety: SafetyRecord | None) -> list[UnjudgedValue]:
    """Return the shares of time in which the arm is at rest, and in which a supervisor stopped or slowed it."""
    return [*_standing(apart), *_supervised(safety)]


def _supervised(safety: SafetyRecord | None) -> list[UnjudgedValue]:
    """Return the shares of time in which a supervisor requested a stop or a lower speed, obeyed or not."""
    if safety is None:
        return []
    note = f"as requested in mode {safety.mode}, between the supervisor's first and last decision"
    return [
        UnjudgedValue(WORK, f"share of time {state} by the supervisor", safety.share(state), "1", note)
        for state in (STOPPED, SLOWED)
    ]


def _standing(apart: PersonSeparation | None) -> list[UnjudgedValue]:
    """Return the share of time in which the arm is at rest between its first and its last motion."""
    if apart is None:
        return []
    table = verdict_table()
    moving = np.flatnonzero(apart.speed > table["moving"])
    name, note = "share of time in which the arm is at rest", f"slower than {table['moving']:g} m/s (chosen here)"
    if len(moving) < 2:
        return [UnjudgedValue(WORK, name, None, "1", "the arm never moves")]
    first, last = moving[[0, -1]]
    period = np.diff(apart.distances.time[first : last + 1])
    standing = apart.speed[first:last] <= table["moving"]
    share = float(period[standing].sum() / period.sum())
    return [UnjudgedValue(WORK, name, share, "1", f"between the arm's first and last motion; {note}")]
