"""Findings about lifts: loads that a person picks up and puts down, rated by the NIOSH lifting equation.

Loads in recorded grips are found in the recording. Other lifts are stated in the work file: their geometry is that of
the measured posture, with its interval, and the worse end of the lifting index counts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from hric_assessment.ergonomics import niosh
from hric_assessment.ergonomics.niosh import HOUR, Lift
from hric_assessment.findings import LIFT, Evidence, Finding, NotAssessableError, Outcome, finite_rows
from hric_assessment.tables import UNITS, niosh_table, verdict_table
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_assessment.verdict.tasks import TaskMethod, judged, stances_of
from hric_assessment.work import LiftTask, Work
from hric_bags.records.human_record import GripRecord
from hric_core import urdf
from hric_core.geometry import FloatArray
from hric_human.control.kinematics import GRAVITY
from hric_motion.stances import Stance

ASSUMED = (
    "assumed: the load stays in the sagittal plane, does not shift, and is gripped well; one lift in 5 min for 1 h; "
    "the ankles are below the midpoint of the hips, or of the shoulders if the body has only arms"
)


GEOMETRY = ("horizontal distance H [m]", "height V [m]", "travel D [m]", "asymmetry A [rad]")
FROM_POSTURE = (
    "H, V, D and asymmetry from the measured posture: midpoints of hands and ankles, and pelvis (floor of a trial: "
    "height 0); each has the 95 % interval of the joint angles, and the index that of all combinations of ends"
)
HIPS = "assumed: the ankles are below the midpoint of the hips"
WORST_COUPLING, HIGHEST_FREQUENCY = "poor", 100.0
"""Coupling and lifts per minute that count as the worst ones if they are not known."""
LONGEST = 8.0
"""Longest work that the NIOSH equation rates [h]."""


class Lifting(TaskMethod):
    """NIOSH lifting index of loads in recorded grips, and of the lifts in a work file."""

    def findings(self, source: AssessmentInput, person: AssessedPerson, work: Work) -> list[Finding]:
        """Return the findings about a person's lifts."""
        stated = [_stated(person, task, phase, at) for task in work.lifts for at, phase in enumerate(niosh.PHASES)]
        return [*lift_findings(source, person), *stated]


