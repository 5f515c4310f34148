"""Input of posture scoring methods: named angles and flags over time, and values assumed for unknown ones."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.native import load

arm_angles: Callable[[FloatArray, FloatArray], None] = load("hric_posture").arm_angles
"""Function that writes angles of n arms, shape (n, 3) [rad], for their joint positions, shape (n, 4) [rad].

The joints are: flexion f, abduction a and rotation r of the shoulder, flexion e of the elbow. The shoulder's
rotation is Rx(f) Rz(a) Ry(r) in axes X right, Y up, Z back of a right arm.

1. Elevation of the upper arm: its angle to an arm that hangs along the trunk; negative: extension. The upper arm points
   along (sin a, -cos a cos f, -cos a sin f), so its elevation is acos(cos a cos f). It counts as extension if the arm
   is below the shoulder and points farther back than to the side.
2. Abduction of the upper arm: asin(sin a).
3. Angle of the forearm to the sagittal plane, + towards the midline. The forearm points along R_thorax_humerus
   (0, -cos e, -sin e); f rotates about X and does not change the X component.
"""
Angle = FloatArray | float | None
Spread = FloatArray | float
"""Half-width of an uncertainty interval, for all instants or for each, shape (n,) [rad]."""
Flag = np.ndarray[Any, np.dtype[np.bool_]] | bool | None


@dataclass(frozen=True)
class Posture:
    """Posture of a person, with one of the two arms, at n instants.

    Angles [rad] have shape (n,), or are one value for all instants; not known: None, or NaN at single instants.

    Attributes:
        upper_arm_flexion: elevation of the upper arm from hanging along the trunk; negative: behind the trunk.
        upper_arm_abduction: angle of the upper arm out of the sagittal plane of the trunk, outward +.
        upper_arm_rotation: rotation about the axis of the upper arm, internal +.
        shoulder_elevation: elevation of the shoulder girdle.
        elbow_flexion: flexion of the elbow, 0 if straight.
        forearm_inward: angle of the forearm to the sagittal plane, + towards the midline.
        wrist_flexion: flexion of the wrist, + towards the palm.
        wrist_deviation: deviation of the wrist, + to the little finger.
        pronation: rotation of the forearm from mid-position, + in pronation.
        neck_flexion, neck_bend, neck_twist: angles of the neck to the trunk; + forward, to the right, to the left.
        trunk_flexion, trunk_bend: angles of the trunk to the vertical (see `to_vertical`); + forward, to the right.
        trunk_twist: rotation of the trunk relative to the pelvis.
        knee_flexion: flexion of the more flexed knee.
        arm_supported: True if the arm rests on something, or the person leans.
        trunk_supported: True if the person sits with a well supported trunk.
        unbalanced: True if the person is on one leg, or the legs are not well supported.
        sitting: True if the person sits, so that bent knees bear no load.
    """

    upper_arm_flexion: Angle = None
    upper_arm_abduction: Angle = None
    upper_arm_rotation: Angle = None
    shoulder_elevation: Angle = None
    elbow_flexion: Angle = None
    forearm_inward: Angle = None
    wrist_flexion: Angle = None
    wrist_deviation: Angle = None
    pronation: Angle = None
    neck_flexion: Angle = None
    neck_bend: Angle = None
    neck_twist: Angle = None
    trunk_flexion: Angle = None
    trunk_bend: Angle = None
    trunk_twist: Angle = None
    knee_flexion: Angle = None
    arm_supported: Flag = None
    trunk_supported: Flag = None
    unbalanced: Flag = None
    sitting: Flag = None


@dataclass(frozen=True)
class Task:
    """Task of one arm and of the rest of the body: loads, static and repeated use. None: not known.

    Values have shape (n,), or are one value for all instants.

    Attributes:
        load: mass held, or force divided by g [kg].
        static: True for a static or repeated load, False for an intermittent one.
        shock: True if the load comes with a shock, or builds up rapidly.
        held: time for which the posture of the arm is held [s].
        repeats: repetitions of the arm's action [1/min].
        rest_held, rest_repeats: `held` and `repeats` of neck and trunk; None: as for the arm.
        coupling: quality of the hand's grip on the load, one of the names in REBA's table.
        rapid: True if the posture changes rapidly and far, or the base is unstable (REBA).
    """

    load: Angle = None
    static: Flag = None
    shock: Flag = None
    held: Angle = None
    repeats: Angle = None
    rest_held: Angle = None
    rest_repeats: Angle = None
    coupling: str | None = None
    rapid: Flag = None


NOTHING_KNOWN = Task()
ANGLES = tuple(field.name for field in fields(Posture) if field.type == Angle)
ASSUMED: Mapping[str, float] = (
    dict.fromkeys(ANGLES, 0.0)
    | {"elbow_flexion": math.radians(80.0)}  # in the middle of the range with the lowest score
    | {"load": 0.0, "held": 0.0, "repeats": 0.0, "rest_held": 0.0, "rest_repeats": 0.0}
)
"""Values assumed for unknown fields [rad], [kg], [s], [1/min]: those with the lowest score. Unknown flags are False."""
SHARED = {"rest_held": "held", "rest_repeats": "repeats"}
"""Task fields of neck and trunk, each with the field of the arm that is used if it is unknown."""


class Known:
    """Fields of a posture and a task as arrays, with the assumptions for unknown values.

    Args:
        posture: posture of the person.
        task: task of the arm and of the rest of the body.
        fields: names of the fields that a scorer needs.
        spread: uncertainty of angles, half-width of an interval, one value or shape (n,) [rad], by name; inf: not
            known; no entry: exact.

    Attributes:
        count: number of instants n.
        spread: uncertainty of angles, as in Args.
        assumptions: a sentence for each field that is unknown at some or all instants.

    Raises:
        HricError: fields have different lengths.
    """

    def __init__(self, posture: Posture, task: Task, fields: Sequence[str], spread: Mapping[str, Spread]) -> None:
        values = {name: getattr(posture if hasattr(posture, name) else task, name) for name in fields}
        values |= {name: values[arm] for name, arm in SHARED.items() if name in values and values[name] is None}
        self.spread = spread
        lengths = {name: np.size(value) for name, value in values.items() if np.ndim(value) > 0}
        self.count = max(lengths.values(), default=1)
        for name, length in lengths.items():
            if length != self.count or np.ndim(values[name]) > 1:
                raise HricError(
                    f"{name} has the shape {np.shape(values[name])}; valid: one value, or ({self.count},) as others"
                )
        self.assumptions: list[str] = []
        self._values = {name: self._filled(name, value) for name, value in values.items()}

    def __getitem__(self, name: str) -> Any:
        return self._values[name]

    def assume(self, what: str) -> None:
        """Record an assumption, a sentence, unless it is already recorded."""
        if what not in self.assumptions:
            self.assumptions.append(what)

    def _filled(self, name: str, value: Any) -> Any:
        if name not in ASSUMED:
            if value is None:
                self.assumptions.append(f"{name} is not known: assumed false")
            return np.broadcast_to(np.asarray(False if value is None else value, np.bool_), self.count)
        stand_in = ASSUMED[name]
        shown = f"{math.degrees(stand_in):g} deg" if name in ANGLES else f"{stand_in:g}"
        if value is None:
            self.assumptions.append(f"{name} is not known: assumed {shown}")
            return np.full(self.count, stand_in)
        filled = np.array(np.broadcast_to(np.asarray(value, np.float64), self.count))
        missing = ~np.isfinite(filled)
        if missing.any():
            share = f"{int(missing.sum())} of {self.count} instants"
            self.assumptions.append(f"{name} is not known at {share}: assumed {shown} there")
            filled[missing] = stand_in
        return filled


SAME = {
    "elbow_flexion": "el_flex",
    "wrist_flexion": "wr_flex",
    "wrist_deviation": "wr_dev",
    "pronation": "pro_sup",
    "upper_arm_rotation": "sh_rot",
}
"""Posture angles that equal a joint angle of the arm, with the joint's name in `hric_human.body.joints`."""
MIDDLE = {
    "neck_flexion": "neck_flex",
    "neck_bend": "neck_bend",
    "neck_twist": "neck_rot",
    "trunk_flexion": "trunk_flex",
    "trunk_bend": "trunk_bend",
    "trunk_twist": "trunk_rot",
}
"""Posture angles that equal a joint angle of neck or trunk, with the joint's name; trunk angles are to the pelvis."""
OF_ARM = {"upper_arm_flexion": 2, "upper_arm_abduction": 2, "forearm_inward": 4}
"""Results of `arm_angles`, in order, with the number of joints on which they depend."""
LEVEL = 0.5
"""Cosine of the sideways tilt of the pelvis (60 deg) above which trunk angles to the vertical are not defined [1].

Project default, unconfirmed.
"""


