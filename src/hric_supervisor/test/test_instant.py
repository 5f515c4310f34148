"""Tests of the distance at one instant, against the vectorised functions for recordings."""

import math

import numpy as np
import pytest
from supervisor_rig import ARM, READY, body

from hric_assessment.separation.capsules import distances
from hric_core.geometry import Pose, from_rotation_vector
from hric_dynamics.tree import closest
from hric_supervisor.instant import InstantSeparation
from hric_supervisor.person import BodyShape


def test_the_distance_is_that_of_the_functions_for_recordings():
    random, person = np.random.default_rng(3), body()
    separation, joints = InstantSeparation(ARM, person), tuple(person.joints)
    overlaps = 0
    for _ in range(200):
        q, angles = READY + random.normal(0.0, 0.7, 7), random.normal(0.0, 0.6, len(joints)).tolist()
        turn = from_rotation_vector(tuple(random.normal(0.0, 1.0, 3).tolist()))
        root = Pose(tuple(random.uniform(-0.9, 0.9, 3).tolist()), turn)
        seen = BodyShape(person, root).seen(0.0, "world", dict(zip(joints, angles, strict=True)))
        expected = float(distances(ARM.ends(q[None]), ARM.capsules.radii, seen.ends[None], seen.radii).min())
        overlaps += expected < 0.0
        assert separation(q.tolist(), angles, root) == pytest.approx(expected, abs=1e-12)
    assert 10 < overlaps < 190


def test_parallel_crossing_and_point_like_axes_have_their_closed_form():
    along = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    beside, across = along + np.array([0.5, 0.3, 0.0]), np.array([[[0.5, -1.0, 0.4], [0.5, 1.0, 0.4]]])
    point = np.array([[[3.0, 0.0, 4.0], [3.0, 0.0, 4.0]]])
    radii = np.array([0.1])
    for other, expected in ((beside, 0.3), (across, 0.4), (point, math.hypot(2.0, 4.0))):
        assert closest(along, radii, other, 2.0 * radii) == pytest.approx(expected - 0.3, abs=1e-15)
        assert closest(other, 2.0 * radii, along, radii) == pytest.approx(expected - 0.3, abs=1e-15)


def test_a_position_that_is_not_finite_gives_no_distance():
    separation, angles = InstantSeparation(ARM, body()), [0.0] * len(body().joints)
    angles[-1] = math.nan
    assert math.isnan(separation(READY.tolist(), angles, Pose()))


def test_wrong_sizes_are_refused():
    with pytest.raises(ValueError, match="do not fit"):
        closest(np.zeros((2, 2, 3)), np.zeros(1), np.zeros((1, 2, 3)), np.zeros(1))
    with pytest.raises(ValueError, match="7 numbers"):
        InstantSeparation(ARM, body())([0.0] * 6, [0.0] * len(body().joints), Pose())
