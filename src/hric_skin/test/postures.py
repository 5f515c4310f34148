"""Subjects and postures in which the skin is tested and shown."""

import numpy as np
from trimesh.transformations import rotation_matrix

from hric_core.geometry import FloatArray, homogeneous
from hric_human.body import Body, Subject, describe
from hric_human.body.segments import ROOT

SUBJECTS = [
    ("female", 50.0, 1.55),
    ("female", 62.0, 1.63),
    ("male", 79.0, 1.75),
    ("male", 95.0, 1.86),
    ("male", 115.0, 1.95),
]


def both(**angles: float) -> dict[str, float]:
    """Angles of joints that are on two sides [deg]."""
    return {f"{side}_{name}": angle for name, angle in angles.items() for side in ("right", "left")}


POSTURES = {
    "standing": {},
    "reaching": {**both(sh_flex=80, el_flex=20), "right_el_flex": 60.0},
    "deep squat": {**both(hip_flex=100, knee_flex=100, ankle_flex=15, sh_flex=40, el_flex=140), "trunk_flex": 60.0},
    "overhead": both(sh_flex=160, el_flex=20),
    "arms sideward": both(sh_abd=90),
    "turned": {**both(el_flex=90, pro_sup=70), "trunk_rot": 29.0, "neck_rot": 50.0},
    "lifting": {**both(hip_flex=60, knee_flex=40, sh_flex=60, el_flex=30), "trunk_flex": 60.0},
    "sitting": both(hip_flex=90, knee_flex=90, sh_flex=45, el_flex=45),
    "bent sideward": {**both(sh_abd=40, sh_rot=-40, el_flex=90), "trunk_bend": 25.0},
}
"""Joint angles that are not zero [deg], by name of the posture."""


def person(sex: str, mass: float, height: float, parts: str = "whole_body") -> Body:
    subject = {"code": "S1", "sex": sex, "mass": mass, "height": height, "parts": parts}
    return describe(Subject.of(subject, "subject:"))


def transforms(body: Body, angles: dict[str, float]) -> dict[str, FloatArray]:
    """Poses of all links in axes of the root link; angles [deg]."""
    T = {ROOT: np.eye(4)}
    for segment in body.segments.values():
        at = T[segment.parent] @ homogeneous(np.eye(3), segment.p_parent_link)
        for joint in (joint for joint in body.joints.values() if joint.link == segment.link):
            at = at @ rotation_matrix(np.radians(angles.get(joint.name, 0.0)), joint.axis)
            T[joint.child] = at
        T[segment.link] = at
    return T
