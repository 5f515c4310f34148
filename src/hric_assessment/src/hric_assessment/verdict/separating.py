"""The finding of separation: how far the person was from the arm, and how far he should have been."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_assessment.findings import Finding, Outcome
from hric_assessment.separation.capsules import of_body
from hric_assessment.separation.minima import Separation, separation
from hric_assessment.separation.protective import Terms, person_speed, protective_distance
from hric_assessment.tables import separation_table, verdict_table
from hric_assessment.verdict.capsule_motion import CapsuleMotion, capsules_of, speeds
from hric_assessment.verdict.choices import Choices
from hric_assessment.verdict.given import Given
from hric_assessment.verdict.person import Person
from hric_assessment.verdict.result import numbers, thinned
from hric_control import urdf
from hric_control.geometry import FloatArray

GROUP = "separation"
TOUCHING = 0.01
"""Distance up to which S_p over it is no figure any more [m]; project default."""
NAMES = ("S_h", "S_r", "S_s", "C", "Z_d", "Z_r")
"""Of the terms of S_p."""


@dataclass(frozen=True)
class Separated:
    """Of a recording.

    Attributes:
        found: distances.
        speed: of the fastest end of the arm's capsules, shape (n,) [m/s].
        human: v_h, shape (n,) [m/s].
        terms: of S_p.
        arm, person: links of the capsules.
        notes: how it was made.
        signals: topics.
        known: share of the time for which the person's place was known [1].
        relied: nothing but the distance protected the person.
    """

    found: Separation
    speed: FloatArray
    human: FloatArray
    terms: Terms
    arm: tuple[str, ...]
    person: tuple[str, ...]
    notes: tuple[str, ...]
    signals: tuple[str, ...]
    known: float
    relied: bool

    @property
    def protective(self) -> FloatArray:
        """S_p while the arm moves, NaN while it rests, shape (n,) [m]."""
        return np.where(self.speed > verdict_table()["moving"], self.terms.total, np.nan)

    def timeline(self) -> dict[str, Any]:
        """For the JSON."""
        time, distance, protective = self.found.time, self.found.distance, self.protective
        rows = thinned(time, distance, protective)
        return {
            "time": time[rows].tolist(),
            "distance": numbers(distance[rows]),
            "protective": numbers(protective[rows]),
        }


def separated(given: Given, person: Person | None, choices: Choices) -> Separated | None:
    """None: something that it needs is not there.

    Raises:
        NotAssessableError: the arm is faster, or carries more, than any stop that is known.
    """
    log = given.recording.log
    if person is None or person.root is None or log is None or not given.description:
        return None
    tree = urdf.read(given.description)
    robot, left_out = capsules_of(tree, log.joint_names)
    if not len(robot.radii):
        return None
    arm = CapsuleMotion(tree, robot, log.joint_names, log.time, log.position)
    q, unknown = filled(person.q)
    body = of_body(person.body)
    him = CapsuleMotion(urdf.read(person.body.urdf), body, person.names, person.time, q, person.root.transforms)
    begin, end = max(log.time[0], person.time[0]), min(log.time[-1], person.time[-1])
    if not end > begin:
        return None
    found = separation(float(begin), float(end), arm, robot.radii, him, body.radii)
    speed = speeds(arm, found.time)
    uncertainty = person.uncertainty
    load = float((given.definition.get("robot") or {}).get("load", {}).get("mass", 0.0))
    stop = choices.braking.stop(speed, load)
    human = person_speed(speed, stop, 0.0, uncertainty, 0.0)
    terms = protective_distance(speed, human, stop, 0.0, uncertainty, 0.0)
    notes = _notes(person, choices.braking.text(load), left_out, unknown)
    held, felt = _held(given), any(topic.endswith("human/contacts") for topic in given.recording.topics)
    relied = not (held or felt)
    if not relied:
        why = "his hand held the robot or what it holds" if held else "contacts with him are assessed by their force"
        notes.append(f"the distance was not what protected him: {why}; below it is a warning (chosen here)")
    signals = ("/control_log", *person.signals)
    known = 1.0 - unknown
    return Separated(found, speed, human, terms, robot.links, body.links, tuple(notes), signals, known, relied)


def filled(q: FloatArray) -> tuple[FloatArray, float]:
    """Angles with straight lines over what is not known, zero where nothing is, shape (n, j) [rad]; and the share of
    instants with any such [1]."""
    lost = ~np.isfinite(q)
    if not lost.any():
        return q, 0.0
    filled, rows = np.zeros_like(q), np.arange(len(q))
    for column in range(q.shape[1]):
        known = ~lost[:, column]
        if known.any():
            filled[:, column] = np.interp(rows, rows[known], q[known, column])
    return filled, float(lost.any(axis=1).mean())


def _held(given: Given) -> bool:
    human = given.recording.human
    return human is not None and any(grip.closed.any() for grip in human.grips.values())


def _notes(person: Person, braking: str, left_out: Sequence[str], unknown: float) -> list[str]:
    table, rules = separation_table(), verdict_table()
    notes = [
        f"v_r: of the fastest point of the arm, whatever its direction; v_h: {table['walking_speed']:g} m/s, up to "
        f"{table['hand_speed']:g} m/s where S_p is then {table['near']:g} m or less ({table.mark})",
        f"T_r, T_s, S_s: {braking}",
        f"C: 0, since the whole body is known; Z_d: {person.uncertainty:.3f} m ({person.uncertainty_from}); Z_r: 0, "
        "the arm's joints are measured",
        f"an arm that is slower than {rules['moving']:g} m/s stands ({rules.mark_of(rules.moving)})",
    ]
    if left_out:
        notes.append(f"not in it, since they are meshes: {', '.join(dict.fromkeys(left_out))}")
    if unknown:
        notes.append(
            f"some of his joints are not known for {100.0 * unknown:.1f} % of the time, and interpolated there"
        )
    return notes


def not_separated(why: str) -> Finding:
    """It cannot be held against the protective distance; why: a sentence."""
    name = separation_table().name
    return Finding("distance from the arm", Outcome.NOT_ASSESSABLE, why, name, group=GROUP)


def separation_finding(one: Separated) -> Finding:
    """Held against the protective separation distance."""
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
        known = one.known >= verdict_table()["known"]
        outcome = Outcome.WITHIN if known else Outcome.NOT_ASSESSABLE
        reason += "" if known else "; but all joints of the person are known for too little of the time"
    return Finding(
        f"distance of {one.person[found.person[at]]} from {one.arm[found.arm[at]]}",
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
    )


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
