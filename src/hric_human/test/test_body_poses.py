"""Signs of the joints by poses that one can take, mirror images, and ISB's angles."""

import numpy as np
import pytest
from bodies import PARTS, Posed, body
from numpy.testing import assert_allclose

from hric_human.body import from_isb, to_isb
from hric_human.body.isb import isb_shoulder
from hric_human.body.joints import ROWS

FORWARD, LEFT, UP = np.eye(3)
BODY = body()
MIRROR = np.diag([1.0, -1.0, 1.0])


def direction(posed: Posed, kind: str) -> np.ndarray:
    """Return the unit vector of a segment from its joint to its far end."""
    segment = BODY.segments[kind]
    along = posed.point(segment.link, segment.end) - posed.point(segment.link)
    return np.asarray(along / np.linalg.norm(along))


def palm(posed: Posed, side: str) -> np.ndarray:
    """Return the direction that the palm faces; inward at the zero pose."""
    return posed.rotation(f"{side[0]}_wrist") @ (LEFT if side == "right" else -LEFT)


@pytest.mark.parametrize(("parts", "count"), PARTS.items())
def test_parts_have_their_joints_in_order(parts: str, count: int) -> None:
    made = body(parts=parts)
    assert len(made.joints) == count == Posed(made).model.nv - 6
    arm = ["sh_flex", "sh_abd", "sh_rot", "el_flex", "pro_sup", "wr_flex", "wr_dev"]
    if parts == "upper_body":
        trunk = [f"{part}_{way}" for part in ("trunk", "neck") for way in ("flex", "bend", "rot")]
        assert list(made.joints) == trunk + [f"{side}_{joint}" for side in ("right", "left") for joint in arm]


@pytest.mark.parametrize(
    ("angles", "segment", "towards"),
    [
        ({}, "right_hand", -UP),
        ({"right_sh_flex": 90}, "right_hand", FORWARD),
        ({"right_sh_flex": 180}, "right_hand", UP),
        ({"right_sh_abd": 90}, "right_hand", -LEFT),
        ({"left_sh_abd": 90}, "left_hand", LEFT),
        ({"right_el_flex": 90}, "right_forearm", FORWARD),
        ({"right_el_flex": 90, "right_sh_rot": 70}, "right_forearm", np.array([np.cos(1.2217), np.sin(1.2217), 0])),
        ({"left_el_flex": 90, "left_sh_rot": 70}, "left_forearm", np.array([np.cos(1.2217), -np.sin(1.2217), 0])),
        ({"right_wr_flex": 90}, "right_hand", LEFT),
        ({"left_wr_flex": 90}, "left_hand", -LEFT),
        ({"right_wr_dev": 90}, "right_hand", -FORWARD),
        ({"left_wr_dev": 90}, "left_hand", -FORWARD),
        ({"trunk_flex": 90}, "head", FORWARD),
        ({"trunk_bend": 90}, "head", -LEFT),
        ({"neck_flex": 90}, "head", FORWARD),
        ({"neck_bend": 90}, "head", -LEFT),
        ({"right_hip_flex": 90}, "right_thigh", FORWARD),
        ({"right_hip_abd": 90}, "right_thigh", -LEFT),
        ({"left_hip_abd": 90}, "left_thigh", LEFT),
        ({"right_knee_flex": 90}, "right_shank", -FORWARD),
    ],
)
def test_a_named_pose_is_where_its_name_says(angles: dict[str, float], segment: str, towards: np.ndarray) -> None:
    assert_allclose(direction(Posed(BODY, **angles), segment), towards, atol=1e-4)


@pytest.mark.parametrize(
    ("joint", "link", "axis", "towards"),
    [
        ("trunk_rot", "torso", FORWARD, LEFT),
        ("neck_rot", "head", FORWARD, LEFT),
        ("right_hip_rot", "r_hip", FORWARD, LEFT),
        ("left_hip_rot", "l_hip", FORWARD, -LEFT),
        ("right_ankle_flex", "r_ankle", FORWARD, UP),
        ("left_ankle_flex", "l_ankle", FORWARD, UP),
        ("right_ankle_inv", "r_ankle", -UP, LEFT),
        ("left_ankle_inv", "l_ankle", -UP, -LEFT),
    ],
)
def test_a_quarter_turn_brings_an_axis_where_the_table_says(
    joint: str, link: str, axis: np.ndarray, towards: np.ndarray
) -> None:
    assert_allclose(Posed(BODY, **{joint: 90.0}).rotation(link) @ axis, towards, atol=1e-15)


@pytest.mark.parametrize("side", ["right", "left"])
def test_palms_look_inward_at_zero_and_down_and_up_in_pronation_and_supination(side: str) -> None:
    assert_allclose(palm(Posed(BODY), side), LEFT if side == "right" else -LEFT, atol=1e-15)
    elbow = {f"{side}_el_flex": 90.0}
    assert_allclose(palm(Posed(BODY, **elbow, **{f"{side}_pro_sup": 90.0}), side), -UP, atol=1e-15)
    assert_allclose(palm(Posed(BODY, **elbow, **{f"{side}_pro_sup": -90.0}), side), UP, atol=1e-15)
    assert_allclose(palm(Posed(BODY, **{f"{side}_sh_abd": 90.0}), side), -UP, atol=1e-15), "T-pose: palms down"


def test_a_t_pose_is_as_wide_as_shoulders_and_arms() -> None:
    posed = Posed(BODY, right_sh_abd=90, left_sh_abd=90)
    hands = [
        posed.point(BODY.segments[f"{side}_hand"].link, BODY.segments[f"{side}_hand"].end) for side in ("right", "left")
    ]
    arm = sum(BODY.segments[f"right_{kind}"].length for kind in ("upper_arm", "forearm", "hand"))
    assert_allclose(hands[1] - hands[0], [0.0, 2 * arm + 0.2 * BODY.subject.height, 0.0], atol=1e-12)


