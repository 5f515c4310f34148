"""Angles by the definitions of Plug-in Gait: those of the joints where definitions agree, else by other formulas."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from standing_person import BODY, JOINTS, standing

from hric_core.geometry import FloatArray
from hric_human.body.markers import AttachedMarker
from hric_human.body.segments import SIDES
from hric_motion.measured import MeasuredMotion
from hric_motion.plug_in_gait import MARKER_RADIUS, defined_angles, joint_centre

WIDTHS = {"knee": 0.11, "ankle": 0.07, "elbow": 0.08, "wrist": 0.05}
SUBJECT = {f"{side}_{joint}_width": width for side in SIDES for joint, width in WIDTHS.items()}
LENGTHS = {kind: BODY.segments[f"right_{kind}"].length for kind in ("upper_arm", "forearm", "thigh", "shank")}


def person(wand: float = 0.0, elbow: float = 0.8) -> MeasuredMotion:
    """Return a motion with markers as Plug-in Gait assumes them; wand: turn of the thigh's marker inward [rad]."""
    places = {"LASI": (0.06, 0.12, 0.08), "RASI": (0.06, -0.12, 0.08), "LPSI": (-0.1, 0.05, 0.08)}
    placed = {name: AttachedMarker(name, "waist", np.array(p)) for name, p in places.items()}
    placed["RPSI"] = AttachedMarker("RPSI", "waist", np.array([-0.1, -0.05, 0.08]))
    for name, p in {"C7": (-0.06, 0.0, 0.4), "CLAV": (0.06, 0.0, 0.4), "T10": (-0.1, 0.0, 0.2)}.items():
        placed[name] = AttachedMarker(name, "torso", np.array(p))
    placed["STRN"] = AttachedMarker("STRN", "torso", np.array([0.1, 0.0, 0.2]))
    for side, sign in SIDES.items():
        letter, aside = side[0], {joint: sign * (0.5 * width + MARKER_RADIUS) for joint, width in WIDTHS.items()}
        turned = 0.12 * sign * np.array([np.sin(wand), np.cos(wand), 0.0])
        for name, link, p in (
            ("KNE", "hip", (0.0, aside["knee"], -LENGTHS["thigh"])),
            ("THI", "hip", (turned[0], turned[1], -0.6 * LENGTHS["thigh"])),
            ("ANK", "knee", (0.0, aside["ankle"], -LENGTHS["shank"])),
            ("TIB", "knee", (0.0, 1.5 * aside["ankle"], -0.5 * LENGTHS["shank"])),
            ("ELB", "shoulder", (0.0, aside["elbow"], -LENGTHS["upper_arm"])),
            ("WRA", "elbow", (0.03, aside["wrist"], -LENGTHS["forearm"])),
            ("WRB", "elbow", (-0.03, aside["wrist"], -LENGTHS["forearm"])),
        ):
            label = letter.upper() + name
            placed[label] = AttachedMarker(label, f"{letter}_{link}", np.array(p))
    motion = standing(replace(BODY, markers={**BODY.markers, **placed}))
    q = motion.q.copy()
    for joint in ("hip_flex", "hip_abd", "hip_rot", "knee_flex"):
        q[:, JOINTS.index(f"left_{joint}")] += 0.5 * q[:, JOINTS.index(f"right_{joint}")]
    q[:, JOINTS.index("right_el_flex")], q[:, JOINTS.index("right_pro_sup")] = elbow, 0.0
    q[:10, JOINTS.index("right_hip_flex")] = np.nan
    return replace(motion, names=tuple(placed), q=q)


def test_angles_are_those_of_the_joints_where_definitions_agree() -> None:
    motion = person()
    angles = defined_angles(motion, SUBJECT)
    for name in ("trunk_flex", *(f"{side}_{joint}" for side in SIDES for joint in ("hip_flex", "hip_abd"))):
        expected = motion.q[:, JOINTS.index(name)].copy()
        expected[:10] = np.nan if "right" in name else expected[:10]
        assert_allclose(angles[name], expected, atol=1e-9)
        assert np.ptp(expected[10:]) > 0.05


