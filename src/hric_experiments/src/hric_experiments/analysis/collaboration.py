"""What a run meant for the collaboration in it, in numbers by which controllers are compared: contacts and distance
held against their limits, and how far the person's hand stayed from where he meant it to be. No ROS.

All of it is an estimate of a model: `hric_assessment.findings.DISCLAIMER`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hric_assessment.findings import Finding, NotAssessableError, Outcome
from hric_assessment.verdict.choices import Choices
from hric_assessment.verdict.contacts import contact_findings
from hric_assessment.verdict.given import Given
from hric_assessment.verdict.person import people_of
from hric_assessment.verdict.separating import TOUCHING, Separated, separated
from hric_bags.parts import Bag
from hric_bags.records import recording
from hric_control.geometry import FloatArray, compose
from hric_experiments.analysis.human import Person
from hric_human.body import describe
from hric_human.control.kinematics import HandChain
from hric_human.hand.programs import read_program
from hric_human.participant.settings import HumanSettings

CONTACT_AREA = 1e-4
"""Over which contacts act where an experiment does not say it: a square centimetre [m^2] (project default, unconfirmed;
pressures of ISO/TS 15066 were measured with 1.96 cm^2, so it is on the strict side)."""
AT_REST = 5e-3
"""How near to its last place a hand is at rest [m] (project default, unconfirmed)."""


def values(run: Mapping[str, Any], bag: Bag, description: str, person: Person | None) -> dict[str, Any] | None:
    """Numbers of a run; None: nobody was there.

    Args:
        run: contents of run.yaml.
        bag: of the run.
        description: URDF of the robot.
        person: of `human.analyse`.

    Returns:
        contact: `share` of the nearest limit (0: nothing touched him), `above` and `not_assessable`: how many findings;
        separation: `share`, the largest S_p over the distance while the arm moves, and `below`, for how long it was
        nearer than S_p [s], None: it cannot be said; hand: `error_max`, `error_rms` of the hand's distance from its
        reference during the motion [m], `late`, how long after the reference's end it comes to rest [s]; None: he
        follows no points.
    """
    if person is None:
        return None
    given = Given("a run", "run", Path(), recording.read(bag), run, description)
    return {"contact": _contact(given), "separation": _separation(given), "hand": _hand(run, person)}


def _contact(given: Given) -> dict[str, Any]:
    choices = Choices(contact_area=CONTACT_AREA)
    found = contact_findings(given, choices)
    return {
        "share": _largest(found),
        "above": _count(found, Outcome.ABOVE),
        "not_assessable": _count(found, Outcome.NOT_ASSESSABLE),
    }


def _largest(found: Sequence[Finding]) -> float | None:
    return max((one.share for one in found if one.share is not None), default=None)


def _count(found: Sequence[Finding], outcome: Outcome) -> int:
    return sum(one.outcome == outcome for one in found)


def _separation(given: Given) -> dict[str, Any] | None:
    try:
        apart = separated(given, people_of(given)[0], Choices())
    except NotAssessableError:
        return None
    return None if apart is None else {"share": _share(apart), "below": below(apart)}


def _share(apart: Separated) -> float | None:
    ratio = apart.protective / np.maximum(apart.found.distance, TOUCHING)
    return float(np.nanmax(ratio)) if np.isfinite(ratio).any() else 0.0


def below(apart: Separated) -> float:
    """For how long the moving arm was nearer than S_p [s]."""
    return float(sum(one.end - one.begin for one in apart.found.violations(apart.protective)))


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
    """From the motion's begin on: times (n,) [s], where his hand was and where it was to be, in the world, shapes (n,
    3) [m], and when it was to be at its last place [s]; None: nobody knows where it was to be."""
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
