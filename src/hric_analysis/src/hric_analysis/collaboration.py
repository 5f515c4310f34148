"""Numbers of a run by which controllers are compared: contacts and distance held against their limits, and how far the
person's hand stayed from where they meant it to be. No ROS.

All of it is an estimate of a model: `hric_assessment.findings.DISCLAIMER`.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hric_analysis import contacts
from hric_analysis.human import Person
from hric_assessment.findings import NotAssessableError, Outcome
from hric_assessment.verdict.choices import Choices
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import people_of
from hric_assessment.verdict.separating import TOUCHING, PersonSeparation, separated, separation_finding
from hric_core.geometry import FloatArray, compose
from hric_human.body import describe
from hric_human.control.kinematics import HandChain
from hric_human.hand.programs import read_program
from hric_human.participant.settings import HumanSettings

AT_REST = 5e-3
"""Distance from its last place within which a hand is at rest [m] (project default, unconfirmed)."""


def values(given: AssessmentInput, person: Person | None) -> dict[str, Any] | None:
    """Return the numbers of a run; None: there was no person.

    Args:
        given: the run, read for the verdict.
        person: of `human.analyse`.

    Returns:
        contact: `share`, the largest by `contacts.counted_share` (0: nothing touched the person), `above` and
        `not_assessable`: number of findings; separation: `share`, the largest S_p over the distance while the arm
        moves, and `below`, for how long it was nearer than S_p [s], None: it cannot be said; hand: `error_max`,
        `error_rms` of the hand's distance from its reference during the motion [m], `late`, how long after the
        reference's end it comes to rest [s]; None: the person follows no points.
    """
    if person is None:
        return None
    return {"contact": _contact(given), "separation": _separation(given), "hand": _hand(given.run, person)}


def _contact(given: AssessmentInput) -> dict[str, Any]:
    findings = contacts.findings(given)
    outcomes = [one.outcome for one in findings]
    return {
        "share": max(map(contacts.counted_share, findings), default=math.inf),
        "above": outcomes.count(Outcome.ABOVE),
        "not_assessable": outcomes.count(Outcome.NOT_ASSESSABLE),
    }


def _separation(given: AssessmentInput) -> dict[str, Any] | None:
    distances = []
    for person in people_of(given):
        try:
            apart = separated(given, person, Choices())
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
    """Return for how long the moving arm was nearer than S_p [s]."""
    return float(sum(one.end - one.begin for one in apart.distances.violations(apart.protective)))


def _hand(run: Mapping[str, Any], person: Person) -> dict[str, float] | None:
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


def _reference(run: Mapping[str, Any], person: Person) -> tuple[FloatArray, FloatArray, FloatArray, float] | None:
    """Return times from the motion's begin on, shape (n,) [s], where the hand was and was to be then, in the world,
    shapes (n, 3) [m], and when it was to be at its last place [s]; None: where it was to be is not known."""
    acting = ((run["parameters"].get("robot") or {}).get("participants") or {}).get("human") or {}
    section = run["definition"]["human"]
    reference = ((section.get("control") or {}).get("parameters") or {}).get("reference") or {}
    if reference.get("program") != "minimum_jerk" or section.get("walk"):
        return None
    program = read_program(reference, int(acting.get("seed", 0)))
    record, begin = person.record, person.values["motion"][0]
    rows = record.time >= begin
    settings = HumanSettings.of(section, "human")
    body = describe(settings.person)
    hand, root = HandChain(body, body.subject.dominant_hand), settings.root(body)
    at = [compose(root, hand.pose(q)).position for q in record.position[rows].tolist()]
    goal = [program.pose(time - begin).position for time in record.time[rows].tolist()]
    return record.time[rows], np.array(at), np.array(goal), begin + program.span[1]