@pytest.mark.parametrize("side", SIDES)
def test_a_thigh_marker_that_is_turned_forward_straightens_the_knee(side: str) -> None:
    """Its centre moves backward by 0.022 m: both segments of about 0.45 m tilt, together by 0.1 rad at most."""
    wand = -0.25 if side == "right" else 0.25
    straight, turned = (defined_angles(person(turn), SUBJECT)[f"{side}_knee_flex"][20:] for turn in (0.0, wand))
    assert_allclose(straight, person().q[20:, JOINTS.index(f"{side}_knee_flex")], atol=1e-9)
    assert -0.12 < (turned - straight).mean() < -0.06


def test_a_joint_centre_fulfils_the_conditions_of_the_chord_function() -> None:
    proximal, marker, wand = np.random.default_rng(1).normal(size=(3, 50, 3))
    p = joint_centre(proximal, marker, wand, 0.06)
    normal = np.cross(proximal - marker, wand - marker)
    known = np.linalg.norm(proximal - marker, axis=1) > 0.06
    assert_allclose(np.linalg.norm(p - marker, axis=1)[known], 0.06)
    assert_allclose(((p - marker) * (p - proximal)).sum(axis=1)[known], 0.0, atol=1e-12)
    assert_allclose(((p - marker) * normal).sum(axis=1)[known], 0.0, atol=1e-12)
    assert ((np.cross(proximal - marker, p - marker) * normal).sum(axis=1)[known] < 0.0).all()
    assert np.isnan(joint_centre(marker + np.array([0.05, 0.0, 0.0]), marker, wand, 0.06)).all()


def elbow_by_conditions(flexion: float) -> float:
    """Return the angle of Plug-in Gait for a hinge in the x-z plane whose axis is y: its elbow centre fulfils three
    equations, right angle, distance and plane, and the wrist centre is palmar of the bar."""
    distance, palmar = (0.5 * WIDTHS[joint] + MARKER_RADIUS for joint in ("elbow", "wrist"))
    shoulder, marker = np.array([0.0, 0.0, LENGTHS["upper_arm"]]), np.array([0.0, -distance, 0.0])
    forearm = np.array([np.sin(flexion), 0.0, -np.cos(flexion)])
    across = np.array([np.cos(flexion), 0.0, np.sin(flexion)])
    middle = LENGTHS["forearm"] * forearm + np.array([0.0, -palmar, 0.0])
    normal = np.cross(shoulder - marker, middle - marker)

    def off(p: FloatArray) -> list[float]:
        plane = np.cross(shoulder - marker, normal / np.linalg.norm(normal))
        return [
            np.linalg.norm(p - marker) - distance,
            10.0 * (p - shoulder) @ (p - marker),
            10.0 * (p - marker) @ plane,
        ]

    p_elbow = least_squares(off, marker + distance * normal / np.linalg.norm(normal), xtol=1e-14, ftol=1e-14).x
    towards = np.cross(across, p_elbow - middle)
    towards *= np.sign(towards[1]) * palmar / np.linalg.norm(towards)
    upper, lower = p_elbow - shoulder, middle + towards - p_elbow
    return float(np.arccos(upper @ lower / np.linalg.norm(upper) / np.linalg.norm(lower)))


@pytest.mark.parametrize("flexion", [0.2, 0.5, 1.0, 1.6])
def test_an_elbow_is_constructed_from_the_wrist(flexion: float) -> None:
    angle = defined_angles(person(elbow=flexion), SUBJECT)["right_el_flex"]
    assert_allclose(angle[10:].mean(), elbow_by_conditions(flexion), atol=1e-6)
    assert (abs(angle[50] - flexion) > 0.1) == (flexion < 0.8)  # far from the hinge's angle if nearly straight


def test_angles_without_their_widths_or_markers_are_left_out() -> None:
    motion = person()
    assert set(defined_angles(motion, {})) == {"trunk_flex"}
    without = replace(motion, names=tuple(name for name in motion.names if name not in ("LPSI", "RELB")))
    assert set(defined_angles(without, SUBJECT)) == {"left_el_flex"}
