"""How smooth a movement is, beside closed forms."""

import math

import numpy as np
import pytest

from hric_assessment.ergonomics.smoothness import log_dimensionless_jerk, smoothness
from hric_control.errors import HricError

X = np.linspace(0.0, 1.0, 2001)


def reach(course: np.ndarray, distance: float = 0.4, duration: float = 0.8) -> tuple[np.ndarray, np.ndarray]:
    return duration * X, np.outer(course, distance * np.array([0.6, 0.0, 0.8]))


def test_a_minimum_jerk_movement_has_peaks_of_one() -> None:
    found = smoothness(*reach(10 * X**3 - 15 * X**4 + 6 * X**5))
    assert tuple(found) == pytest.approx((1.0, 1.0, 1.0), rel=0.01)


def test_a_movement_of_half_a_cosine_has_those_of_its_derivatives() -> None:
    found = smoothness(*reach(0.5 - 0.5 * np.cos(np.pi * X)))
    assert found.speed == pytest.approx(0.5 * np.pi / 1.875, rel=1e-4)
    assert found.acceleration == pytest.approx(0.5 * np.pi**2 / (10.0 / np.sqrt(3.0)), rel=0.01)


def test_size_and_duration_do_not_matter_but_a_tremor_does() -> None:
    course = 10 * X**3 - 15 * X**4 + 6 * X**5
    small = smoothness(*reach(course, 0.1, 3.0))
    assert tuple(small) == pytest.approx(tuple(smoothness(*reach(course))))
    assert smoothness(*reach(course + 0.002 * np.sin(60.0 * X))).jerk > 5.0


def test_what_is_no_movement_or_has_too_few_or_uneven_samples_is_refused() -> None:
    with pytest.raises(HricError, match="no movement"):
        smoothness(X, np.zeros((len(X), 3)))
    with pytest.raises(HricError, match="8 or more, evenly spaced"):
        smoothness(X[:5], np.zeros((5, 3)))
    with pytest.raises(HricError, match="8 or more, evenly spaced"):
        smoothness(X**2, np.zeros((len(X), 3)))


def test_one_minimum_jerk_reach_has_the_smoothness_of_its_closed_form() -> None:
    """T^3 / v_peak^2 int jerk^2 = 720 / 1.875^2."""
    u = np.linspace(0.0, 1.0, 4001)
    speed = 30.0 * (u - u * u) ** 2 * 0.3 / 2.0
    velocity = np.outer(speed, [0.6, 0.0, 0.8])
    assert log_dimensionless_jerk(2.0 * u, velocity) == pytest.approx(-math.log(720.0 / 1.875**2), abs=3e-3)


def test_what_rests_has_no_smoothness() -> None:
    assert log_dimensionless_jerk(X, np.zeros((len(X), 3))) is None
