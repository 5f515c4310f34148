"""Finding about separation: distance of a person from the arm, compared with the protective separation distance S_p."""

from dataclasses import dataclass, replace

import numpy as np

from hric_assessment.findings import (
    SEPARATION,
    BoolArray,
    Evidence,
    Finding,
    NotAssessableError,
    Outcome,
    finite_rows,
    unknown,
)
from hric_assessment.separation.capsules import CapsuleMotion, of_body, speeds, unlogged
from hric_assessment.separation.minima import Separation, separation
from hric_assessment.separation.protective import Terms, person_speed, protective_distance
from hric_assessment.tables import separation_table, verdict_table
from hric_assessment.verdict.choices import AssessmentChoices, BrakingChoice
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_assessment.verdict.result import SeparationCurve, thinned
from hric_bags.reader import ControlRecord
from hric_bags.run_file import held_mass, robots
from hric_core import urdf
from hric_core.geometry import FloatArray

SUBJECT = "distance from the arm"
TOUCHING = 0.01
"""Distance below which the ratio of S_p to the distance is not reported [m]; project default."""
NAMES = ("S_h", "S_r", "S_s", "C", "Z_d", "Z_r")
"""Names of the terms of the protective separation distance S_p."""


@dataclass(frozen=True)
class PersonSeparation:
    """Separation of one person from the arm over a recording, with the protective distance.

    Attributes:
        distances: distances between arm and person.
        speed: speed of the fastest axis end of the arm's capsules, shape (n,) [m/s].
        human: assumed speed v_h of the person, shape (n,) [m/s].
        terms: terms of the protective distance S_p.
        arm, body: links of the capsules of arm and person.
        person: assessed person.
        notes: assumptions and methods, for the finding.
        sampled: True for instants at which arm and person were recorded, shape (n,).
        evidence: evidence of the arm's log, with the share of its motion in which the person is known.
        relied: True if only the distance protected the person: contacts are not judged by force, and nothing is held.
        unlogged: joints that move the arm, or another arm, and are not in the arm's log.
        strangers: joints in the recording that are not in the robot's description.
        shapeless: links of the arm with meshes or without a collision shape, which the distances ignore.
        load: load of the arm [kg].
        unbraked: name of a robot other than Franka's whose stopping is not known; empty: known, or a Franka.
    """

    distances: Separation
    speed: FloatArray
    human: FloatArray
    terms: Terms
    arm: tuple[str, ...]
    body: tuple[str, ...]
    person: AssessedPerson
    notes: tuple[str, ...]
    sampled: BoolArray
    evidence: Evidence
    relied: bool
    unlogged: tuple[str, ...]
    strangers: tuple[str, ...]
    shapeless: tuple[str, ...]
    load: float
    unbraked: str

    def braked(self, braking: BrakingChoice) -> "PersonSeparation":
        """Return the same distances with the protective distance of another braking."""
        human, terms = _protective(self.speed, self.person, braking, self.load)
        return replace(self, human=human, terms=terms)

    @property
    def protective(self) -> FloatArray:
        """Protective distance S_p, shape (n,) [m]; NaN while the arm is at rest or data is missing."""
        return np.where((self.speed > verdict_table()["moving"]) & self.sampled, self.terms.total, np.nan)

    @property
    def margin(self) -> float:
        """Smallest distance minus S_p while the arm moves [m]; infinite if the arm never moves."""
        margins = self.distances.distance - self.protective
        return float(np.nanmin(margins)) if np.isfinite(margins).any() else float("inf")

    @property
    def share(self) -> float | None:
        """Largest ratio of S_p to the distance while the arm moves [1]; None: never moved, or always in touch."""
        distance = self.distances.distance
        ratio = np.where(distance > TOUCHING, self.protective / np.maximum(distance, TOUCHING), np.nan)
        return float(np.nanmax(ratio)) if np.isfinite(ratio).any() else None

    def timeline(self) -> SeparationCurve:
        """Return distance and protective distance over time as curves of the verdict."""
        curves = self.distances.time, self.distances.distance, self.protective
        rows = thinned(*curves)
        return SeparationCurve(*(curve[rows].tolist() for curve in curves))


