"""Methods that judge tasks of a person, such as lifts: base class, and all methods by their plugins.

A method is a class exported as a plugin of the base `hric_assessment::TaskMethod`; the verdict gets all methods from
here.
"""

from dataclasses import replace

import numpy as np

from hric_assessment.findings import JITTER, Finding, NotAssessableError, Outcome
from hric_assessment.tables import verdict_table
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_assessment.verdict.posture_input import tracked_deviations
from hric_assessment.work import Work
from hric_core import plugins
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_motion.stances import Stances

WORK = "state what is not known in the work file (--work FILE)"
"""Remedy for a value that a recording cannot show."""


class TaskMethod:
    """Base class of methods that judge tasks of a person; instances have no state."""

    def findings(self, source: AssessmentInput, person: AssessedPerson, work: Work) -> list[Finding]:
        """Return the findings about a person, from the recording and from what the user states about the work."""
        raise NotImplementedError


def task_methods() -> list[TaskMethod]:
    """Return all task methods. Raises HricError: a plugin cannot be imported."""
    return [plugins.find(plugins.TASK_METHOD, name)() for name in plugins.names(plugins.TASK_METHOD)]


def judged(finding: Finding, high: Outcome, worst: Outcome, unknown: list[str]) -> Finding:
    """Return a finding with its outcome: a good one only if what is not known does not change it.

    Args:
        finding: finding without outcome.
        high: outcome by the worse end of what was measured, with the best values of all else.
        worst: the same with the worst values of all else.
        unknown: names of the values that are not known.
    """
    outcome = Outcome.NOT_ASSESSABLE if worst == Outcome.ABOVE and high != Outcome.ABOVE else worst
    if not unknown:
        return replace(finding, outcome=outcome)
    text = f"{finding.reason}; not known: {', '.join(unknown)}"
    share = None if outcome == Outcome.NOT_ASSESSABLE else finding.share
    return replace(finding, outcome=outcome, reason=text, share=share, missing=tuple(unknown), remedy=WORK)


def stances_of(person: AssessedPerson, time: FloatArray) -> Stances:
    """Return hands and feet of a person at robot times, shape (n,) [s].

    Raises:
        NotAssessableError: their position is not known.
    """
    if person.attitude is None:
        raise NotAssessableError("the pose of the person's pelvis is not known")
    for known in (person.time, *(() if person.attitude.fixed else (person.attitude.time,))):
        away = np.abs(known[:, None] - time).min(axis=0, initial=np.inf)
        if away.max() > verdict_table()["max_gap"] + JITTER:
            raise NotAssessableError(f"the motion of the person is not known at {time[away.argmax()]:g} s")
    joints, rows = list(person.body.joints), np.abs(person.time[:, None] - time).argmin(axis=0)
    q, deviation = np.full((len(time), len(joints)), np.nan), np.zeros((len(time), len(joints)))
    columns = [joints.index(name) for name in person.names if name in joints]
    q[:, columns] = person.q[np.ix_(rows, [person.names.index(joints[column]) for column in columns])]
    if person.deviation is not None:
        deviation[:, columns] = person.deviation[rows]
    elif person.uncertainty > 0.0:
        deviation[:] = list(tracked_deviations(person).values())
    if not np.isfinite(deviation[np.isfinite(q)]).all():
        raise NotAssessableError("the uncertainty of the joint angles is not known")
    try:
        return Stances(person.body, q, deviation, person.attitude.at(time))
    except HricError as error:
        raise NotAssessableError(str(error)) from error
