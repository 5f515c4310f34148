"""Finding of separation: distance of a person from the arm, compared with the distance that the arm needs to stop."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_assessment.evidence import BoolArray, Evidence, finite_rows, unknown
from hric_assessment.findings import Finding, NotAssessableError, Outcome
from hric_assessment.separation.capsules import of_body
from hric_assessment.separation.links import CapsuleMotion, capsules_of, moved_by, speeds
from hric_assessment.separation.minima import Separation, separation
from hric_assessment.separation.protective import Stop, Terms, person_speed, protective_distance
from hric_assessment.tables import separation_table, verdict_table
from hric_assessment.verdict.choices import Choices
from hric_assessment.verdict.given import Given
from hric_assessment.verdict.person import Person
from hric_assessment.verdict.result import numbers, thinned
from hric_bags.reader import ControlRecord
from hric_core import urdf
from hric_core.geometry import FloatArray

GROUP = "separation"
SUBJECT = "distance from the arm"
TOUCHING = 0.01
"""Distance up to which the ratio of S_p to it is not reported [m]; project default."""
NAMES = ("S_h", "S_r", "S_s", "C", "Z_d", "Z_r")
"""Names of the terms of S_p."""


@dataclass(frozen=True)
class Separated:
    """Separation of one person over a recording.

    Attributes:
        found: distances.
        speed: speed of the fastest end of the arm's capsules, shape (n,) [m/s].
        human: v_h, shape (n,) [m/s].
        terms: terms of S_p.
        arm, person: links of the capsules.
        notes: assumptions and methods.
        signals: topics.
        sampled: True where arm and person were recorded, shape (n,).
        evidence: evidence of the arm's log, with the share of its motion in which the person is known.
        relied: True if only the distance protected the person.
        shapeless: links of the arm with mesh shapes, which the distances ignore.
        unmeasured: joints of the body whose angles are never known, and assumed as zero.
        name: namespace of the person.
    """

    found: Separation
    speed: FloatArray
    human: FloatArray
    terms: Terms
    arm: tuple[str, ...]
    person: tuple[str, ...]
    notes: tuple[str, ...]
    signals: tuple[str, ...]
    sampled: BoolArray
    evidence: Evidence
    relied: bool
    shapeless: tuple[str, ...]
    unmeasured: tuple[str, ...]
    name: str

    @property
    def protective(self) -> FloatArray:
        """Protective distance S_p while the arm moves, NaN at rest or without recorded data, shape (n,) [m]."""
        return np.where((self.speed > verdict_table()["moving"]) & self.sampled, self.terms.total, np.nan)

    @property
    def margin(self) -> float:
        """Smallest distance minus S_p while the arm moves [m]; infinite: it never moves."""
        margins = self.found.distance - self.protective
        return float(np.nanmin(margins)) if np.isfinite(margins).any() else float("inf")

    def timeline(self) -> dict[str, Any]:
        """Return the curves for the JSON."""
        time, distance, protective = self.found.time, self.found.distance, self.protective
        rows = thinned(time, distance, protective)
        return {
            "time": time[rows].tolist(),
            "distance": numbers(distance[rows]),
            "protective": numbers(protective[rows]),
        }


def separated(given: Given, person: Person, choices: Choices) -> Separated | None:
    """Return the distances of a person from the arm; None: a required signal is not in the recording.

    Raises:
        NotAssessableError: the arm is faster, or carries more, than any known stop, or the accuracy of the markers on
            the body is unknown.
    """
    log = given.recording.log
    if person.root is None or log is None or not given.description:
        return None
    if not np.isfinite(person.uncertainty):
        raise NotAssessableError("how far the markers are from those of the body is not known")
    tree = urdf.read(given.description)
    robot, left_out = capsules_of(tree, moved_by(tree, log.joint_names))
    if not len(robot.radii):
        return None
    arm = CapsuleMotion(tree, robot, log.joint_names, log.time, log.position)
    q, unknown_share = filled(person.q)
    body = of_body(person.body)
    bodies = CapsuleMotion(urdf.read(person.body.urdf), body, person.names, person.time, q, person.root.transforms)
    begin, end = max(log.time[0], person.time[0]), min(log.time[-1], person.time[-1])
    if not end > begin:
        raise NotAssessableError("arm and person were not recorded at the same time")
    found = separation(float(begin), float(end), arm, robot.radii, bodies, body.radii)
    speed = speeds(arm, found.time)
    load = float((given.definition.get("robot") or {}).get("load", {}).get("mass", 0.0))
    human, terms = _protective(speed, choices.braking.stop(speed, load), person.uncertainty)
    notes = _notes(person, choices.braking.text(load), unknown_share)
    relied = _relied(person, notes)
    return Separated(
        found,
        speed,
        human,
        terms,
        robot.links,
        body.links,
        tuple(notes),
        ("/control_log", *person.signals),
        _sampled(log, person, found.time),
        _evidence(given, log, person, arm),
        relied,
        tuple(dict.fromkeys(left_out)),
        tuple(joint for joint in person.body.joints if joint not in person.names),
        person.name,
    )


def _relied(person: Person, notes: list[str]) -> bool:
    """Return True if only the distance protected the person; otherwise add a note on the other protection."""
    held = person.record is not None and any(grip.closed.any() for grip in person.record.grips.values())
    if not held and (person.record is None or person.record.stream is None):
        return True
    why = "a hand held the robot or what it holds" if held else "contacts are assessed by their force"
    notes.append(f"the distance was not what protected the person: {why}; below it is a warning (chosen here)")
    return False


def _protective(speed: FloatArray, stop: Stop, uncertainty: float) -> tuple[FloatArray, Terms]:
    """Return v_h [m/s] and the terms of S_p for speeds of the arm [m/s] and the uncertainty of the person [m]."""
    human = person_speed(speed, stop, 0.0, uncertainty, 0.0)
    return human, protective_distance(speed, human, stop, 0.0, uncertainty, 0.0)


def _sampled(log: ControlRecord, person: Person, time: FloatArray) -> BoolArray:
    """Return a mask of the instants at which arm and person were recorded, shape (n,)."""
    window, sampled = (float(time[0]), float(time[-1])), np.ones(len(time), dtype=bool)
    for gap in _gaps(log, person, window, np.asarray(np.isfinite(person.q).any(axis=1))):
        sampled &= (time <= gap[0]) | (time >= gap[1])
    return sampled


def _gaps(
    log: ControlRecord, person: Person, window: tuple[float, float], seen: BoolArray
) -> list[tuple[float, float]]:
    """Return the stretches of a window without data of arm, person or root [s]; seen: valid rows, shape (n,)."""
    root, longest = person.root, verdict_table()["max_gap"]
    gaps = [*unknown(log.time, finite_rows(log.position), window, longest)]
    gaps += unknown(person.time, seen, window, longest)
    if root is not None and not root.fixed:
        gaps += unknown(root.time, finite_rows(root.pose), window, longest)
    return gaps


def _evidence(given: Given, log: ControlRecord, person: Person, arm: CapsuleMotion) -> Evidence:
    """Return the evidence of the arm's log, with the share of its motion in which the person is completely known."""
    window = given.recording.begin, given.recording.end
    finite = finite_rows(log.position)
    evidence = Evidence.of(log.time, finite, window, verdict_table()["max_gap"])
    moving = speeds(arm, log.time) > verdict_table()["moving"]
    period = np.gradient(log.time) if len(log.time) > 1 else np.zeros(len(log.time))
    unseen = np.zeros(len(log.time), dtype=bool)
    for begin, end in _gaps(log, person, window, finite_rows(person.q)):
        unseen |= (log.time > begin) & (log.time < end)
    total = float(period[moving].sum())
    return evidence.with_arm_motion(1.0 if total <= 0.0 else 1.0 - float(period[moving & unseen].sum()) / total)