def of_joints(names: Sequence[str], q: FloatArray, side: str) -> Posture:
    """Return the posture for joint positions of a body of `hric_human.body`; angles without a joint are None.

    Trunk angles are relative to the pelvis.

    Args:
        names: names of the joints, for example "right_el_flex".
        q: joint positions, shape (n, j), or (j,) for one instant [rad].
        side: side of the arm, "right" or "left".

    Raises:
        HricError: the side is neither "right" nor "left".
    """
    q, origins = np.asarray(q, np.float64), sources(names, side)
    of_arm = np.empty((*q.shape[:-1], len(OF_ARM)))
    angles: dict[str, Any] = {}
    for name, (kind, *joints) in origins.items():
        if kind == 1:
            arm_angles(q.take(joints, axis=-1), of_arm)
        angles[name] = of_arm[..., kind - 1] if kind else np.maximum(q[..., joints[0]], q[..., joints[1]])
    return Posture(**angles)


def sources(names: Sequence[str], side: str) -> dict[str, tuple[int, ...]]:
    """Return the source of each known angle of a posture, five integers, for posture.c.

    They are 0 and the indices of joints, of which the larger one of the first two counts; or the number of the angle
    in OF_ARM, from 1, and the indices of the joints of the arm. Arguments and exceptions: see `of_joints`.
    """
    if side not in ("right", "left"):
        raise HricError(f"the side of the arm is {side!r}; valid: right, left")
    index = {name: number for number, name in enumerate(names)}
    single = {angle: f"{side}_{joint}" for angle, joint in SAME.items()} | MIDDLE
    found = {angle: (0, *[index[joint]] * 4) for angle, joint in single.items() if joint in index}
    if knees := [index[name] for name in ("right_knee_flex", "left_knee_flex") if name in index]:
        found["knee_flexion"] = 0, knees[0], knees[-1], 0, 0
    arm = [index.get(f"{side}_{joint}", -1) for joint in ("sh_flex", "sh_abd", "sh_rot", "el_flex")]
    for number, (angle, needed) in enumerate(OF_ARM.items(), start=1):
        if -1 not in arm[:needed]:
            found[angle] = number, *(max(joint, 0) for joint in arm)
    return found