def test_equal_angles_on_both_sides_are_mirrored_poses() -> None:
    random = np.random.default_rng(2)
    for _ in range(10):
        angles = {name: np.degrees(random.uniform(*ROWS_RANGE[name])) for name in ROWS_RANGE}
        posed = Posed(BODY, **{f"{side}_{name}": angle for name, angle in angles.items() for side in ("right", "left")})
        for kind in ("upper_arm", "forearm", "hand", "thigh", "shank", "foot"):
            right, left = BODY.segments[f"right_{kind}"], BODY.segments[f"left_{kind}"]
            assert_allclose(
                MIRROR @ posed.point(right.link, right.mass.com), posed.point(left.link, left.mass.com), atol=1e-14
            )
            assert_allclose(MIRROR @ posed.rotation(right.link) @ MIRROR, posed.rotation(left.link), atol=1e-14)
            assert_allclose(MIRROR @ right.mass.inertia @ MIRROR, left.mass.inertia, atol=1e-18)


ROWS_RANGE = {
    name.removeprefix("right_"): joint.range for name, joint in BODY.joints.items() if name.startswith("right_")
}


def test_a_shoulder_is_singular_where_its_abduction_is_a_right_angle() -> None:
    def rank(abd: float) -> int:
        posed = Posed(BODY, right_sh_flex=40, right_sh_abd=abd)
        axes = [
            posed.rotation(BODY.joints[f"right_{name}"].child) @ BODY.joints[f"right_{name}"].axis
            for name in ("sh_flex", "sh_abd", "sh_rot")
        ]
        return int(np.linalg.matrix_rank(np.array(axes), tol=1e-9))

    assert [rank(abd) for abd in (0.0, 45.0, 89.0, 90.0)] == [3, 3, 3, 2]


def test_a_seated_body_rests_with_hips_and_knees_bent_and_its_soles_on_the_floor() -> None:
    seated = body(posture="seated")
    assert sorted(seated.rest) == ["left_hip_flex", "left_knee_flex", "right_hip_flex", "right_knee_flex"]
    posed = Posed(seated, **{name: np.degrees(angle) for name, angle in seated.rest.items()})
    foot = seated.segments["right_foot"]
    assert posed.point(foot.link, foot.end)[2] - foot.radius == pytest.approx(-seated.base_height, abs=1e-12)
    assert body().rest == {}
    assert body(parts="upper_body", posture="seated").base_height == seated.base_height


@pytest.mark.parametrize(
    ("angles", "expected"),
    [((90, 0, 0), (90, -90, -90)), ((0, 90, 0), (0, -90, 0)), ((0, 0, 40), (0, 0, 40)), ((0, 30, 0), (0, -30, 0))],
)
def test_isb_angles_of_a_shoulder_at_named_poses(angles: tuple[float, ...], expected: tuple[float, ...]) -> None:
    assert_allclose(np.degrees(isb_shoulder(*np.radians(angles))), expected, atol=1e-12)


def test_isb_angles_describe_the_rotation_that_the_description_has() -> None:
    R_isb_ros = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    random = np.random.default_rng(3)
    for _ in range(20):
        flex, abd, rot = random.uniform([-60, -45, -90], [180, 85, 70])
        posed = Posed(BODY, right_sh_flex=flex, right_sh_abd=abd, right_sh_rot=rot)
        plane, elevation, axial = isb_shoulder(*np.radians([flex, abd, rot]))
        made = about(1, plane) @ about(0, elevation) @ about(1, axial)
        assert_allclose(made, R_isb_ros @ posed.rotation("r_shoulder") @ R_isb_ros.T, atol=1e-14)


def about(axis: int, angle: float) -> np.ndarray:
    R, (i, j) = np.eye(3), ((1, 2), (2, 0), (0, 1))[axis]
    R[i, i] = R[j, j] = np.cos(angle)
    R[j, i], R[i, j] = np.sin(angle), -np.sin(angle)
    return R


def test_angles_come_back_from_isb() -> None:
    random = np.random.default_rng(4)
    for _ in range(50):
        angles = {name: float(random.uniform(*joint.range)) for name, joint in BODY.joints.items()}
        for side in ("right", "left"):
            angles[f"{side}_sh_abd"] = float(np.radians(random.uniform(-45, 89)))
        there = to_isb(angles)
        assert set(there) ^ set(angles) == {
            f"{side}_sh_{name}"
            for side in ("right", "left")
            for name in ("flex", "abd", "rot", "plane_of_elevation", "elevation", "axial_rotation")
        }
        back = from_isb(there)
        assert {name: back[name] for name in angles} == pytest.approx(angles, abs=1e-9)
    hanging = {"right_sh_flex": 0.0, "right_sh_abd": 0.0, "right_sh_rot": 0.5}
    assert from_isb(to_isb(hanging)) == pytest.approx(hanging)


@pytest.mark.parametrize(
    ("joint", "degrees", "isb"),
    [("right_pro_sup", 10, 100), ("trunk_flex", 20, -20), ("left_hip_abd", 15, -15), ("left_wr_dev", 5, 5)],
)
def test_isb_differs_by_a_sign_or_an_offset_where_the_table_says(joint: str, degrees: float, isb: float) -> None:
    assert to_isb({joint: np.radians(degrees)})[joint] == pytest.approx(np.radians(isb))


def test_ranges_contain_zero_and_each_row_has_its_source() -> None:
    assert all(row.lower <= 0 < row.upper and row.source and row.positive and row.zero for row in ROWS.values())
