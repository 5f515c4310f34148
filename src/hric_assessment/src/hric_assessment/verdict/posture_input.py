"""Posture and task of a person over a recording, as the scorers take them, and how well each angle is known."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hric_assessment.ergonomics import use
from hric_assessment.ergonomics.posture import ANGLES, MIDDLE, SAME, Posture, Task, of_joints, to_vertical
from hric_assessment.evidence import unknown
from hric_assessment.tables import PostureTable, verdict_table
from hric_assessment.verdict.person import Person
from hric_bags.records.human_record import HumanRecord
from hric_control.geometry import FloatArray, Pose
from hric_human.control.kinematics import GRAVITY
from hric_human.control.marked_body import MarkedBody

COVERAGE = 3.0
"""Half-width of the interval of an angle over its standard deviation [1] (project default, unconfirmed): 0.3 % of normal
errors are beyond it, so that a score at its lower end lasts a second by noise in recordings above six minutes alone."""
JOINTS = {**SAME, "upper_arm_flexion": "sh_abd", "upper_arm_abduction": "sh_abd", "forearm_inward": "sh_rot"}
"""Joint of the arm whose uncertainty an angle has. An elevation has that of sh_abd, since sh_flex is singular sideways."""
ARM = ("sh_flex", "sh_abd", "sh_rot", "el_flex", "pro_sup", "wr_flex", "wr_dev")


def posture_of(person: Person, side: str) -> tuple[Posture, bool]:
    """Return the posture with one arm, shape (n,) each, and whether its trunk is to the vertical, or to the pelvis."""
    posture = of_joints(person.names, person.q, side)
    record = person.attitude
    if record is None or posture.trunk_flexion is None or posture.trunk_bend is None:
        return posture, False
    flexion, bend = np.asarray(posture.trunk_flexion), np.asarray(posture.trunk_bend)
    tilted = np.array(to_vertical(record.transforms(person.time)[:, :3, :3], flexion, bend))
    if len(record.time) > 1:
        window = (float(person.time[0]), float(person.time[-1]))
        for begin, end in unknown(record.time, np.ones(len(record.time), np.bool_), window, verdict_table()["max_gap"]):
            tilted[:, (person.time > begin) & (person.time < end)] = np.nan
    if not np.isfinite(tilted).any():
        return posture, False
    return replace(posture, trunk_flexion=tilted[0], trunk_bend=tilted[1]), True


def rounded(posture: Posture) -> Posture:
    """Return the posture with its angles rounded as the rules of the verdict say."""
    step = verdict_table()["angle"]
    angles = {name: getattr(posture, name) for name in ANGLES}
    near = {k: np.radians(step * np.round(np.degrees(a) / step)) for k, a in angles.items() if a is not None}
    return replace(posture, **near)


def task_of(person: Person, record: HumanRecord | None, posture: Posture, side: str, table: PostureTable) -> Task:
    """Return the load and the static and repeated use of one arm, and of neck and trunk, counted from the recording."""
    tolerance, time = math.radians(verdict_table()["held"]), person.time
    arm = [column for column, name in enumerate(person.names) if name in {f"{side}_{joint}" for joint in ARM}]
    middle = [np.asarray(angle) for name in MIDDLE if (angle := getattr(posture, name)) is not None]
    rest = np.array(middle).T if middle else np.empty((len(time), 0))
    load, static = _load(person, record, side), None
    if load is not None:
        carried = np.minimum(load, table.light)[:, None]
        again = use.repeats(time, carried, 0.5 * table.light) >= table.repeats
        static = again | (use.held(time, carried, 0.5 * table.light, table.static_time) > 0.0)
    return Task(
        load=load,
        static=static,
        held=use.held(time, person.q[:, arm], tolerance, table.static_time),
        repeats=use.repeats(time, person.q[:, arm], tolerance),
        rest_held=use.held(time, rest, tolerance, table.static_time),
        rest_repeats=use.repeats(time, rest, tolerance),
    )


def spread_of(person: Person, side: str) -> Mapping[str, float]:
    """Return the half-width of the interval in which each angle of a tracked person lies [rad], by name; else none.

    By least squares: markers with a standard deviation s of each coordinate give angles with the covariance
    s^2 (J^T J)^-1, J the Jacobian of all markers of the body at the median posture; their root mean square distance r
    from where the body has them is s sqrt((3 m - k) / m), of m markers and k motions. It is multiplied by COVERAGE, and
    rounded as angles are.
    """
    if not person.uncertainty > 0.0:
        return {}
    columns = dict(zip(person.names, person.q.T, strict=True))
    q = [float(np.nanmedian(columns[name])) if _seen(columns.get(name)) else 0.0 for name in person.body.joints]
    J = MarkedBody(person.body, tuple(person.body.markers)).at(q, Pose())[1]
    variance = person.uncertainty**2 * len(J) / (3.0 * len(J) - J.shape[2])
    J = J.reshape(-1, J.shape[2])
    deviations = np.sqrt(variance * np.diag(np.linalg.pinv(J.T @ J)))[-len(q) :]
    width = dict(zip(person.body.joints, COVERAGE * np.degrees(deviations), strict=True))
    joints = {name: (f"{side}_{joint}",) for name, joint in JOINTS.items()}
    joints |= {name: (joint,) for name, joint in MIDDLE.items()}
    joints["knee_flexion"] = ("right_knee_flex", "left_knee_flex")
    step = verdict_table()["angle"]
    return {
        angle: math.radians(step * math.floor(max(width[name] for name in names) / step + 0.5))
        for angle, names in joints.items()
        if all(name in width for name in names)
    }


def _seen(angle: FloatArray | None) -> bool:
    return angle is not None and bool(np.isfinite(angle).any())


def _load(person: Person, record: HumanRecord | None, side: str) -> FloatArray | None:
    """Return the force on a hand over g at the instants of the joint states, shape (n,) [kg]; None: not recorded."""
    segment = person.body.segments.get(f"{side}_hand")
    if record is None or segment is None or not record.grips:
        return None
    total = np.zeros(len(person.time))
    for grip in record.grips.values():
        for body in (grip.holder, grip.held):
            if body.rpartition("::")[2] == segment.link:
                force = np.linalg.norm(grip.force, axis=1)
                total += np.interp(person.time, grip.time, force, 0.0, 0.0) / float(np.linalg.norm(GRAVITY))
    return total