def to_vertical(R_world_root: FloatArray, flexion: FloatArray, bend: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return flexion and sideways bend of a trunk to the vertical [rad]; z of the world is up.

    The axis of the thorax is a = R_world_root Ry(flexion) Rx(bend) z. Left is the pelvis' left, projected onto the
    horizontal plane, and forward is horizontal and perpendicular to left: flexion = atan2(a_forward, a_up), bend =
    -asin(a_left), equal to the trunk's joint angles on an upright pelvis. The result is NaN if the horizontal part of
    the pelvis' unit vector to the left is not longer than LEVEL.

    Args:
        R_world_root: orientation of the root link (x forward, y left, z up), shape (n, 3, 3).
        flexion: angle of the trunk to the pelvis, forward +, shape (n,) [rad].
        bend: angle of the trunk to the pelvis, to the right +, shape (n,) [rad].
    """
    a_root = np.array([np.sin(flexion) * np.cos(bend), -np.sin(bend), np.cos(flexion) * np.cos(bend)]).T
    x, y, up = np.einsum("nij,nj->ni", R_world_root, a_root).T
    left_x, left_y = R_world_root[:, 0, 1], R_world_root[:, 1, 1]
    level = np.hypot(left_x, left_y)
    level = np.where(level > LEVEL, level, np.nan)
    forward, left = (x * left_y - y * left_x) / level, (x * left_x + y * left_y) / level
    return np.arctan2(forward, up), -np.arcsin(np.clip(left, -1.0, 1.0))


def forearm_inward(abduction: FloatArray, rotation: FloatArray, elbow: FloatArray) -> FloatArray:
    """Return the angle of a forearm to the sagittal plane, + towards the midline [rad].

    The forearm points along R_thorax_humerus (0, -cos el_flex, -sin el_flex) in axes X right, Y up, Z back of the
    thorax; sh_flex rotates about X and does not change the X component.

    Args:
        abduction: sh_abd, shape (n,) [rad].
        rotation: sh_rot, shape (n,) [rad].
        elbow: el_flex, shape (n,) [rad].
    """
    across = np.cos(abduction) * np.sin(elbow) * np.sin(rotation) - np.sin(abduction) * np.cos(elbow)
    return np.asarray(np.arcsin(np.clip(across, -1.0, 1.0)))
