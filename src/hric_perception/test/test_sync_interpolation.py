"""Interpolation between samples, and the buffer of the samples."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from hric_perception.sync.buffer import StampBuffer
from hric_perception.sync.sampling import bracket, hold, linear, nearest, slerp

FAR = 1e9


def test_a_turn_is_interpolated_as_scipy_does() -> None:
    rotations = Rotation.random(20, np.random.default_rng(1))
    stamps = np.cumsum(np.random.default_rng(2).integers(1_000, 50_000_000, 20))
    instants = np.linspace(stamps[0], stamps[-1], 333).astype(np.int64)
    ours = slerp(rotations.as_quat(), bracket(stamps, instants), FAR)
    theirs = Slerp(stamps, rotations)(instants).as_quat()
    assert np.minimum(np.abs(ours - theirs), np.abs(ours + theirs)).max() < 1e-6  # scipy's times are floats
    assert np.abs(np.linalg.norm(ours, axis=1) - 1).max() < 1e-14


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 9.9e-5, 1.1e-4, 1e-2, 3.0, np.pi - 1e-6])
def test_a_turn_has_constant_speed_at_any_angle(angle: float) -> None:
    turns = np.array([[0.0, 0.0, np.sin(part * angle / 2), np.cos(part * angle / 2)] for part in (0.0, 1.0)])
    at = slerp(turns, bracket(np.array([0, 1000]), np.array([250])), FAR)[0]
    assert 2 * np.arctan2(at[2], at[3]) == pytest.approx(angle / 4, abs=1e-12)


def test_the_sign_of_a_quaternion_makes_no_difference() -> None:
    turns = Rotation.random(2, np.random.default_rng(5)).as_quat()
    at = bracket(np.array([0, 10]), np.array([3, 7]))
    one, other = slerp(turns, at, FAR), slerp(turns * [[1], [-1]], at, FAR)
    assert np.minimum(np.abs(one - other), np.abs(one + other)).max() < 1e-15


def test_a_quaternion_of_norm_0_is_none() -> None:
    turns = np.array([[0.0, 0, 0, 1], [0, 0, 0, 0]])
    assert np.isnan(slerp(turns, bracket(np.array([0, 10]), np.array([5])), FAR)).all()


def test_there_is_no_value_before_the_first_and_after_the_last_sample() -> None:
    values = np.array([[1.0], [2.0]])
    at = bracket(np.array([10, 20]), np.array([9, 10, 15, 20, 21]))
    assert linear(values, at, FAR)[:, 0].tolist() == pytest.approx([np.nan, 1.0, 1.5, 2.0, np.nan], nan_ok=True)
    assert hold(values, at, FAR)[:, 0].tolist() == pytest.approx([np.nan, 1.0, 1.0, 2.0, 2.0], nan_ok=True)


def test_a_sample_that_is_hit_counts_even_where_a_gap_follows_or_precedes() -> None:
    values = np.array([[1.0], [np.nan], [3.0]])
    at = bracket(np.array([0, 10, 1_000_000_000]), np.array([0, 5, 10, 1_000_000_000]))
    assert linear(values, at, 0.1)[:, 0].tolist() == pytest.approx([1.0, np.nan, np.nan, 3.0], nan_ok=True)


def test_the_nearest_of_two_equally_far_samples_is_the_earlier_one() -> None:
    index, age = nearest(np.array([0, 10, 20]), np.array([-5, 4, 5, 6, 25]))
    assert index.tolist() == [0, 0, 0, 1, 2] and age.tolist() == pytest.approx([-5e-9, 4e-9, 5e-9, -4e-9, 5e-9])


def test_a_buffer_keeps_the_latest_samples_in_order_through_any_pieces() -> None:
    random, buffer, count = np.random.default_rng(3), StampBuffer(50, 1), 0
    for size in random.integers(0, 70, 200).tolist():
        stamps = np.arange(count, count + size)
        buffer.extend(stamps, stamps[:, None].astype(float))
        count += size
        expected = list(range(max(0, count - 50), count))
        assert buffer.stamps.tolist() == expected and buffer.values[:, 0].tolist() == expected
        assert (buffer.first, buffer.last) == ((expected[0], expected[-1]) if expected else (None, None))
