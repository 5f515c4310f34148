"""Sums have the same bits in every version of Python."""

from hric_core.summation import total


def test_rounding_errors_are_not_made_up_for() -> None:
    assert total([1.0, 1e100, 1.0, -1e100]) == 0.0
    assert total(iter([0.1] * 10)) == 0.9999999999999999


def test_no_values_are_zero() -> None:
    assert total([]) == 0.0
