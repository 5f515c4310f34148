"""Posture and task of a person over a recording, as input of posture scoring, with the uncertainty of each angle."""

import math
from collections.abc import Mapping

import numpy as np

from hric_assessment.ergonomics import use
from hric_assessment.ergonomics.posture import ANGLES, MIDDLE, SAME, Posture, Spread, Task, of_joints, to_vertical
from hric_assessment.findings import finite_rows, unknown
from hric_assessment.tables import PostureTable, verdict_table
from hric_assessment.verdict.person import AssessedPerson
from hric_bags.records.human_record import HumanRecord
from hric_core.geometry import FloatArray, Pose
from hric_human.control.kinematics import GRAVITY
from hric_human.control.marker_model import MarkerModel
from hric_human.participant.settings import HAND
from hric_motion.stances import NORMAL

COVERAGE = 3.0
"""Ratio of the uncertainty interval's half-width to the standard deviation of an angle [1].

Project default, unconfirmed. The interval excludes 0.3 % of normally distributed errors, which add up to a second only
in recordings longer than six minutes.
"""
JOINTS = {**SAME, "upper_arm_flexion": "sh_abd", "upper_arm_abduction": "sh_abd", "forearm_inward": "sh_rot"}
"""Joint of the arm from which each posture angle gets its uncertainty.

For the upper arm's flexion it is sh_abd, since sh_flex is singular for an arm to the side.
"""
ARM = ("sh_flex", "sh_abd", "sh_rot", "el_flex", "pro_sup", "wr_flex", "wr_dev")


def posture_of(person: AssessedPerson, side: str) -> tuple[Posture, bool]:
    """Return the posture with one arm, angles rounded, and True if its trunk angles are to the vertical."""
    posture = of_joints(person.names, person.q, side)
    angles = {name: np.asarray(angle) for name in ANGLES if (angle := getattr(posture, name)) is not None}
    inclined, step = _inclined(person, angles), verdict_table()["angle"]
    rounded = {name: np.radians(step * np.round(np.degrees(a) / step)) for name, a in (angles | inclined).items()}
    return Posture(**rounded), bool(inclined)


