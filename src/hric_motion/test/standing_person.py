"""A person who stands on the left foot on a force plate and moves, with what the plate measures without any error."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from hric_core.geometry import FloatArray
from hric_core.trial.plates import TrialPlate
from hric_human.body import Body, Subject, describe
from hric_motion.measured import MeasuredMotion
from hric_motion.moments import NO_PLATES, joint_moments

RATE, FRAMES = 100.0, 300
PERSON = Subject(code="S07", mass=78.2, height=1.759, sex="male", parts="whole_body")
BODY = describe(PERSON)
JOINTS = list(BODY.joints)
LEAN = 0.115
"""Adduction of the standing leg, which brings its foot below the centre of mass [rad]."""


def standing(body: Body = BODY) -> MeasuredMotion:
    """Return a motion with moving arms, trunk and free leg, whose pose and angles are all known."""
    t, q = np.arange(FRAMES) / RATE, np.zeros((FRAMES, len(JOINTS)))
    for column, name in enumerate(JOINTS):
        if not name.startswith("left_") or "sh" in name or "el" in name:
            q[:, column] = 0.08 * np.sin(2.0 * np.pi * (0.3 + 0.04 * (column % 5)) * t + column)
    q[:, JOINTS.index("left_hip_abd")] -= LEAN
    q[:, JOINTS.index("right_knee_flex")] += 0.5
    q[:, JOINTS.index("right_el_flex")] += 0.8
    R = Rotation.from_rotvec(np.column_stack([0.0 * t, 0.02 * np.sin(2.0 * t), 0.3 + 0.05 * np.sin(t)]))
    p = np.column_stack([0.5 + 0.005 * np.sin(2.0 * t), -0.2 + 0.0 * t, body.base_height + 0.01 * np.cos(2.0 * t)])
    none = np.zeros((FRAMES, 1))
    return MeasuredMotion(body, (), q, 0.0 * q, np.hstack([p, R.as_quat()]), none, none[0], 0.001)


def plate(wrench: FloatArray, rate: float, T_lab_plate: FloatArray) -> TrialPlate:
    """Return a plate that measures a wrench on the person about the laboratory's origin, shape (n, 6) [N], [N m]."""
    R, middle = T_lab_plate[:3, :3], T_lab_plate[:3, 3]
    moment = wrench[:, 3:] - np.cross(middle, wrench[:, :3])
    return TrialPlate(2, rate, T_lab_plate, (0.4, 0.6), -np.hstack([wrench[:, :3] @ R, moment @ R]))


def supporting(motion: MeasuredMotion, cutoff: float = 45.0) -> TrialPlate:
    """Return the plate under the left foot whose load is all that the motion needs."""
    alone = joint_moments(motion, RATE, NO_PLATES, cutoff=cutoff)
    moment = alone.residual[:, 3:] + np.cross(alone.root.position, alone.residual[:, :3])
    T_lab_plate = np.eye(4)
    T_lab_plate[:3, :3] = Rotation.from_rotvec([0.0, 0.0, 0.4]).as_matrix()
    T_lab_plate[:3, 3] = 0.55, -0.25, 0.0
    return plate(np.hstack([alone.residual[:, :3], moment]), RATE, T_lab_plate)


def without(motion: MeasuredMotion, *joints: str) -> MeasuredMotion:
    """Return the motion with joints that are not known."""
    q = motion.q.copy()
    q[:, [JOINTS.index(name) for name in joints]] = np.nan
    return replace(motion, q=q)
