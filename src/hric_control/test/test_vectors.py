"""Sums and tests over short lists, compiled and in Python."""

import math
import struct

import numpy as np
import pytest

from hric_control import vectors
from hric_control.vectors import Plain

KINDS = [vectors, Plain]


def test_the_functions_in_use_are_the_compiled_ones():
    assert vectors.within is not Plain.within and not hasattr(vectors.within, "__code__")


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_belong_to_what_is_within(kind):
    assert kind.within([1.0, -2.0], (1.0, -3.0), [5.0, -2.0])
    assert not kind.within([1.0, -2.0], [1.0, -3.0], [5.0, -2.1])
    assert kind.smaller([1.0, -2.0], [1.0, 2.0]) and not kind.smaller([1.0, -2.1], [1.0, 2.0])
    assert kind.near([1.0, 5.0], [2.0, 3.0], [1.0, 2.0]) and not kind.near([1.0, 5.0], [2.0, 2.9], [1.0, 2.0])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_within_nothing_finite(kind, value):
    assert not kind.within([0.0, value], [-1.0, -1e300], [1.0, 1e300])
    assert not kind.smaller([value], [1e300])
    assert not kind.near([value], [0.0], [1e300]) and not kind.near([0.0], [value], [1e300])


def test_compiled_and_plain_give_the_same_bits():
    rng = np.random.default_rng(3)
    for _ in range(100):
        a, b, c, d, e = rng.normal(0, 10, (5, 7)).tolist()
        assert vectors.add(a, b) == Plain.add(a, b)
        assert vectors.spring_damper(a, b, c, d, e) == Plain.spring_damper(a, b, c, d, e)


@pytest.mark.parametrize("kind", KINDS)
def test_numbers_go_into_a_buffer_and_come_back(kind):
    buffer = bytearray(5 * 8)
    kind.put(buffer, 1, [1.0, 2.0], (3,))
    assert struct.unpack("5d", buffer) == (0.0, 1.0, 2.0, 3.0, 0.0)
    assert kind.take(buffer, 2, 2) == [2.0, 3.0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_buffer_that_is_too_short_is_refused(kind):
    with pytest.raises((ValueError, struct.error)):
        kind.put(bytearray(16), 1, [1.0, 2.0])
    with pytest.raises((ValueError, struct.error)):
        kind.take(bytearray(16), 1, 2)
    for place in (-3, 3):
        with pytest.raises((ValueError, struct.error)):
            kind.take(bytearray(16), place, 1)


@pytest.mark.parametrize("kind", KINDS)
def test_lists_of_different_length_are_refused(kind):
    with pytest.raises(ValueError):
        kind.add([1.0, 2.0], [1.0])
    with pytest.raises(ValueError):
        kind.within([1.0], [0.0, 0.0], [2.0])


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_number_is_refused(kind):
    with pytest.raises(TypeError):
        kind.spring_damper(["a"], [1.0], [1.0], [1.0], [1.0])
    with pytest.raises(TypeError):
        kind.within([None], [0.0], [1.0])
