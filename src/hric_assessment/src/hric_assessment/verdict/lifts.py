"""Findings about lifts: loads that a person picks up and puts down, rated by the NIOSH lifting equation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hric_assessment.ergonomics import niosh
from hric_assessment.ergonomics.niosh import Lift, LiftRating
from hric_assessment.findings import LIFT, Evidence, Finding, NotAssessableError, Outcome, finite_rows
from hric_assessment.tables import niosh_table, verdict_table
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_bags.records.human_record import GripRecord
from hric_core.geometry import FloatArray
from hric_human.control.kinematics import GRAVITY

ASSUMED = (
    "assumed: the load stays in the sagittal plane, does not shift, and is gripped well; one lift in 5 min for 1 h; "
    "the ankles are below the midpoint of the hips, or of the shoulders if the body has only arms"
)


@dataclass(frozen=True)
class LiftTransport:
    """Transport of an object by one or both of a person's hands.

    Attributes:
        held: name of the object.
        hands: number of the person's hands that hold the object.
        time: instants at which all of them hold it, shape (n,) [s].
        point: midpoint of the grips, shape (n, 3) [m].
        load: vertical force on the hands divided by g, shape (n,) [kg].
    """

    held: str
    hands: int
    time: FloatArray
    point: FloatArray
    load: FloatArray


def lift_findings(source: AssessmentInput, person: AssessedPerson) -> list[Finding]:
    """Return the findings about picking up and putting down each object that a person lifts with the hands."""
    human = person.record
    if human is None or person.settings is None or person.root is None:
        return []
    links = {segment.link for name, segment in person.body.segments.items() if name.endswith("hand")}
    grips: dict[str, list[GripRecord]] = {}
    for grip in human.grips.values():
        model, _, link = grip.holder.rpartition("::")
        if link in links and model in ("", "human") and "::" in grip.held and grip.closed.any():
            grips.setdefault(grip.held, []).append(grip)
    robot = str((source.definition.get("robot") or {}).get("arm_id", "panda"))
    findings = []
    for held, holding in grips.items():
        if not held.startswith(f"{robot}::"):
            findings += [_proven(finding, holding, human.name) for finding in _of(_transport(held, holding), person)]
    return findings


def _proven(finding: Finding, grips: Sequence[GripRecord], name: str) -> Finding:
    """Add its evidence to a finding; a lift is within limits only if the grips are known during the whole lift."""
    assert finding.window is not None
    gap = verdict_table()["max_gap"]
    usable = [(grip.time, finite_rows(np.hstack([grip.force, grip.point]))) for grip in grips]
    parts = [Evidence.of(time, known, finding.window, gap) for time, known in usable]
    worst = max(parts, key=lambda part: part.longest_gap)
    finding = replace(finding, evidence=worst, signals=(f"{name}/grip",), person=name)
    if finding.outcome in (Outcome.ABOVE, Outcome.NOT_ASSESSABLE) or worst.complete:
        return finding
    reason, remedy = f"the grips are {worst.shortfall}; {finding.reason}", f"record every message of {name}/grip"
    return replace(finding, outcome=Outcome.NOT_ASSESSABLE, reason=reason, remedy=remedy)


def _transport(held: str, grips: Sequence[GripRecord]) -> LiftTransport:
    first = grips[0]
    closed = np.all([np.interp(first.time, grip.time, grip.closed) > 0.5 for grip in grips], axis=0)
    time = first.time[closed]
    points = [np.array([np.interp(time, grip.time, column) for column in grip.point.T]).T for grip in grips]
    force = sum(-np.interp(time, grip.time, grip.force[:, 2]) for grip in grips)
    load = np.asarray(force) / float(np.linalg.norm(GRAVITY))
    return LiftTransport(held, len(grips), time, np.mean(points, axis=0), load)


def _of(transport: LiftTransport, person: AssessedPerson) -> list[Finding]:
    """Return the findings about picking up (from the grip to the highest point) and putting down an object."""
    height, limit = transport.point[:, 2], verdict_table()["lift"]
    top = int(np.argmax(height))
    findings = []
    for phase, end in (("pick-up", 0), ("put-down", len(height) - 1)):
        if float(height[top] - height[end]) > limit:
            window = float(transport.time[min(end, top)]), float(transport.time[max(end, top)])
            findings.append(_rated(transport, _lift(transport, person, phase, end, top), window))
    return findings


def _lift(transport: LiftTransport, person: AssessedPerson, phase: str, end: int, top: int) -> Lift:
    """Return the lift between the transport's begin or end and its highest point.

    end, top: index of the begin or end, and of the highest point.
    """
    settings, root = person.settings, person.root
    assert settings is not None and root is not None
    rows = slice(min(end, top), max(end, top) + 1)
    height, low = transport.point[rows, 2], float(transport.point[end, 2])
    travel = float(transport.point[top, 2]) - low
    raised = height > low + 0.5 * travel
    return Lift(
        phase,
        max(0.0, float(transport.load[rows][raised].mean())),
        float(np.linalg.norm(transport.point[end, :2] - root.at(transport.time[end : end + 1])[0, :2])),
        max(0.0, low - settings.floor),
        travel,
        hands=transport.hands,
        position=settings.person.posture,
        speed=float(np.abs(np.gradient(height, transport.time[rows])).max()) if len(height) > 1 else None,
    )


def _rated(transport: LiftTransport, lift: Lift, window: tuple[float, float]) -> Finding:
    table = niosh_table()
    values = {
        "load, the person's share [kg]": lift.load,
        "horizontal distance H [m]": lift.horizontal,
        "height V [m]": lift.vertical,
        "travel D [m]": lift.distance,
    }
    subject, signals = f"{lift.phase} of {transport.held}", ("/hric/human/grip",)
    unrated = Finding(subject, Outcome.NOT_ASSESSABLE, "", table.name, None, values, window, signals, group=LIFT)
    try:
        rated = niosh.rate(lift)
    except NotAssessableError as error:
        return replace(unrated, reason=str(error).replace("\n", "; "))
    results = {"recommended weight limit [kg]": rated.limit, "lifting index [1]": rated.index}
    results |= {"weight limit by rounded multipliers [kg]": rated.rounded_limit}
    results |= {f"multiplier {name}": value for name, value in rated.multipliers._asdict().items()}
    reason = (
        f"lifting index {rated.index:.2f}: {rated.level}; up to {table['design_goal']:g} is within limits, up to "
        f"{table['high']:g} a warning (chosen here)"
    )
    return replace(
        unrated,
        outcome=_outcome(rated),
        reason=reason,
        share=rated.index / table["high"],
        values={**values, **results},
        notes=(ASSUMED, *rated.assumptions),
    )


def _outcome(rated: LiftRating) -> Outcome:
    table = niosh_table()
    if rated.index > table["high"]:
        return Outcome.ABOVE
    return Outcome.WARNING if rated.index > table["design_goal"] else Outcome.WITHIN
