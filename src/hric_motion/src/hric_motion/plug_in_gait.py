"""Joint angles of a fitted body by the definitions of Vicon's Plug-in Gait.

Plug-in Gait builds axes and joint centres from single markers and measured widths. The same construction from the
points of a fitted body gives the angles that Plug-in Gait would write for this body, so that a difference from those
in a file is one of the fit, not of definitions. The hip and shoulder centres are those of the body. Elbow: its centre
follows from the wrist, so that the angle of a nearly straight arm is far from that of the joint's axis.

Sources: Vicon's documentation of Nexus 2.12 and 2.15 (chord function, Lower and Upper body kinematics, Angle outputs:
Cardan angles in the order y, x, z), and for the side of each point pyCGM. From the markers of three files of Plug-in
Gait and the hip and shoulder centres there, the knee, ankle, elbow and wrist centres in these files follow with less
than 0.01 mm of error.

    angles = defined_angles(result.motion, result.trial.subject)
    angles["right_knee_flex"]                     # shape (n,) [rad], positive as the joint; NaN: not known
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from hric_core.geometry import FloatArray
from hric_human.body.markers import AttachedMarker
from hric_human.body.segments import SIDES
from hric_motion.measured import MeasuredMotion
from hric_motion.pelvis import MARKER_RADIUS, PELVIS
from hric_motion.postures import BodyPostures, MarkerPostures

Points = Mapping[str, FloatArray]
"""Points by name, shape (n, 3) each [m]: markers, and the origins of links (joint centres)."""
THORAX = ("C7", "T10", "CLAV", "STRN")


def defined_angles(motion: MeasuredMotion, subject: Mapping[str, float]) -> dict[str, FloatArray]:
    """Return the angles by joint, shape (n,) each [rad], positive as the joint's; NaN: not known.

    Args:
        motion: motion of the fitted body.
        subject: measured widths, such as `right_knee_width` [m]; angles that need a missing one are left out.
    """
    points, angles = _points(motion), dict[str, FloatArray]()
    if not points.keys() >= set(PELVIS):
        return _arms(points, subject)
    pelvis = _pelvis(points)
    if points.keys() >= set(THORAX):
        angles["trunk_flex"], _ = _tilt(pelvis, _middle(points, "CLAV", "C7") - _middle(points, "STRN", "T10"))
    return angles | _legs(points, pelvis, subject) | _arms(points, subject)


def joint_centre(proximal: FloatArray, marker: FloatArray, wand: FloatArray, distance: float) -> FloatArray:
    """Return the joint centre by the chord function, shape (n, 3) [m]; NaN: there is none.

    It is in the plane of the three points, on the side of the line from `proximal` to `marker` that is opposite to
    `wand`, and sees these two at a right angle.

    Args:
        proximal: centre of the joint before, shape (n, 3) [m].
        marker: marker at the joint.
        wand: further marker of the segment.
        distance: distance of the joint centre from `marker` [m].
    """
    line = proximal - marker
    length = np.linalg.norm(line, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        along = distance**2 / length
        aside = np.sqrt(distance**2 - along**2) * _across(wand - marker, line)
    return np.asarray(marker + along * line / length - aside)


def _points(motion: MeasuredMotion) -> dict[str, FloatArray]:
    """Return markers and joint centres of the fitted body; NaN: not known."""
    segments = motion.body.segments.values()
    links = {segment.link: AttachedMarker(segment.link, segment.link, np.zeros(3)) for segment in segments}
    known = np.asarray(np.isfinite(motion.root).all(axis=1))
    root, names = motion.root[known], (*motion.names, *links)
    body = replace(motion.body, markers={**motion.body.markers, **links})
    postures = BodyPostures(Rotation.from_quat(root[:, 3:]).as_matrix(), root[:, :3], motion.q[known])
    p = np.full((len(known), len(names), 3), np.nan)
    p[known] = MarkerPostures(body, names).positions(postures)
    return dict(zip(names, p.swapaxes(0, 1), strict=True))


def _legs(points: Points, pelvis: FloatArray, subject: Mapping[str, float]) -> dict[str, FloatArray]:
    """Return the angles of hips and knees; pelvis: its axes, shape (n, 3, 3)."""
    angles = dict[str, FloatArray]()
    for side, sign in SIDES.items():
        knee, thigh, ankle, shank = (f"{side[0].upper()}{name}" for name in ("KNE", "THI", "ANK", "TIB"))
        widths = [subject[key] for joint in ("knee", "ankle") if (key := f"{side}_{joint}_width") in subject]
        if not points.keys() >= {f"{side[0]}_hip", knee, thigh, ankle, shank} or len(widths) < 2:
            continue
        hip, (of_knee, of_ankle) = points[f"{side[0]}_hip"], map(_distance, widths)
        p_knee = joint_centre(hip, points[knee], points[thigh], of_knee)
        p_ankle = joint_centre(p_knee, points[ankle], points[shank], of_ankle)
        about_y, about_x = _tilt(pelvis, hip - p_knee)
        angles[f"{side}_hip_flex"], angles[f"{side}_hip_abd"] = -about_y, sign * about_x
        z = _unit(hip - p_knee)
        y = _across(sign * (points[knee] - p_knee), z)
        angles[f"{side}_knee_flex"], _ = _tilt(np.stack([np.cross(y, z), y, z], axis=2), p_knee - p_ankle)
    return angles


def _arms(points: Points, subject: Mapping[str, float]) -> dict[str, FloatArray]:
    """Return the angles of the elbows."""
    angles = dict[str, FloatArray]()
    for side, sign in SIDES.items():
        elbow, thumb, other = (f"{side[0].upper()}{name}" for name in ("ELB", "WRA", "WRB"))
        widths = [subject[key] for joint in ("elbow", "wrist") if (key := f"{side}_{joint}_width") in subject]
        if not points.keys() >= {f"{side[0]}_shoulder", elbow, thumb, other} or len(widths) < 2:
            continue
        shoulder, (of_elbow, of_wrist) = points[f"{side[0]}_shoulder"], map(_distance, widths)
        marker, bar = points[elbow], points[other] - points[thumb]
        middle = _middle(points, thumb, other)
        normal = _unit(np.cross(shoulder - marker, middle - marker))
        p_elbow = joint_centre(shoulder, marker, marker + sign * normal, of_elbow)
        p_wrist = middle - sign * of_wrist * _unit(np.cross(bar, p_elbow - middle))
        upper, lower = _unit(p_elbow - shoulder), _unit(p_wrist - p_elbow)
        angles[f"{side}_el_flex"] = np.arccos(np.clip((upper * lower).sum(axis=1), -1.0, 1.0))
    return angles


def _distance(width: float) -> float:
    """Return the distance of a joint centre from its marker [m]; width: of the joint [m]."""
    return 0.5 * width + MARKER_RADIUS


def _middle(points: Points, first: str, second: str) -> FloatArray:
    return np.asarray(0.5 * (points[first] + points[second]))


def _pelvis(points: Points) -> FloatArray:
    """Return the axes of the pelvis, shape (n, 3, 3): y from RASI to LASI, x in the plane of ASI and PSI markers."""
    y = _unit(points["LASI"] - points["RASI"])
    x = _across(_middle(points, "LASI", "RASI") - _middle(points, "LPSI", "RPSI"), y)
    return np.stack([x, y, np.cross(x, y)], axis=2)


def _tilt(proximal: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rotations about y and then x that bring the z axis of a segment along a direction, shape (n,) [rad].

    Args:
        proximal: axes of the segment before, shape (n, 3, 3).
        z: long axis of the segment, upwards, shape (n, 3).
    """
    v = np.einsum("nji,nj->ni", proximal, _unit(z))
    return np.arctan2(v[:, 0], v[:, 2]), -np.arcsin(np.clip(v[:, 1], -1.0, 1.0))


def _across(v: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the unit vectors of the parts of vectors that are perpendicular to axes, shape (n, 3)."""
    axis = _unit(axis)
    return _unit(v - (v * axis).sum(axis=1, keepdims=True) * axis)


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))