def separated(source: AssessmentInput, person: AssessedPerson, choices: AssessmentChoices) -> PersonSeparation | None:
    """Return the distances of a person from the arm; None: the recording lacks a required signal.

    Raises:
        NotAssessableError: the arm is faster or has more load than any known stop, or the accuracy of the person's
            markers is not known.
    """
    log = source.recording.log
    if person.root is None or log is None or not source.description:
        return None
    if not np.isfinite(person.uncertainty):
        raise NotAssessableError("the distance between the measured markers and those of the body is not known")
    arm, left_out = source.arm(log)
    robot = arm.capsules
    if not len(robot.radii):
        return None
    q, unknown_share = filled(person.q)
    body = of_body(person.body)
    bodies = CapsuleMotion(urdf.read(person.body.urdf), body, person.names, person.time, q, person.root.transforms)
    begin, end = max(log.time[0], person.time[0]), min(log.time[-1], person.time[-1])
    if not end > begin:
        raise NotAssessableError("arm and person were not recorded at the same time")
    distances = separation(float(begin), float(end), arm, robot.radii, bodies, body.radii)
    speed = speeds(arm, distances.time)
    human, terms = _protective(speed, person, choices.braking, load := held_mass(source.definition))
    notes = _notes(person, choices.braking.text(load), unknown_share)
    relied, joints = _relied(person, notes), [name for each in source.recording.mechanisms.values() for name in each]
    return PersonSeparation(
        distances,
        speed,
        human,
        terms,
        robot.links,
        body.links,
        person,
        tuple(notes),
        _sampled(log, person, distances.time),
        _evidence(source, log, person, arm),
        relied,
        unlogged(arm.tree, log.joint_names),
        tuple(name for name in joints if name not in arm.tree.joints),
        tuple(dict.fromkeys(left_out)),
        load,
        _unbraked(source, choices),
    )


def _unbraked(source: AssessmentInput, choices: AssessmentChoices) -> str:
    """Return the robot's name if its stopping is not known: no stops of it, and it is not a Franka; empty: known."""
    name, stops = urdf.read(source.description).name, choices.braking.stops
    franka = not any(robot.get("urdf") for robot in robots(source.definition))
    own = franka if stops is None or stops.robot is None else stops.robot == name
    return "" if own else name


def _protective(
    speed: FloatArray, person: AssessedPerson, braking: BrakingChoice, load: float
) -> tuple[FloatArray, Terms]:
    """Return the assumed speed of a person, shape (n,) [m/s], and the terms of S_p; arguments: see PersonSeparation."""
    stop = braking.stop(speed, load)
    human = person_speed(speed, stop, 0.0, person.uncertainty, 0.0)
    return human, protective_distance(speed, human, stop, 0.0, person.uncertainty, 0.0)


def _relied(person: AssessedPerson, notes: list[str]) -> bool:
    """Return True if only the distance protected the person; otherwise add a note about the other protection."""
    held = person.record is not None and any(grip.closed.any() for grip in person.record.grips.values())
    if not held and (person.record is None or person.record.stream is None):
        return True
    why = "a hand held the robot or an object" if held else "contacts are assessed by their force"
    notes.append(f"{why}, so a distance below S_p is only a warning (chosen here)")
    return False


def _sampled(log: ControlRecord, person: AssessedPerson, time: FloatArray) -> BoolArray:
    """Return True for instants at which arm and person were recorded, shape (n,)."""
    window, sampled = (float(time[0]), float(time[-1])), np.ones(len(time), dtype=bool)
    for gap in _gaps(log, person, window, np.asarray(np.isfinite(person.q).any(axis=1))):
        sampled &= (time <= gap[0]) | (time >= gap[1])
    return sampled


