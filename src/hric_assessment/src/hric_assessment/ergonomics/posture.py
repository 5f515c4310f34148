"""What scorers of postures take: named angles and flags over time, and what is taken for those that are not known."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from hric_control.errors import HricError
from hric_control.geometry import FloatArray

Angle = FloatArray | float | None
Flag = np.ndarray[Any, np.dtype[np.bool_]] | bool | None


@dataclass(frozen=True)
class Posture:
    """A person at n instants, with one of the two arms.

    Angles [rad], each of shape (n,) or one for all; None, and NaN at single instants: not known.

    Attributes:
        upper_arm_flexion: forward from hanging, to the trunk.
        upper_arm_abduction: outward from the trunk.
        upper_arm_rotation: about its own axis, internal +.
        shoulder_elevation: of the shoulder girdle.
        elbow_flexion: 0 straight.
        forearm_inward: of the forearm to the sagittal plane, + towards the midline.
        wrist_flexion: + towards the palm.
        wrist_deviation: + to the little finger.
        pronation: from mid-position.
        neck_flexion, neck_bend, neck_twist: to the trunk; forward, to the right, to the left +.
        trunk_flexion, trunk_bend, trunk_twist: to the vertical, or to the pelvis; likewise.
        knee_flexion: of the knee that is bent more.
        arm_supported: the arm rests on something, or the person leans.
        trunk_supported: sits with a well supported trunk.
        unbalanced: is on one leg, or the legs are not well supported.
        sitting: the bent knees carry nothing.
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
    """What the person does with that arm, each of shape (n,) or one for all; None: not known.

    Attributes:
        load: mass held, or force over g [kg].
        static: the load is held, or comes again and again; without it, it is intermittent.
        shock: the load comes with a shock, or builds up rapidly.
        held: for how long the posture has been held [s].
        repeats: of the action [1/min].
        coupling: of the hand with the load, one of the table's names (REBA).
        rapid: the posture changes rapidly and far, or the base is unstable (REBA).
    """

    load: Angle = None
    static: Flag = None
    shock: Flag = None
    held: Angle = None
    repeats: Angle = None
    coupling: str | None = None
    rapid: Flag = None


NOTHING_KNOWN = Task()
ANGLES = tuple(field.name for field in fields(Posture) if field.type == Angle)
ASSUMED: Mapping[str, float] = (
    dict.fromkeys(ANGLES, 0.0)
    | {"elbow_flexion": math.radians(80.0)}  # in the middle of the range that scores least
    | {"load": 0.0, "held": 0.0, "repeats": 0.0}
)
"""What is taken for what is not known [rad], [kg], [s], [1/min]: of each angle where it scores least. Flags that are
not known do not hold."""


class Known:
    """The fields of a posture and a task as arrays, with what was assumed.

    Args:
        posture, task: as given.
        fields: names of those that a scorer needs.

    Attributes:
        count: n.
        assumptions: a sentence for each field that is not known, wholly or in part.

    Raises:
        HricError: fields of different lengths.
    """

    def __init__(self, posture: Posture, task: Task, fields: Sequence[str]) -> None:
        given = {name: getattr(posture if hasattr(posture, name) else task, name) for name in fields}
        lengths = {name: np.size(value) for name, value in given.items() if np.ndim(value) > 0}
        self.count = max(lengths.values(), default=1)
        for name, length in lengths.items():
            if length != self.count or np.ndim(given[name]) > 1:
                raise HricError(
                    f"{name} has the shape {np.shape(given[name])}; valid: one value, or ({self.count},) as the others"
                )
        self.assumptions: list[str] = []
        self._values = {name: self._filled(name, value) for name, value in given.items()}

    def __getitem__(self, name: str) -> Any:
        return self._values[name]

    def assume(self, what: str) -> None:
        """Note an assumption, once."""
        if what not in self.assumptions:
            self.assumptions.append(what)

    def _filled(self, name: str, value: Any) -> Any:
        if name not in ASSUMED:
            if value is None:
                self.assumptions.append(f"{name} is not known: taken as not so")
            return np.broadcast_to(np.asarray(False if value is None else value, np.bool_), self.count)
        stand_in = ASSUMED[name]
        shown = f"{math.degrees(stand_in):g} deg" if name in ANGLES else f"{stand_in:g}"
        if value is None:
            self.assumptions.append(f"{name} is not known: taken as {shown}")
            return np.full(self.count, stand_in)
        filled = np.array(np.broadcast_to(np.asarray(value, np.float64), self.count))
        missing = ~np.isfinite(filled)
        if missing.any():
            share = f"{int(missing.sum())} of {self.count} instants"
            self.assumptions.append(f"{name} is not known at {share}: taken as {shown} there")
            filled[missing] = stand_in
        return filled


SAME = {
    "elbow_flexion": "el_flex",
    "wrist_flexion": "wr_flex",
    "wrist_deviation": "wr_dev",
    "pronation": "pro_sup",
    "upper_arm_flexion": "sh_flex",
    "upper_arm_abduction": "sh_abd",
    "upper_arm_rotation": "sh_rot",
}
"""Angles of a posture that are joints of an arm of `hric_human.body.joints`. Since a shoulder is Rx(sh_flex) Rz(sh_abd)
Ry(sh_rot) there, sh_flex is the angle of the upper arm within the sagittal plane and sh_abd the angle out of it."""
MIDDLE = {
    "neck_flexion": "neck_flex",
    "neck_bend": "neck_bend",
    "neck_twist": "neck_rot",
    "trunk_flexion": "trunk_flex",
    "trunk_bend": "trunk_bend",
    "trunk_twist": "trunk_rot",
}
"""Likewise of the trunk: to the pelvis, whose own inclination is not in it."""


def of_joints(names: Sequence[str], q: FloatArray, side: str) -> Posture:
    """Posture of a body of `hric_human.body`; what has no joint there is not known.

    Args:
        names: of the joints, "right_el_flex".
        q: joint positions, shape (n, j) [rad].
        side: of the arm, "right" or "left".

    Raises:
        HricError: another side.
    """
    if side not in ("right", "left"):
        raise HricError(f"no arm {side!r}; valid: right, left")
    columns = dict(zip(names, np.asarray(q, np.float64).T, strict=True))
    found: dict[str, Any] = {name: columns.get(f"{side}_{joint}") for name, joint in SAME.items()}
    found |= {name: columns.get(joint) for name, joint in MIDDLE.items()}
    knees = [columns[name] for name in ("right_knee_flex", "left_knee_flex") if name in columns]
    if knees:
        found["knee_flexion"] = np.max(knees, axis=0)
    turned = [found[name] for name in ("upper_arm_abduction", "upper_arm_rotation", "elbow_flexion")]
    if all(angle is not None for angle in turned):
        found["forearm_inward"] = forearm_inward(*turned)
    return Posture(**found)


def forearm_inward(abduction: FloatArray, rotation: FloatArray, elbow: FloatArray) -> FloatArray:
    """Angle of a forearm to the sagittal plane, + towards the midline [rad], of sh_abd, sh_rot and el_flex [rad].

    Along the forearm is R_thorax_humerus (0, -cos el_flex, -sin el_flex) in axes X right, Y up, Z back of a right arm;
    sh_flex turns about X and so leaves its X component.
    """
    across = np.cos(abduction) * np.sin(elbow) * np.sin(rotation) - np.sin(abduction) * np.cos(elbow)
    return np.asarray(np.arcsin(np.clip(across, -1.0, 1.0)))