def filled(q: FloatArray) -> tuple[FloatArray, float]:
    """Return angles with unknown values interpolated, or zero if never known, shape (n, j) [rad].

    The second result is the share of instants with any unknown value [1].
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


def _notes(person: Person, braking: str, unknown_share: float) -> list[str]:
    table, rules = separation_table(), verdict_table()
    notes = [
        f"v_r: of the fastest point of the arm, whatever its direction; v_h: {table['walking_speed']:g} m/s, up to "
        f"{table['hand_speed']:g} m/s where S_p is then {table['near']:g} m or less ({table.mark})",
        f"T_r, T_s, S_s: {braking}",
        f"C: 0, since the whole body is known; Z_d: {person.uncertainty:.3f} m ({person.uncertainty_from}); Z_r: 0, "
        "the arm's joints are measured",
        f"an arm that is slower than {rules['moving']:g} m/s stands ({rules.mark_of(rules.moving)})",
    ]
    if unknown_share:
        notes.append(
            f"some joints of the person are not known for {100.0 * unknown_share:.1f} % of the time, where they are "
            "interpolated"
        )
    return notes


def not_separated(why: str, name: str = "", remedy: str = "") -> Finding:
    """Return the finding if nothing can be compared with the protective distance; why: a clause."""
    table = separation_table().name
    return Finding(SUBJECT, Outcome.NOT_ASSESSABLE, why, table, group=GROUP, person=name, remedy=remedy)


def separation_finding(one: Separated) -> Finding:
    """Return the finding of the protective separation distance."""
    found, protective, table = one.found, one.protective, separation_table()
    violations = found.violations(protective)
    ratio = np.where(found.distance > TOUCHING, protective / np.maximum(found.distance, TOUCHING), np.nan)
    if violations:
        worst = min(violations, key=lambda violation: violation.margin)
        at = int(np.searchsorted(found.time, worst.time))
        below = sum(violation.end - violation.begin for violation in violations)
        window = worst.begin, worst.end
        reason = (
            f"nearer than S_p for {below:.2f} s in {len(violations)} stretches while the arm moves; at "
            f"{worst.time:.3f} s {found.distance[at]:.3f} m of {protective[at]:.3f} m"
        )
        outcome = Outcome.ABOVE if one.relied else Outcome.WARNING
    else:
        at = int(np.argmin(found.distance))
        window = float(found.time[0]), float(found.time[-1])
        reason = f"never nearer than S_p while the arm moves; nearest {found.distance[at]:.3f} m"
        outcome = Outcome.WITHIN
    why, remedy = _unproven(one)
    if outcome != Outcome.ABOVE and why:
        outcome, reason = Outcome.NOT_ASSESSABLE, f"{why}; {reason}"
    link = f"{one.person[found.person[at]]} from {one.arm[found.arm[at]]}"
    return Finding(
        f"distance of {link}",
        outcome,
        reason,
        table.name,
        None if (violations and not one.relied) or not np.isfinite(ratio).any() else float(np.nanmax(ratio)),
        _values(one, at),
        window,
        one.signals,
        (),
        one.notes,
        GROUP,
        evidence=one.evidence,
        remedy=remedy if outcome == Outcome.NOT_ASSESSABLE else "",
        person=one.name,
    )


def _unproven(one: Separated) -> tuple[str, str]:
    """Return why a distance is not proven to be large enough, and the remedy; both empty: it is proven."""
    if not one.evidence.complete:
        why = f"the arm's motion or the person is not known for all of the time: {one.evidence.shortfall}"
        topics = [topic for topic in one.signals if not topic.endswith("joint_torque")]
        return why, f"record {' and '.join(topics)} for all of the run"
    if one.unmeasured:
        why = f"the angles of {', '.join(one.unmeasured)} are not known, and taken as zero"
        return why, f"record all joints of the body in {one.name}/joint_states"
    if one.shapeless:
        why = f"the distance of {', '.join(one.shapeless)} is not known, whose shapes are meshes"
        return why, "give these links collision shapes: capsules, cylinders, spheres or boxes"
    return "", ""


def _values(one: Separated, at: int) -> dict[str, float | None]:
    found, closest = one.found, one.found.closest
    terms = {
        f"{name} [m]": float(np.broadcast_to(term, found.time.shape)[at])
        for name, term in zip(NAMES, one.terms, strict=True)
    }
    return {
        "smallest distance [m]": closest.distance,
        "when [s]": closest.time,
        "distance [m]": float(found.distance[at]),
        "S_p [m]": float(one.terms.total[at]),
        **terms,
        "v_r [m/s]": float(one.speed[at]),
        "v_h [m/s]": float(one.human[at]),
    }
