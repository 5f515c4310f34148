"""Contact areas of shapes that lie on each other, against areas known from geometry."""

import math

import numpy as np
import pytest

from hric_control.plants.faces import SOFTNESS, Corner, Solid, centre, corners
from hric_core.geometry import transform_from_rpy

HERE = np.eye(4)
UP = np.array([0.0, 0.0, 1.0])
FLOOR = Solid("box", (1.0, 1.0, 1.0), transform_from_rpy([0.0, 0.0, -0.5], [0.0, 0.0, 0.0]))
PLANE = Solid("plane", (), HERE)
CUBE = np.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)])


def on_floor(solid, height, rpy=(0.0, 0.0, 0.0), xy=(0.0, 0.0), floor=FLOOR, depth=0.002):
    """Corners of a shape with its centre at a height over the floor; (x, y) and depth of each, sorted."""
    deepest = np.array([*xy, -0.5 * depth])
    found = corners(solid, transform_from_rpy([*xy, height], list(rpy)), floor, HERE, UP, deepest, depth)
    assert sum(corner.share for corner in found) == pytest.approx(1.0)
    return sorted(
        (*(round(float(v), 6) + 0.0 for v in corner.position[:2]), round(corner.depth, 6)) for corner in found
    )


@pytest.mark.parametrize("floor", [FLOOR, PLANE], ids=["box", "plane"])
def test_what_stands_or_lies_flat_touches_at_its_corners(floor):
    square = [(x, y, 0.002) for x in (-0.05, 0.05) for y in (-0.05, 0.05)]
    assert on_floor(Solid("box", (0.1, 0.1, 0.1), HERE), 0.048, floor=floor) == square
    assert on_floor(Solid("hull", (), HERE, CUBE), 0.048, floor=floor) == square
    lying = (math.pi / 2, 0.0, 0.0)
    assert on_floor(Solid("capsule", (0.03, 0.1), HERE), 0.028, lying, floor=floor) == [
        (0.0, -0.05, 0.002),
        (0.0, 0.05, 0.002),
    ]
    assert on_floor(Solid("cylinder", (0.03, 0.1), HERE), 0.028, lying, floor=floor) == [
        (0.0, -0.05, 0.002),
        (0.0, 0.05, 0.002),
    ]
    end = on_floor(Solid("cylinder", (0.03, 0.1), HERE), 0.048, floor=floor)
    assert {depth for *_, depth in end} == {0.002}
    assert {round(math.hypot(x, y), 6) for x, y, _ in end} == {0.03}
    assert np.array(end)[:, :2].mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_tilted_side_tells_each_corner_its_own_depth():
    tilt = 0.01
    found = on_floor(
        Solid("capsule", (0.03, 0.1), HERE), 0.028, (math.pi / 2 + tilt, 0.0, 0.0), depth=0.002 + 0.05 * math.sin(tilt)
    )
    assert [depth for *_, depth in found] == pytest.approx(
        [0.002 + 0.05 * math.sin(tilt), 0.002 - 0.05 * math.sin(tilt)], abs=1e-6
    )


def test_a_side_that_hangs_over_an_edge_ends_there():
    hanging = on_floor(Solid("box", (0.1, 0.1, 0.1), HERE), 0.048, xy=(0.48, 0.0))
    assert [x for x, *_ in hanging] == pytest.approx([0.43, 0.43, 0.5, 0.5])
    assert {depth for *_, depth in hanging} == {0.002}


def test_a_ball_and_crossing_lines_touch_at_their_deepest_point():
    assert on_floor(Solid("sphere", (0.05,), HERE), 0.048) == [(0.0, 0.0, 0.002)]
    rod = Solid("capsule", (0.03, 0.1), HERE)
    cross = corners(
        rod,
        transform_from_rpy([0, 0, 0.058], [math.pi / 2, 0, 0]),
        rod,
        transform_from_rpy([0, 0, 0], [0, math.pi / 2, 0]),
        UP,
        np.zeros(3),
        0.002,
    )
    assert [corner.depth for corner in cross] == [0.002]
    along = corners(
        rod,
        transform_from_rpy([0, 0.04, 0.058], [math.pi / 2, 0, 0]),
        rod,
        transform_from_rpy([0, 0, 0], [math.pi / 2, 0, 0]),
        UP,
        np.zeros(3),
        0.002,
    )
    assert sorted(corner.position[1] for corner in along) == pytest.approx([-0.01, 0.05])
    assert [corner.depth for corner in along] == pytest.approx([0.002, 0.002])


def test_a_side_that_is_not_what_meets_is_not_believed():
    """The deepest point is that of another shape of the link: 5 mm deep, where this one's side is 2 mm."""
    assert on_floor(Solid("box", (0.1, 0.1, 0.1), HERE), 0.048, depth=0.005) == [(0.0, 0.0, 0.005)]


def test_one_spring_acts_at_the_middle_of_equal_corners_and_at_one_that_is_far_deeper():
    at = [np.array([x, 0.0, 0.0]) for x in (-0.05, 0.05)]
    even = [Corner(p, 0.002, 0.5) for p in at]
    position, depth = centre(even, [0.0, 0.0], 0.0)
    assert (position[0], depth) == (pytest.approx(0.0), pytest.approx(0.002))
    assert centre(even, [0.5, 0.5], 1e-3)[1] == pytest.approx(0.0025)
    edge = [Corner(at[0], 0.002, 0.5), Corner(at[1], 0.002 - 40 * SOFTNESS, 0.5)]
    position, depth = centre(edge, [0.0, 0.0], 0.0)
    assert (position[0], depth) == (pytest.approx(-0.05), pytest.approx(0.002 - SOFTNESS * math.log(2.0)))


def test_force_and_moment_of_the_spring_have_one_potential(rng):
    """The position is where the depth grows as fast as its corners do on average: d(depth) = sum of their weights times
    theirs, for any motion."""
    for _ in range(20):
        found = [
            Corner(rng.normal(size=3), d, s)
            for d, s in zip(rng.normal(0.002, 0.001, 4), (0.1, 0.2, 0.3, 0.4), strict=True)
        ]
        lift, tilt, h = rng.normal(), rng.normal(size=2), 1e-9
        speeds = [lift + float(tilt @ corner.position[:2]) for corner in found]
        position, _ = centre(found, [0.0] * 4, 0.0)
        change = (centre(found, speeds, h)[1] - centre(found, speeds, -h)[1]) / (2.0 * h)
        assert change == pytest.approx(lift + float(tilt @ position[:2]), rel=1e-5)


@pytest.fixture
def rng():
    return np.random.default_rng(0)
