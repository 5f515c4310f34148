"""Smoothness of a movement, beside its closed form."""

import math

import numpy as np
import pytest

from hric_assessment.ergonomics.effort import log_dimensionless_jerk

X = np.linspace(0.0, 1.0, 2001)


def test_one_minimum_jerk_reach_has_the_smoothness_of_its_closed_form() -> None:
    """T^3 / v_peak^2 int jerk^2 = 720 / 1.875^2."""
    u = np.linspace(0.0, 1.0, 4001)
    speed = 30.0 * (u - u * u) ** 2 * 0.3 / 2.0
    velocity = np.outer(speed, [0.6, 0.0, 0.8])
    assert log_dimensionless_jerk(2.0 * u, velocity) == pytest.approx(-math.log(720.0 / 1.875**2), abs=3e-3)


def test_five_instants_have_the_smoothness_of_their_differences_and_four_have_none() -> None:
    """Speeds 0, 1, 2, 1, 0: second differences 0, -1/2, -1, -1/2, 0, so 4^3 / 2^2 * 3/2."""
    velocity = np.outer([0.0, 1.0, 2.0, 1.0, 0.0], [0.0, 0.6, 0.8])
    assert log_dimensionless_jerk(np.arange(3.0, 8.0), velocity) == pytest.approx(-math.log(24.0))
    assert log_dimensionless_jerk(np.arange(3.0, 8.0), 1e-6 * velocity) == pytest.approx(-math.log(24.0))
    assert log_dimensionless_jerk(np.arange(3.0, 7.0), velocity[:4]) is None


def test_what_rests_has_no_smoothness() -> None:
    assert log_dimensionless_jerk(X, np.zeros((len(X), 3))) is None