def _known(log: ControlRecord) -> BoolArray:
    """Return True for cycles with finite positions, shape (n,), that do not repeat while the arm has a velocity."""
    repeated = np.concatenate([[False], (np.diff(log.position, axis=0) == 0.0).all(axis=1)])
    moves = (np.abs(log.velocity) > verdict_table()["moving"]).any(axis=1)
    return finite_rows(log.position) & ~(repeated & moves)


def _gaps(
    log: ControlRecord, person: AssessedPerson, window: tuple[float, float], seen: BoolArray
) -> list[tuple[float, float]]:
    """Return the time intervals of a window in which data of arm, person or root is missing [s].

    seen: True for instants of the person with valid joint angles, shape (n,).
    """
    root, longest = person.root, verdict_table()["max_gap"]
    gaps = [*unknown(log.time, _known(log), window, longest)]
    gaps += unknown(person.time, seen, window, longest)
    if root is not None and not root.fixed:
        gaps += unknown(root.time, finite_rows(root.pose), window, longest)
    return gaps


def _evidence(source: AssessmentInput, log: ControlRecord, person: AssessedPerson, arm: CapsuleMotion) -> Evidence:
    """Return the evidence of the arm's log, with the share of the arm's motion in which the person is fully known."""
    window = source.recording.begin, source.recording.end
    evidence = Evidence.of(log.time, _known(log), window, verdict_table()["max_gap"])
    unseen = np.zeros(len(log.time), dtype=bool)
    for begin, end in _gaps(log, person, window, finite_rows(person.q)):
        unseen |= (log.time > begin) & (log.time < end)
    if not unseen.any():
        return replace(evidence, arm_motion=1.0)
    moving = speeds(arm, log.time) > verdict_table()["moving"]
    period = np.gradient(log.time) if len(log.time) > 1 else np.zeros(len(log.time))
    total = float(period[moving].sum())
    return replace(evidence, arm_motion=1.0 if total <= 0.0 else 1.0 - float(period[moving & unseen].sum()) / total)


def filled(q: FloatArray) -> tuple[FloatArray, float]:
    """Interpolate unknown joint angles (NaN), or set them to zero if never known.

    Returns:
        angles, shape (n, j) [rad]; share of instants with any unknown angle [1].
    """
    lost = ~np.isfinite(q)
    if not lost.any():
        return q, 0.0
    filled, rows = np.zeros_like(q), np.arange(len(q))
    for column in range(q.shape[1]):
        known = ~lost[:, column]
        if known.any():
            filled[:, column] = np.interp(rows, rows[known], q[known, column])
    return filled, float(lost.any(axis=1).mean())


def _notes(person: AssessedPerson, braking: str, unknown_share: float) -> list[str]:
    table, rules = separation_table(), verdict_table()
    notes = [
        f"v_r: speed of the arm's fastest point, in any direction; v_h: {table['walking_speed']:g} m/s, up to "
        f"{table['hand_speed']:g} m/s if S_p is then {table['near']:g} m or less ({table.mark})",
        f"T_r, T_s, S_s: {braking}",
        f"C: 0, since the whole body is known; Z_d: {person.uncertainty:.3f} m ({person.uncertainty_from}); Z_r: 0, "
        "since the arm's joints are measured",
        f"an arm that is slower than {rules['moving']:g} m/s counts as at rest ({rules.value_mark('moving')})",
    ]
    if unknown_share:
        notes.append(
            f"some joints of the person are not known for {100.0 * unknown_share:.1f} % of the time; interpolated then"
        )
    return notes


def not_separated(why: str, name: str = "", remedy: str = "") -> Finding:
    """Return the finding that the separation is not assessable; why: reason, a clause."""
    table = separation_table().name
    return Finding(SUBJECT, Outcome.NOT_ASSESSABLE, why, table, group=SEPARATION, person=name, remedy=remedy)