def _inclined(person: AssessedPerson, angles: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the trunk's angles to the vertical [rad], by name.

    They are NaN at times when the orientation of the root link is unknown; empty if it is always unknown.
    """
    root, max_gap = person.attitude, verdict_table()["max_gap"]
    if root is None or not {"trunk_flexion", "trunk_bend"} <= set(angles):
        return {}
    R_world_root = root.transforms(person.time)[:, :3, :3]
    inclined = np.array(to_vertical(R_world_root, angles["trunk_flexion"], angles["trunk_bend"]))
    window = (0.0, 0.0) if root.fixed else (float(person.time[0]), float(person.time[-1]))
    for begin, end in unknown(root.time, finite_rows(root.pose), window, max_gap):
        inclined[:, (person.time > begin) & (person.time < end)] = np.nan
    return {"trunk_flexion": inclined[0], "trunk_bend": inclined[1]} if np.isfinite(inclined).any() else {}


def _moved(person: AssessedPerson, posture: Posture, side: str) -> tuple[FloatArray, FloatArray]:
    """Return the angles of one arm, and those of neck and trunk, shape (n, k) each [rad]."""
    joints = {f"{side}_{joint}" for joint in ARM}
    middle = [np.asarray(angle) for name in MIDDLE if (angle := getattr(posture, name)) is not None]
    rest = np.array(middle).T if middle else np.empty((len(person.time), 0))
    return person.q[:, [column for column, name in enumerate(person.names) if name in joints]], rest


def repeats_of(person: AssessedPerson, posture: Posture, side: str) -> tuple[FloatArray, FloatArray]:
    """Return the repetitions of one arm, and those of neck and trunk, shape (n,) each [1/min]."""
    tolerance = math.radians(verdict_table()["held"])
    arm, rest = (use.repeats(person.time, angles, tolerance) for angles in _moved(person, posture, side))
    return arm, rest


def task_of(
    person: AssessedPerson,
    record: HumanRecord | None,
    posture: Posture,
    side: str,
    table: PostureTable,
    repeats: tuple[FloatArray, FloatArray],
) -> Task:
    """Return the task of one arm, and of neck and trunk: load, static and repeated use, from the recording.

    Args:
        person: assessed person.
        record: recorded signals of a simulated human, with its grips; None: not recorded.
        posture: posture with the arm.
        side: side of the arm.
        table: table of the scoring method.
        repeats: result of `repeats_of`.
    """
    tolerance, time = math.radians(verdict_table()["held"]), person.time
    arm, rest = _moved(person, posture, side)
    load, static = _load(person, record, side), None
    if load is not None:
        clipped_load = np.minimum(load, table.light)[:, None]
        again = use.repeats(time, clipped_load, 0.5 * table.light) >= table.repeats
        static = again | (use.held(time, clipped_load, 0.5 * table.light, table.static_time) > 0.0)
    return Task(
        load=load,
        static=static,
        held=use.held(time, arm, tolerance, table.static_time),
        repeats=repeats[0],
        rest_held=use.held(time, rest, tolerance, table.static_time),
        rest_repeats=repeats[1],
    )


def spread_of(person: AssessedPerson, side: str) -> dict[str, Spread]:
    """Return the uncertainty (half-width) of each posture angle of a tracked person [rad]; empty: none is known.

    If the standard deviation of each joint angle is known, it is a 95 % interval for each instant, shape (n,).
    Otherwise it is one value for the recording:

    If each coordinate of a marker has the standard deviation s, least squares give angles with the covariance s^2 (J^T
    J)^-1, with the Jacobian J of all markers of the body at the median posture. The root mean square distance r of the
    markers from their model positions is s sqrt((3 m - k) / m), with m markers and k degrees of freedom. The standard
    deviation is multiplied by COVERAGE and rounded like the angles.
    """
    if person.deviation is not None:
        return _spread_over_time(person, person.deviation, side)
    if not 0.0 < person.uncertainty < np.inf:
        return {}
    width = {name: COVERAGE * math.degrees(value) for name, value in tracked_deviations(person).items()}
    joints = MIDDLE | {angle: f"{side}_{name}" for angle, name in (JOINTS | {"knee_flexion": "knee_flex"}).items()}
    step = verdict_table()["angle"]
    known = {angle: width[name] for angle, name in joints.items() if name in width}
    return {angle: math.radians(step * math.floor(width / step + 0.5)) for angle, width in known.items()}


def tracked_deviations(person: AssessedPerson) -> dict[str, float]:
    """Return the standard deviation of each joint angle of a tracked person [rad], see `spread_of`."""
    columns = {name: angle for name, angle in zip(person.names, person.q.T, strict=True) if np.isfinite(angle).any()}
    q = [float(np.nanmedian(columns[name])) if name in columns else 0.0 for name in person.body.joints]
    J = MarkerModel(person.body, tuple(person.body.markers)).at(q, Pose())[1]
    variance = person.uncertainty**2 * len(J) / (3.0 * len(J) - J.shape[2])
    J = J.reshape(-1, J.shape[2])
    deviations = np.sqrt(variance * np.diag(np.linalg.pinv(J.T @ J)))[-len(q) :]
    return dict(zip(person.body.joints, deviations.tolist(), strict=True))


def _spread_over_time(person: AssessedPerson, deviation: FloatArray, side: str) -> dict[str, Spread]:
    """Return the half-width of the 95 % interval of each posture angle at each instant, shape (n,) [rad].

    An angle f(q) of several joints has the variance sum_j d_j^2 (first order, joints as independent), with the larger
    difference d_j of f(q) to f(q + s_j) and f(q - s_j) at the standard deviation s_j of joint j; the larger one, since
    the elevation of a hanging arm has no derivative. The sign of this elevation jumps where the arm points as far back
    as aside, so it does not count. The orientation of the pelvis counts as exact.

    Args:
        person: assessed person.
        deviation: standard deviations of the joint angles, shape (n, j) [rad].
        side: side of the arm.
    """
    middle, step = of_joints(person.names, person.q, side), verdict_table()["angle"]
    known = {name: np.asarray(angle) for name in ANGLES if (angle := getattr(middle, name)) is not None}
    variance = {name: np.zeros(len(person.time)) for name in known}
    for joint in range(len(person.names)):
        shift = np.zeros_like(person.q)
        shift[:, joint] = deviation[:, joint]
        ends = [of_joints(person.names, person.q + sign * shift, side) for sign in (1.0, -1.0)]
        for name, angle in known.items():
            size = np.abs if name == "upper_arm_flexion" else np.asarray
            changes = [np.nan_to_num(size(getattr(end, name)) - size(angle)) for end in ends]
            variance[name] += np.max(np.square(changes), axis=0)
    width = {name: NORMAL * np.degrees(np.sqrt(value)) / step for name, value in variance.items()}
    return {name: np.radians(step * np.ceil(value - 1e-9)) for name, value in width.items()}


def _load(person: AssessedPerson, record: HumanRecord | None, side: str) -> FloatArray | None:
    """Return the load of a hand at the instants of the joint states: grip force divided by g, shape (n,) [kg].

    It is NaN where a grip is not recorded; None if there is no grip.
    """
    segment, settings = person.body.segments.get(f"{side}_hand"), person.settings
    grips, expected = {} if record is None else record.grips, {} if settings is None else settings.grips
    if segment is None or not (grips or expected):
        return None
    total, time = np.zeros(len(person.time)), person.time
    dominant = person.body.segments.get(f"{person.body.subject.dominant_hand}_hand", segment).link
    for name, held in expected.items():
        holder = grips[name].holder.rpartition("::")[2] if name in grips else ""
        if not holder or (held.holder == HAND and holder != dominant):
            total += np.nan  # the grip is not recorded, or the holder is not the hand that the experiment states
    for grip in grips.values():
        if segment.link not in (grip.holder.rpartition("::")[2], grip.held.rpartition("::")[2]):
            continue
        force = np.linalg.norm(grip.force, axis=1)
        total += np.interp(time, grip.time, force, 0.0, 0.0) / float(np.linalg.norm(GRAVITY))
        window, max_gap = (float(time[0]), float(time[-1])), verdict_table()["max_gap"]
        for begin, end in unknown(grip.time, finite_rows(grip.force), window, max_gap):
            total[(time > begin) & (time < end)] = np.nan
    return total
