"""Metrics for the comparison of controllers: contacts and distances relative to limits, and hand error. No ROS.

The hand error is the distance of the person's hand from its reference. All values are estimates of a model (see
`hric_assessment.findings.DISCLAIMER`).
"""

import math

import numpy as np

from hric_analysis import contacts
from hric_analysis.human import SimulatedPerson, moved
from hric_assessment.findings import NotAssessableError, Outcome
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import people_of
from hric_assessment.verdict.separating import TOUCHING, PersonSeparation, separated, separation_finding
from hric_bags.run_file import RunFile, robot_parameters
from hric_core.geometry import FloatArray, compose
from hric_human.control.kinematics import HandChain
from hric_human.hand.programs import read_program
from hric_human.participant.settings import HumanSettings

AT_REST = 5e-3
"""Distance from its final position within which a hand counts as at rest [m] (project default, unconfirmed)."""


def values(source: AssessmentInput, person: SimulatedPerson | None) -> dict[str, dict[str, float] | None] | None:
    """Return the metrics of a run by which the benchmark compares controllers; None: there was no person.

    Args:
        source: data of the run, as the verdict uses them.
        person: simulated human of the run, from `human.analyse`.

    Returns:
        contact: `share`, largest ratio to the limit by `contacts.counted_share` (0: no contact); `above` and
        `not_assessable`, numbers of such findings. separation: `share`, largest ratio of the protective distance S_p to
        the distance while the arm moves; `below`, time for which the arm is closer than S_p [s]; None: unknown. hand:
        `error_max` and `error_rms`, distance of the hand from its reference during the motion [m]; `late`, time from
        the end of the reference until the hand is at rest [s]; None: the hand has no minimum-jerk reference.
    """
    if person is None:
        return None
    return {"contact": _contact(source), "separation": _separation(source), "hand": _hand(source.run, person)}


def _contact(source: AssessmentInput) -> dict[str, float]:
    findings = contacts.findings(source)
    outcomes = [finding.outcome for finding in findings]
    return {
        "share": max(map(contacts.counted_share, findings), default=math.inf),
        "above": outcomes.count(Outcome.ABOVE),
        "not_assessable": outcomes.count(Outcome.NOT_ASSESSABLE),
    }


def _separation(source: AssessmentInput) -> dict[str, float] | None:
    distances = []
    for person in people_of(source):
        try:
            apart = separated(source, person, AssessmentChoices())
        except NotAssessableError:
            return None
        if apart is None or separation_finding(apart).outcome == Outcome.NOT_ASSESSABLE:
            return None
        distances.append(apart)
    return {"share": max(map(_share, distances)), "below": sum(map(below, distances))} if distances else None


def _share(apart: PersonSeparation) -> float:
    ratio = apart.protective / np.maximum(apart.distances.distance, TOUCHING)
    return float(np.nanmax(ratio)) if np.isfinite(ratio).any() else 0.0


def below(apart: PersonSeparation) -> float:
    """Return the time for which the moving arm was closer to the person than the protective distance S_p [s]."""
    return float(sum(violation.end - violation.begin for violation in apart.distances.violations(apart.protective)))


def _hand(run: RunFile, person: SimulatedPerson) -> dict[str, float] | None:
    meant = _reference(run, person)
    if meant is None:
        return None
    time, at, goal, end = meant
    during = time <= end
    distance = np.linalg.norm(at - goal, axis=1)[during]
    away = np.linalg.norm(at - at[-1], axis=1) > AT_REST
    last = float(time[np.flatnonzero(away)[-1]]) if away.any() else end
    return {
        "error_max": float(distance.max()),
        "error_rms": float(np.sqrt(np.mean(distance**2))),
        "late": max(last - end, 0.0),
    }


def _reference(run: RunFile, person: SimulatedPerson) -> tuple[FloatArray, FloatArray, FloatArray, float] | None:
    """Return times, actual and reference hand positions, and the end of the reference [s]; None: no known reference.

    The times begin with the motion, shape (n,) [s]; positions are in the world frame, shape (n, 3) [m].
    """
    acting = (robot_parameters(run).get("participants") or {}).get("human") or {}
    section = run["definition"]["human"] or {}
    reference = ((section.get("control") or {}).get("parameters") or {}).get("reference") or {}
    if reference.get("program") != "minimum_jerk" or section.get("walk"):
        return None
    program = read_program(reference, int(acting.get("seed", 0)))
    record, begin = person.record, moved(person.record.events, person.record.time)[0]
    rows = record.time >= begin
    settings = HumanSettings.of(section, "human")
    body = settings.body()
    hand, root = HandChain(body, body.subject.dominant_hand), settings.root(body)
    at = [compose(root, hand.pose(q)).position for q in record.position[rows].tolist()]
    goal = [program.pose(time - begin).position for time in record.time[rows].tolist()]
    return record.time[rows], np.array(at), np.array(goal), begin + program.span[1]
