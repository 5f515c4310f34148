"""Sums and comparisons over short lists in C, against the same computations in Python."""

import math

import numpy as np
import pytest

from hric_core.errors import HricError
from hric_core.native import load
from hric_core.native.vectors import add, near, smaller, spring_damper, touched, within


def test_bounds_belong_to_what_is_within():
    assert within([1.0, -2.0], (1.0, -3.0), [5.0, -2.0])
    assert not within([1.0, -2.0], [1.0, -3.0], [5.0, -2.1])
    assert smaller([1.0, -2.0], [1.0, 2.0]) and not smaller([1.0, -2.1], [1.0, 2.0])
    assert near([1.0, 5.0], [2.0, 3.0], [1.0, 2.0]) and not near([1.0, 5.0], [2.0, 2.9], [1.0, 2.0])


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_within_nothing_finite(value):
    assert not within([0.0, value], [-1.0, -1e300], [1.0, 1e300])
    assert not smaller([value], [1e300])
    assert not near([value], [0.0], [1e300]) and not near([0.0], [value], [1e300])


def test_sums_have_the_bits_of_python():
    rng = np.random.default_rng(3)
    for _ in range(100):
        k, d, x_d, x, v = rng.normal(0, 10, (5, 7)).tolist()
        assert add(k, d) == [a + b for a, b in zip(k, d, strict=True)]
        force = [p * (r - y) - c * w for p, c, r, y, w in zip(k, d, x_d, x, v, strict=True)]
        assert spring_damper(k, d, x_d, x, v, k, None, 0.0) == force
        assert spring_damper(k, d, x_d, x, v, k, d, 0.0) == [f + a for f, a in zip(force, d, strict=True)]
        assert spring_damper(k, d, x_d, x, v, k, None, 2.0) == [
            min(max(f, last - 2.0), last + 2.0) for f, last in zip(force, k, strict=True)
        ]


@pytest.mark.parametrize("softness", [0.0, 8.0])
def test_what_a_limit_may_touch_is_found_by_index_and_the_largest_speeds_are_kept(softness):
    """Against the same inequalities in Python, in numbers so coarse that bounds are met exactly."""
    rng, fastest_so_far = np.random.default_rng(4), [0.0] * 7
    expected_speeds = np.zeros(7)
    for _ in range(300):
        x, v, value, last = (rng.integers(-4, 5, (4, 7)) / 2.0).tolist()
        for row in (x, v, value, last):
            if rng.random() < 0.1:
                row[rng.integers(7)] = [math.nan, math.inf, -math.inf][rng.integers(3)]
        low, high, fastest, bound, change = [-1.5] * 7, [1.0] * 7, [1.5] * 7, [2.0] * 7, [2.5] * 7
        found = touched(x, low, high, v, fastest, [softness] * 7, value, bound, last, change, fastest_so_far)
        speed = np.abs(v)
        free = (np.array(x) >= -1.5) & (np.array(x) <= 1.0) & (speed <= 1.5) & (np.abs(value) <= 2.0)
        with np.errstate(invalid="ignore"):
            free &= np.abs(np.array(value) - last) <= 2.5
        if softness:
            free &= np.abs(value) <= softness * (1.5 - speed)
        assert found == np.flatnonzero(~free).tolist()
        expected_speeds = np.fmax(expected_speeds, np.where(np.isfinite(speed), speed, 0.0))
        assert fastest_so_far == expected_speeds.tolist()


def test_lists_of_different_length_are_refused():
    with pytest.raises(ValueError):
        add([1.0, 2.0], [1.0])
    with pytest.raises(ValueError):
        within([1.0], [0.0, 0.0], [2.0])


def test_what_is_no_number_is_refused():
    with pytest.raises(TypeError):
        spring_damper(["a"], [1.0], [1.0], [1.0], [1.0], [1.0], None, 0.0)
    with pytest.raises(TypeError):
        within([None], [0.0], [1.0])
    with pytest.raises(TypeError):
        touched(*[[0.0]] * 10, (0.0,))


def test_a_module_that_is_not_built_is_refused_with_what_builds_it():
    with pytest.raises(HricError, match=r"compiled module hric_nothing is not built.*scripts/setup"):
        load("hric_nothing")