@dataclass(frozen=True)
class LiftTransport:
    """Transport of an object by one or both of a person's hands.

    Attributes:
        held: name of the object.
        hands: number of the person's hands that hold the object.
        time: instants at which all of them hold it and force and point are known, shape (n,) [s].
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
    robot = urdf.read(source.description).name if source.description else "panda"
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
    load, point = np.asarray(force) / float(np.linalg.norm(GRAVITY)), np.mean(points, axis=0)
    known = np.isfinite(load) & finite_rows(point)
    return LiftTransport(held, len(grips), time[known], point[known], load[known])


def _of(transport: LiftTransport, person: AssessedPerson) -> list[Finding]:
    """Return the findings about picking up (from the grip to the highest point) and putting down an object."""
    if not len(transport.time):
        return [
            Finding(
                f"lift of {transport.held}",
                Outcome.NOT_ASSESSABLE,
                "there is no instant at which all hands hold it with known force and point",
                niosh_table().name,
                window=(float(person.time[0]), float(person.time[-1])),
                group=LIFT,
            )
        ]
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


def _stated(person: AssessedPerson, task: LiftTask, phase: str, at: int) -> Finding:
    """Return the finding about one end of a lift of the work file; at: index of the end."""
    table, window = niosh_table(), (task.begin, task.end)
    subject, about = f"{phase} of {task.load:g} kg at {window[at]:g} s", (window, person.signals)
    finding = Finding(subject, Outcome.NOT_ASSESSABLE, "", table.name, None, {}, *about, group=LIFT, person=person.name)
    best, worst = _tasks(task, phase)
    floor = person.settings.floor if person.settings is not None else 0.0
    try:
        stances = stances_of(person, np.array(window))
        middle = _geometry_of(stances.middle, at, floor)
        half = stances.half_width(lambda stance: _geometry_of(stance, at, floor))
        ends = [niosh.rate(lift).index for lift in _corners(best, middle, half)]
        unknown_end = max(niosh.rate(lift).index for lift in _corners(worst, middle, half))
    except NotAssessableError as error:
        return replace(finding, reason=str(error).replace("\n", "; "))
    low, high = min(ends), max(ends)
    shown = f"{high:.2f}" if f"{low:.2f}" == f"{high:.2f}" else f"{low:.2f} to {high:.2f}"
    values: dict[str, float | None] = {"load [kg]": task.load}
    for name, value, width in zip(GEOMETRY, middle.tolist(), half.tolist(), strict=True):
        values |= {name: value, f"{name}, half-width of its interval": width}
    indices = {"": high, ", better end": low, ", unknown at its worst": unknown_end}
    finding = replace(
        finding,
        reason=f"lifting index {shown}: {niosh.level_of(high)}; {_limits()}",
        share=high / table["high"],
        values={**values, **{f"lifting index{name} [1]": index for name, index in indices.items()}},
        notes=(FROM_POSTURE, *[HIPS] * (not stances.legs), *niosh.rate(best).assumptions),
    )
    stated = {"lifts per minute": task.per_minute, "hours of the work": task.hours, "coupling": task.coupling}
    return judged(
        finding, _outcome(high), _outcome(unknown_end), [name for name, value in stated.items() if value is None]
    )


def _tasks(task: LiftTask, phase: str) -> tuple[Lift, Lift]:
    """Return a lift without its geometry, with the best and with the worst values of what is not stated."""
    lift = Lift(phase, task.load, 0.0, 0.0, 0.0)
    if task.coupling is not None:
        lift = replace(lift, coupling=task.coupling)
    lift = replace(lift, frequency=task.per_minute or 0.0, duration=HOUR * (task.hours or 1.0))
    often = HIGHEST_FREQUENCY if task.per_minute is None else task.per_minute
    coupling = task.coupling or WORST_COUPLING
    return lift, replace(lift, frequency=often, duration=HOUR * (task.hours or LONGEST), coupling=coupling)


def _geometry_of(stance: Stance, at: int, floor: float) -> FloatArray:
    """Return the GEOMETRY of one end of a lift; at: index of the end; floor: height of the floor [m]."""
    height = np.maximum(0.0, stance.hands[:, 2] - floor)
    return np.array([stance.reach[at], height[at], abs(height[1] - height[0]), stance.asymmetry[at]])


def _corners(lift: Lift, middle: FloatArray, half: FloatArray) -> Iterator[Lift]:
    """Yield a lift with all combinations of the ends of its geometry, and of the height with the highest limit."""
    low, high = np.maximum(0.0, middle - half), middle + half
    best = UNITS["length"] * niosh_table()["vertical"]
    heights = low[1], high[1], np.clip(best, low[1], high[1])
    for h, v, d, a in product((low[0], high[0]), heights, (low[2], high[2]), (low[3], high[3])):
        yield replace(lift, horizontal=float(h), vertical=float(v), distance=float(d), asymmetry=float(a))


def _limits() -> str:
    table = niosh_table()
    return f"up to {table['design_goal']:g} is within limits, up to {table['high']:g} a warning (chosen here)"


def _rated(transport: LiftTransport, lift: Lift, window: tuple[float, float]) -> Finding:
    table = niosh_table()
    measured = (lift.horizontal, lift.vertical, lift.distance)
    values = {"load, the person's share [kg]": lift.load, **dict(zip(GEOMETRY, measured, strict=False))}
    subject, signals = f"{lift.phase} of {transport.held}", ("/hric/human/grip",)
    unrated = Finding(subject, Outcome.NOT_ASSESSABLE, "", table.name, None, values, window, signals, group=LIFT)
    try:
        rated = niosh.rate(lift)
    except NotAssessableError as error:
        return replace(unrated, reason=str(error).replace("\n", "; "))
    results = {"recommended weight limit [kg]": rated.limit, "lifting index [1]": rated.index}
    results |= {"weight limit by rounded multipliers [kg]": rated.rounded_limit}
    results |= {f"multiplier {name}": value for name, value in rated.multipliers._asdict().items()}
    reason = f"lifting index {rated.index:.2f}: {rated.level}; {_limits()}"
    return replace(
        unrated,
        outcome=_outcome(rated.index),
        reason=reason,
        share=rated.index / table["high"],
        values={**values, **results},
        notes=(ASSUMED, *rated.assumptions),
    )


def _outcome(index: float) -> Outcome:
    table = niosh_table()
    if index > table["high"]:
        return Outcome.ABOVE
    return Outcome.WARNING if index > table["design_goal"] else Outcome.WITHIN
