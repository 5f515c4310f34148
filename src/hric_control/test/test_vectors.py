"""Sums and tests over short lists, against the same in Python."""

import math

import numpy as np
import pytest

from hric_control.errors import HricError
from hric_control.native import load
from hric_control.native.vectors import add, near, smaller, spring_damper, untouched, within


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


@pytest.mark.parametrize("spoiled", range(5))
def test_a_command_is_untouched_where_nothing_reaches_its_bound(spoiled):
    rows = [[0.5, 0.5], [2.0, -2.0], [10.0, 9.0]]  # position, velocity, command
    low, high, v_bound, bound, last, change = [0.0, 0.5], [1.0, 0.5], [2.0, 2.0], [10.0, 10.0], [9.0, 9.5], [1.0, 1.0]

    def free() -> bool:
        return untouched(rows[0], low, high, rows[1], v_bound, rows[2], bound, last, change)

    assert free()
    row, value = [(rows[0], 0.49), (rows[0], math.nan), (rows[1], -2.1), (rows[2], 10.1), (rows[2], 6.9)][spoiled]
    row[1] = value
    assert not free()


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


def test_a_module_that_is_not_built_is_refused_with_what_builds_it():
    with pytest.raises(HricError, match=r"compiled module hric_nothing is not built.*scripts/setup"):
        load("hric_nothing")
