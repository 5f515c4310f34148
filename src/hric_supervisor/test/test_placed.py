"""Tests of capsules at one instant and of their nearest pairs, against the vectorised functions for recordings."""

import math

import numpy as np
import pytest
from supervisor_rig import ARM, READY, body

from hric_assessment.separation.capsules import distances, nearest_points, of_body, poses
from hric_assessment.separation.protective import approach, fastest
from hric_core.geometry import Pose, from_rotation_vector
from hric_core.urdf import read
from hric_dynamics.tree import nearest
from hric_supervisor.arm import STEP, ArmState
from hric_supervisor.person import BodyShape
from hric_supervisor.placed import CapsuleTree

RANDOM = np.random.default_rng(3)


def rows_of(a: np.ndarray, radii_a: np.ndarray, b: np.ndarray, radii_b: np.ndarray) -> np.ndarray:
    rows = np.empty((len(radii_b), 8))
    nearest(a, radii_a, b, radii_b, rows)
    return rows


def test_the_capsules_of_an_arm_move_as_those_of_a_recording():
    for _ in range(20):
        q, dq = READY + RANDOM.normal(0.0, 0.7, 7), RANDOM.normal(0.0, 1.0, 7)
        placed, (now, ahead) = ARM.at(ArmState(0.0, q, dq)), ARM.ends(np.array([q, q + STEP * dq]))
        assert np.abs(placed.ends - now).max() < 1e-14
        assert np.abs(placed.velocities - (ahead - now) / STEP).max() < 1e-11


def test_the_nearest_capsules_are_those_of_the_functions_for_recordings():
    person = body()
    joints, capsules, overlaps = tuple(person.joints), of_body(person), 0
    for _ in range(200):
        q, angles = READY + RANDOM.normal(0.0, 0.7, 7), RANDOM.normal(0.0, 0.6, len(joints))
        root = Pose(tuple(RANDOM.uniform(-0.9, 0.9, 3).tolist()), from_rotation_vector(RANDOM.normal(0, 1, 3).tolist()))
        seen = BodyShape(person, root).seen(0.0, "world", dict(zip(joints, angles.tolist(), strict=True)))
        T = poses(read(person.urdf), joints, angles[None], root.transform()[None])
        expected = capsules.placed(np.stack([T[link] for link in capsules.links], axis=1))
        assert np.abs(seen.ends - expected[0]).max() < 1e-14
        ends = ARM.ends(q[None])
        apart = distances(ends, ARM.capsules.radii, expected, seen.radii)[0]
        rows, index = rows_of(ends[0], ARM.capsules.radii, seen.ends, seen.radii), np.argmin(apart, axis=0)
        assert rows[:, 0] == pytest.approx(apart.min(axis=0), abs=1e-12)
        assert np.array_equal(rows[:, 1], index)
        apart_points = np.linalg.norm(rows[:, 2:5] - rows[:, 5:], axis=1)
        on_a, on_b = nearest_points(ends[0][index], seen.ends)
        assert apart_points == pytest.approx(np.linalg.norm(on_a - on_b, axis=1), abs=1e-9)
        overlaps += int(apart.min() < 0.0)
    assert 10 < overlaps < 190


def test_parallel_crossing_and_point_like_axes_have_their_closed_form():
    along = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    beside, across = along + np.array([0.5, 0.3, 0.0]), np.array([[[0.5, -1.0, 0.4], [0.5, 1.0, 0.4]]])
    point = np.array([[[3.0, 0.0, 4.0], [3.0, 0.0, 4.0]]])
    radii = np.array([0.1])
    for other, expected in ((beside, 0.3), (across, 0.4), (point, math.hypot(2.0, 4.0))):
        for row in (rows_of(along, radii, other, 2.0 * radii)[0], rows_of(other, 2.0 * radii, along, radii)[0]):
            assert row[0] == pytest.approx(expected - 0.3, abs=1e-15)
            assert math.dist(row[2:5], row[5:]) == pytest.approx(expected, abs=1e-15)


def test_the_first_of_equally_near_capsules_counts_and_one_that_is_not_known_always():
    sphere = np.zeros((1, 2, 3))
    for unknown, expected in ((np.array([]), 0), (np.array([2]), 2)):
        ends = np.concatenate([sphere + np.array([1.0, 0.0, 0.0])] * 4)
        ends[unknown.astype(int)] = math.nan
        row = rows_of(ends, np.zeros(4), sphere, np.zeros(1))[0]
        assert row[1] == expected and math.isnan(row[0]) == bool(len(unknown))


def test_the_faster_ends_approach_along_the_line_between_the_axes_and_at_full_speed_where_these_cross():
    for count in range(1, 12):
        ends, arm, person = (RANDOM.normal(size=(size, 2, 3)) for size in (count, 5, count))
        ends[0] = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
        rows = rows_of(np.tile([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]], (5, 1, 1)), np.zeros(5), ends, np.zeros(count))
        rows[:, 1] = RANDOM.integers(0, 5, count)
        found, offset = np.empty((count, 5)), rows[:, 5:] - rows[:, 2:5]
        approach(rows, arm, person, found)
        length = np.linalg.norm(offset, axis=1)
        expected = offset[1:] / length[1:, None]
        assert length[0] == 0.0 and np.abs(found[1:, :3] - expected).max(initial=0.0) < 1e-15
        arm = arm[rows[:, 1].astype(int)]
        for speeds, sign, velocities in ((found[:, 3], 1.0, arm), (found[:, 4], -1.0, person)):
            assert speeds[0] == pytest.approx(np.linalg.norm(velocities[0], axis=1).max(), rel=1e-15)
            along = sign * np.einsum("mei,mi->me", velocities[1:], expected)
            assert speeds[1:] == pytest.approx(along.max(axis=1, initial=0.0), abs=1e-14)
        assert fastest(person) == pytest.approx(np.linalg.norm(person, axis=2).max(), rel=1e-15)
    with pytest.raises(IndexError, match="the arm has 4 capsules"):
        approach(np.full((1, 8), 4.0), np.zeros((4, 2, 3)), np.zeros((1, 2, 3)), np.zeros((1, 5)))


def test_wrong_sizes_are_refused():
    with pytest.raises(ValueError, match="do not fit"):
        approach(np.zeros((2, 8)), np.zeros((1, 2, 3)), np.zeros((1, 2, 3)), np.zeros((1, 5)))
    with pytest.raises(ValueError, match="do not fit"):
        nearest(np.zeros((2, 2, 3)), np.zeros(1), np.zeros((1, 2, 3)), np.zeros(1), np.zeros((1, 8)))
    with pytest.raises(ValueError, match="do not fit"):
        nearest(np.zeros((1, 2, 3)), np.zeros(1), np.zeros((1, 2, 3)), np.zeros(1), np.zeros((1, 7)))
    with pytest.raises(ValueError, match="7 numbers"):
        CapsuleTree(ARM.tree, ARM.joints, ARM.capsules)([0.0] * 6)