def separation_finding(approach: PersonSeparation) -> Finding:
    """Return the finding about the protective separation distance."""
    distances, protective, table = approach.distances, approach.protective, separation_table()
    violations = distances.violations(protective)
    if violations:
        worst = min(violations, key=lambda violation: violation.margin)
        at = int(np.searchsorted(distances.time, worst.time))
        below = sum(violation.end - violation.begin for violation in violations)
        window = worst.begin, worst.end
        reason = (
            f"nearer than S_p for {below:.2f} s in total ({len(violations)} times) while the arm moves; at "
            f"{worst.time:.3f} s the distance is {distances.distance[at]:.3f} m, S_p is {protective[at]:.3f} m"
        )
        outcome = Outcome.ABOVE if approach.relied else Outcome.WARNING
    else:
        at = int(np.argmin(distances.distance))
        window = float(distances.time[0]), float(distances.time[-1])
        reason = f"never nearer than S_p while the arm moves; smallest distance {distances.distance[at]:.3f} m"
        outcome = Outcome.WITHIN
    why, remedy = _unproven(approach)
    if outcome != Outcome.ABOVE and why:
        outcome, reason = Outcome.NOT_ASSESSABLE, f"{why}; {reason}"
    link = f"{approach.body[distances.person[at]]} from {approach.arm[distances.arm[at]]}"
    return Finding(
        f"distance of {link}",
        outcome,
        reason,
        table.name,
        None if violations and not approach.relied else approach.share,
        _values(approach, at),
        window,
        ("/control_log", *approach.person.signals),
        (),
        approach.notes,
        group=SEPARATION,
        evidence=approach.evidence,
        remedy=remedy if outcome == Outcome.NOT_ASSESSABLE else "",
        person=approach.person.name,
    )


def _unproven(approach: PersonSeparation) -> tuple[str, str]:
    """Return the reason why a distance cannot be called large enough, and the remedy; both empty: it can."""
    person = approach.person
    if not approach.evidence.complete:
        why = f"the motion of arm or person is not known for the whole time: {approach.evidence.shortfall}"
        topics = [topic for topic in person.signals if not topic.endswith("joint_torque")]
        return why, f"record {' and '.join(['/control_log', *topics])} during the whole run"
    if unmeasured := [joint for joint in person.body.joints if joint not in person.names]:
        why = f"the angles of {', '.join(unmeasured)} are not known and are assumed to be zero"
        return why, f"record all joints of the body in {person.name}/joint_states"
    if approach.unlogged:
        why = f"the positions of {', '.join(approach.unlogged)} are not in the control log and are assumed to be zero"
        return why, "record a control log with all joints of the robot that can move"
    if approach.strangers:
        why = f"the links of joint {', '.join(approach.strangers)} are not placed: the robot's description lacks the joint"
        return why, "record a robot description with all robots and grippers"
    if approach.shapeless:
        why = f"the distance of {', '.join(approach.shapeless)} is not known: collision shapes are meshes or missing"
        return why, "give these links collision shapes: capsules, cylinders, spheres or boxes"
    if person.settings is None and not any(joint.startswith("trunk") for joint in person.body.joints):
        why = "only one or both arms of the person are recorded"
        return why, f"record all joints of the body in {person.name}/joint_states"
    if approach.unbraked and approach.margin >= 0.0:
        why = f"how fast {approach.unbraked} stops is not known; S_p has an assumed stop"
        own = f"stops of this robot, measured or from its manual, with `robot: {approach.unbraked}`"
        return why, f"give {own}: --stop FILE"
    return "", ""


def _values(approach: PersonSeparation, at: int) -> dict[str, float | None]:
    distances, closest = approach.distances, approach.distances.closest
    terms = {
        f"{name} [m]": float(np.broadcast_to(term, distances.time.shape)[at])
        for name, term in zip(NAMES, approach.terms, strict=True)
    }
    return {
        "smallest distance [m]": closest.distance,
        "when [s]": closest.time,
        "distance [m]": float(distances.distance[at]),
        "S_p [m]": float(approach.terms.total[at]),
        **terms,
        "v_r [m/s]": float(approach.speed[at]),
        "v_h [m/s]": float(approach.human[at]),
    }
