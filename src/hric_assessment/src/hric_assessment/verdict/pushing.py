"""Findings about pushing and pulling with both hands: forces and heights of the hands by Snook and Ciriello."""

from dataclasses import replace

import numpy as np

from hric_assessment.ergonomics.pushing import PushLimits, limits
from hric_assessment.findings import PUSHING, Finding, NotAssessableError, Outcome, finite_rows, unknown
from hric_assessment.tables import push_table, verdict_table
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_assessment.verdict.tasks import TaskMethod, judged, stances_of
from hric_assessment.work import MEN, PushTask, Work
from hric_motion.stances import SIDES

INSTANTS = 21
"""Number of instants at which the height of the hands is taken."""
NOTES = (
    "between rows of the table, the lower force, the longer distance and the shorter interval count",
    "height of the hands: lowest and highest during the task, with the 95 % interval of the joint angles",
)


class Pushing(TaskMethod):
    """Forces of the pushing and pulling in a work file."""

    def findings(self, source: AssessmentInput, person: AssessedPerson, work: Work) -> list[Finding]:
        """Return the findings about a person's pushing and pulling."""
        return [_finding(person, task) for task in work.pushes]


def _finding(person: AssessedPerson, task: PushTask) -> Finding:
    window, table = (task.begin, task.end), push_table()
    subject, about = f"{task.action} at {task.begin:g} s", (window, person.signals, (), NOTES)
    finding = Finding(
        subject, Outcome.NOT_ASSESSABLE, "", table.name, None, {}, *about, group=PUSHING, person=person.name
    )
    try:
        heights = _heights(person, task)
        best, worst = _limits(task, heights)
    except NotAssessableError as error:
        return replace(finding, reason=str(error))
    forces = _forces(person, task)
    values: dict[str, float | None] = {"lowest hands [m]": heights[0], "highest hands [m]": heights[1]}
    for name, force, accepted in zip(PushLimits._fields, forces, best, strict=True):
        values |= {f"{name} force [N]": force, f"accepted {name} force [N]": accepted}
    known = {"distance": task.distance, "interval": task.interval, "workforce": task.workforce}
    missing = [name for name, value in known.items() if value is None]
    missing += [f"{name} force" for name, force in zip(PushLimits._fields, forces, strict=True) if force is None]
    if task.workforce not in (MEN, None):
        missing.append("forces that women accept (no table of them is included)")
    pairs = [(force, *ends) for force, *ends in zip(forces, best, worst, strict=True) if force is not None]
    high = max((force / accepted for force, accepted, _ in pairs), default=0.0)
    unknown_end = max((force / max(accepted, 1e-9) for force, _, accepted in pairs), default=0.0)
    unknown_end = np.inf if None in forces or task.workforce != MEN else unknown_end
    shown = ", ".join(
        f"{name} force {'not known' if force is None else f'{force:.0f}'} of {accepted:.0f} N"
        for name, force, accepted in zip(PushLimits._fields, forces, best, strict=True)
    )
    reason = f"{shown}, which 90 % of men accept with the hands {heights[0]:.2f} to {heights[1]:.2f} m high"
    finding = replace(finding, reason=reason, share=high, values=values)
    better, worse = (Outcome.ABOVE if ratio > 1.0 else Outcome.WITHIN for ratio in (high, unknown_end))
    return judged(finding, better, worse, missing).marked_near_limit()


def _heights(person: AssessedPerson, task: PushTask) -> tuple[float, float]:
    """Return the lowest and highest height of the hands above the floor, with their interval [m]."""
    stances = stances_of(person, np.linspace(task.begin, task.end, INSTANTS))
    floor = person.settings.floor if person.settings is not None else 0.0
    height = stances.middle.hands[:, 2] - floor
    half = stances.half_width(lambda stance: stance.hands[:, 2])
    return float((height - half).min()), float((height + half).max())


def _limits(task: PushTask, heights: tuple[float, float]) -> tuple[PushLimits, PushLimits]:
    """Return the accepted forces with the best and the worst distance and interval, if not stated; 0: no force."""
    groups = push_table().columns
    shorter, longer = task.distance or groups[0].distance, task.distance or groups[-1].distance
    best = limits(task.action, heights, shorter, task.interval or groups[0].intervals[-1])
    shortest = next(group.intervals[0] for group in groups if longer <= group.distance)
    try:
        return best, limits(task.action, heights, longer, task.interval or shortest)
    except NotAssessableError:
        return best, PushLimits(0.0, 0.0)


def _forces(person: AssessedPerson, task: PushTask) -> tuple[float | None, float | None]:
    """Return initial and sustained force: stated, or largest and mean horizontal force of the recorded grips [N]."""
    links = {person.body.segments[f"{side}_hand"].link for side in SIDES}
    grips = [] if person.record is None else list(person.record.grips.values())
    acting = [grip for grip in grips if grip.holder.rpartition("::")[2] in links]
    window, gap = (task.begin, task.end), verdict_table()["max_gap"]
    usable = [(grip.time, finite_rows(grip.force), grip.force) for grip in acting]
    largest, mean = None, None
    if usable and not any(unknown(time, known, window, gap) for time, known, _ in usable):
        time = np.unique([*window, *(at for times, *_ in usable for at in times if task.begin <= at <= task.end)])
        total = [[np.interp(time, at[known], axis[known]) for axis in force.T[:2]] for at, known, force in usable]
        size = np.linalg.norm(np.sum(total, axis=0), axis=0)
        largest, mean = float(size.max()), float(np.trapezoid(size, time)) / (task.end - task.begin)
    return largest if task.initial is None else task.initial, mean if task.sustained is None else task.sustained
