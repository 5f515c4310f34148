"""Rotations, poses and inertias against an independent library and textbook figures."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hric_core.errors import CommandError
from hric_core.geometry import (
    MassProperties,
    Pose,
    homogeneous,
    judge,
    messages,
    poses,
    quaternions,
    steiner_term,
    tensor,
    transforms,
)
from hric_core.geometry.transforms import rotation_from_rpy, rpy_from_rotation

HALF_TURNS = [
    Rotation.from_rotvec(math.pi * np.array(axis)) for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.0, -0.8])
]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture
def rotations(rng: np.random.Generator) -> list[Rotation]:
    return [*Rotation.random(50, rng=rng), Rotation.identity(), *HALF_TURNS]


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(tuple(rng.normal(size=3).tolist()), tuple(Rotation.random(rng=rng).as_quat().tolist()))


def matrix(pose: Pose) -> np.ndarray:
    return homogeneous(Rotation.from_quat(pose.orientation).as_matrix(), pose.position)


def test_roll_pitch_yaw_are_those_of_the_urdf_also_where_they_are_singular(rng) -> None:
    singular = [[0.3, np.pi / 2, 0.2], [0.1, -np.pi / 2, -0.4], [np.pi, 0, 0], [0, 0, np.pi]]
    for rpy in [*rng.uniform(-3.1, 3.1, (100, 3)).tolist(), *singular]:
        R = rotation_from_rpy(rpy)
        assert np.abs(R - Rotation.from_euler("xyz", rpy).as_matrix()).max() < 1e-15
        assert np.abs(rotation_from_rpy(rpy_from_rotation(R)) - R).max() < 1e-9


def test_a_matrix_becomes_the_quaternion_with_w_not_negative_and_back(rotations) -> None:
    for rotation in rotations:
        R = rotation.as_matrix()
        q = transforms.quaternion_from_rotation(R)
        assert q[3] >= 0.0
        assert math.hypot(*q) == pytest.approx(1.0, abs=1e-15)
        assert np.abs(transforms.rotation_from_quaternion(q) - R).max() < 1e-12
        by_largest = quaternions.from_elements(*R.ravel().tolist())
        assert max(by_largest, key=abs) > 0.0
        assert quaternions.canonical(by_largest) == q
        assert transforms.rotation_from_quaternion(rotation.as_quat()) == pytest.approx(R, abs=1e-15)


def test_quaternions_turn_vectors_as_an_independent_library_does(rng, rotations) -> None:
    for a, b in zip(rotations, reversed(rotations), strict=True):
        qa, qb, v = tuple(a.as_quat().tolist()), tuple(b.as_quat().tolist()), tuple(rng.normal(size=3).tolist())
        assert Rotation.from_quat(quaternions.product(qa, qb)).as_matrix() == pytest.approx(
            (a * b).as_matrix(), abs=1e-12
        )
        assert quaternions.rotated(qa, v) == pytest.approx(a.apply(v), abs=1e-12)
        assert quaternions.rotated(quaternions.inverse(qa), quaternions.rotated(qa, v)) == pytest.approx(v, abs=1e-12)
        assert quaternions.from_rotation_vector(v) == pytest.approx(Rotation.from_rotvec(v).as_quat(), abs=1e-12)
        assert quaternions.cross(v, qa[:3]) == pytest.approx(np.cross(v, qa[:3]))
        assert math.hypot(*quaternions.difference(qa, qb)) == pytest.approx((a * b.inv()).magnitude(), abs=1e-9)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-7, 0.5, 3.0])
def test_a_rotation_vector_survives_the_quaternion_and_the_matrix(size: float) -> None:
    v = (0.6 * size, 0.0, -0.8 * size)
    assert quaternions.rotation_vector(quaternions.from_rotation_vector(v)) == pytest.approx(v, abs=1e-12)
    about = transforms.rotation_about(np.array([0.6, 0.0, -0.8]), size)
    assert about == pytest.approx(Rotation.from_rotvec(v).as_matrix(), abs=1e-15)


def test_half_of_the_way_between_orientations_is_half_of_the_angle_the_shorter_way() -> None:
    start, goal = quaternions.from_rotation_vector((0.0, 0.0, 0.2)), quaternions.from_rotation_vector((0.0, 0.0, 1.0))
    for other in (goal, tuple(-part for part in goal)):
        assert quaternions.rotation_vector(quaternions.interpolated(start, other, 0.5)) == pytest.approx(
            (0.0, 0.0, 0.6)
        )


def test_the_angular_velocity_is_that_of_the_rotation_itself(rng) -> None:
    for size in (0.0, 1e-5, 1e-3, 0.5, 2.5):
        v, rate, dt = size * rng.normal(size=3), rng.normal(size=3), 1e-5
        before, after = Rotation.from_rotvec(v - 0.5 * dt * rate), Rotation.from_rotvec(v + 0.5 * dt * rate)
        numeric = (after * before.inv()).as_rotvec() / dt
        assert quaternions.angular_velocity(tuple(v), tuple(rate)) == pytest.approx(numeric, abs=1e-7)


def test_what_is_not_orthonormal_and_right_handed_is_no_rotation(rotations) -> None:
    for rotation in rotations:
        x, y, z = rotation.as_matrix().T.tolist()
        assert quaternions.is_rotation(x, y, z, 1e-12)
        assert not quaternions.is_rotation(x, y, [-part for part in z], 1e-6)
        assert not quaternions.is_rotation([1.001 * part for part in x], y, z, 1e-6)
        assert not quaternions.is_rotation(x, [*y[:2], y[2] + 1e-3], z, 1e-6)
        assert not quaternions.is_rotation(x, y, [z[0], z[1], math.nan], 1e-6)


def test_cross_products_by_numbers_and_by_matrix_are_numpys(rng) -> None:
    for _ in range(10):
        a, b = rng.normal(size=(2, 3))
        assert transforms.cross(a, b) == pytest.approx(np.cross(a, b))
        assert transforms.skew(a) @ b == pytest.approx(np.cross(a, b))
        assert b @ transforms.skew(a) == pytest.approx(np.cross(b, a))


def test_poses_and_transforms_are_composed_and_inverted_alike(rng) -> None:
    for _ in range(20):
        T_a_b, T_b_c, p_b = random_pose(rng), random_pose(rng), tuple(rng.normal(size=3).tolist())
        assert matrix(poses.compose(T_a_b, T_b_c)) == pytest.approx(matrix(T_a_b) @ matrix(T_b_c), abs=1e-12)
        assert matrix(poses.inverse(T_a_b)) == pytest.approx(transforms.inverse(matrix(T_a_b)), abs=1e-12)
        assert transforms.inverse(matrix(T_a_b)) @ matrix(T_a_b) == pytest.approx(np.eye(4), abs=1e-12)
        assert poses.transformed(T_a_b, p_b) == pytest.approx((matrix(T_a_b) @ [*p_b, 1.0])[:3])
        goal = poses.interpolated(T_a_b, T_b_c, 1.0)
        assert poses.difference(goal, T_b_c) == pytest.approx([0.0] * 6, abs=1e-9)


def test_y_up_is_turned_about_x_as_in_the_thesis(rng) -> None:
    R, pose = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), random_pose(rng)
    turned = poses.pose_z_up("y", pose)
    assert turned.position == pytest.approx(R @ pose.position)
    expected = R @ Rotation.from_quat(pose.orientation).as_matrix() @ R.T
    assert Rotation.from_quat(turned.orientation).as_matrix() == pytest.approx(expected, abs=1e-12)
    assert poses.pose_from_z_up("y", turned) == pose
    assert poses.from_z_up("y", poses.z_up("y", pose.position)) == pose.position
    assert poses.pose_z_up("z", pose) == poses.pose_from_z_up("z", pose) == pose


def message(position=(0.1, -0.2, 0.3), orientation=(0.0, 0.0, 0.6, 0.8)) -> SimpleNamespace:
    p, q = (SimpleNamespace(**dict(zip("xyzw", values, strict=False))) for values in (position, orientation))
    return SimpleNamespace(position=p, orientation=q)


def test_a_message_survives_the_matrix_and_an_unset_orientation_is_none() -> None:
    assert np.array_equal(messages.matrix(message((0, 0, 0), (0, 0, 0, 0))), np.eye(4))
    pose = poses.pose_of_transform(messages.matrix(message()))
    assert pose.position == (0.1, -0.2, 0.3)
    assert pose.orientation == pytest.approx([0.0, 0.0, 0.6, 0.8])


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (message(orientation=(0.0, 0.0, 0.6, 0.9)), "not a unit quaternion: its norm is 1.08"),
        (message(orientation=(0.0, 0.0, math.nan, 1.0)), "orientation is not finite: 0.0, 0.0, nan, 1.0"),
        (message(position=(0.0, math.inf, 0.0)), "position is not finite: 0.0, inf, 0.0"),
    ],
)
def test_a_message_that_holds_no_pose_is_refused(bad, says: str) -> None:
    with pytest.raises(CommandError, match=says):
        messages.matrix(bad)


def test_two_bodies_add_up_by_steiners_theorem() -> None:
    # Two balls on a rod of length 2 a: I = 2 (I0 + m a^2) across, 2 I0 along.
    ball = MassProperties(1.5, np.zeros(3), 0.01 * np.eye(3))
    first, second = (ball.moved(homogeneous(np.eye(3), (side * 0.3, 0.0, 0.0))) for side in (-1, 1))
    both = first + second
    assert both.mass == 3.0
    assert np.array_equal(both.com, np.zeros(3))
    assert both.inertia == pytest.approx(np.diag([0.02, 0.02 + 3 * 0.09, 0.02 + 3 * 0.09]))


def test_nothing_added_to_a_body_changes_nothing_and_nothing_twice_is_nothing() -> None:
    body = MassProperties(1.5, np.array([0.1, 0.2, -0.3]), np.diag([0.1, 0.2, 0.25]))
    for total in (body + MassProperties(), MassProperties() + body):
        assert total.mass == body.mass
        assert total.com == pytest.approx(body.com, rel=1e-15)
        assert total.inertia == pytest.approx(body.inertia, rel=1e-15)
    assert (MassProperties() + MassProperties()).mass == 0.0


def test_principal_moments_rebuild_the_tensor_also_where_it_is_not_physical(rng) -> None:
    for _ in range(50):
        half = rng.uniform(-1, 1, (3, 3))
        moments, R = MassProperties(1.0, np.zeros(3), half + half.T).principal()
        assert np.linalg.det(R) == pytest.approx(1.0)
        again = rotation_from_rpy(rpy_from_rotation(R))
        assert np.abs(again @ np.diag(moments) @ again.T - (half + half.T)).max() < 1e-13


def test_steiners_term_is_that_of_a_point_mass_and_does_not_depend_on_the_sign_of_q() -> None:
    assert steiner_term(2.0, np.array([0.0, 0.0, 3.0])) == pytest.approx(np.diag([18.0, 18.0, 0.0]))
    q = np.array([0.1, -0.2, 0.3])
    assert steiner_term(1.5, q) == pytest.approx(steiner_term(1.5, -q))
    assert steiner_term(1.0, np.array([1.0, 2.0, 0.0]))[0, 1] == -2.0


def test_a_tensor_is_judged_by_its_moments_whatever_its_axes(rng) -> None:
    R = Rotation.random(rng=rng).as_matrix()
    assert judge(R @ np.diag([1.0, 2.0, 2.5]) @ R.T).reasons() == []
    assert judge(R @ np.diag([1.0, 2.0, 3.5]) @ R.T).reasons() == ["breaks the triangle inequality by 0.500000 kg m^2"]
    assert (
        judge(tensor(-1.0, 0.0, 0.0, 2.0, 0.0, 0.5)).reasons()[1]
        == "is not positive definite (eigenvalues -1.0000 kg m^2)"
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("angle", [0.3, 3.1415926, -2.0, 0.0])
def test_a_rotation_about_an_axis_in_column_major_order_gives_its_quaternion(axis: int, angle: float) -> None:
    i, j = (axis + 1) % 3, (axis + 2) % 3
    T = [1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0]
    T[4 * i + i] = T[4 * j + j] = math.cos(angle)
    T[4 * i + j], T[4 * j + i] = math.sin(angle), -math.sin(angle)
    expected = [0.0, 0.0, 0.0, math.cos(angle / 2)]
    expected[axis] = math.sin(angle / 2)
    found = Pose.of_column_major(T).orientation
    sign = 1 if sum(a * b for a, b in zip(found, expected, strict=True)) > 0 else -1
    assert [sign * value for value in found] == pytest.approx(expected, abs=1e-7)
