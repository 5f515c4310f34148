"""Jitter buffer of marker samples: the time at which each sample takes effect."""

import numpy as np
import pytest

from hric_controllers.marker.follower import PoseOffset
from hric_controllers.marker.jitter_buffer import MAX_WAITING, JitterBuffer

MARGIN = 0.015


def target_at(x, angle=0.0):
    return PoseOffset((x, 0.0, 0.0), (0.0, 0.0, angle))


def played(stamps, arrivals, margin=MARGIN, seconds=1.0, value=lambda stamp: stamp):
    """x of the target in each millisecond, NaN before the first: samples whose x is `value` of their stamp, that
    arrive at `arrivals`."""
    buffer, waiting, row, out = JitterBuffer(margin), sorted(zip(arrivals, stamps, strict=True)), np.nan, []
    for time in np.arange(0.0, seconds, 1e-3):
        while waiting and waiting[0][0] <= time:
            _, stamp = waiting.pop(0)
            buffer.add(time, stamp, target_at(value(stamp)))
        target = buffer.due(time)
        row = row if target is None else target.position[0]
        out.append(row)
    return np.array(out)


def test_jitter_within_the_margin_changes_nothing():
    stamps = np.arange(0.0, 1.0, 1 / 240)
    steady = played(stamps, stamps + 0.005)
    late = np.random.default_rng(2).uniform(0.0, 0.010, len(stamps))
    late[0] = 0.0
    shaken = played(stamps, stamps + 0.005 + late)
    assert np.nanmax(np.abs(steady - shaken)) < 1.1e-3  # arrivals are noticed once in a millisecond
    assert np.nanstd(np.diff(shaken[100:])) < 2e-5


def test_without_a_margin_each_counts_when_it_comes():
    stamps = np.arange(0.0, 0.5, 1 / 240)
    late = np.random.default_rng(2).uniform(0.0, 0.012, len(stamps))
    shaken = played(stamps, stamps + 0.005 + late, margin=0.0, seconds=0.5)
    assert np.nanstd(np.diff(shaken[100:])) > 1e-3


def test_the_delay_is_the_least_one_plus_the_margin_whatever_the_clocks_offset():
    stamps = np.arange(0.0, 1.0, 1 / 240)
    for offset in (0.0, 1.8e9, -300.0):
        out = played(stamps + offset, stamps + 0.005, value=lambda stamp, offset=offset: stamp - offset)
        assert 0.5 - out[500] == pytest.approx(0.005 + MARGIN, abs=1.1e-3)


def test_a_sample_that_is_later_than_the_margin_is_waited_for_at_the_one_before():
    stamps = np.arange(0.0, 1.0, 0.01)
    arrivals = np.where(stamps < 0.5, stamps, np.maximum(stamps, 0.6))
    out = played(stamps, arrivals)
    assert out[595] == pytest.approx(0.49)
    assert out[605] == pytest.approx(0.605 - MARGIN, abs=1e-3)


def test_a_sample_without_a_stamp_counts_at_once_and_once():
    buffer = JitterBuffer(MARGIN)
    buffer.add(1.0, None, target_at(3.0))
    assert buffer.due(1.0) == target_at(3.0) and buffer.due(1.001) is None


def test_rotations_are_evened_out_with_positions():
    buffer = JitterBuffer(MARGIN)
    buffer.add(0.0, 0.0, target_at(0.0, 0.0))
    buffer.add(0.01, 0.01, target_at(1.0, 0.4))
    assert buffer.due(0.005 + MARGIN) == PoseOffset((pytest.approx(0.5), 0.0, 0.0), (0.0, 0.0, pytest.approx(0.2)))


def test_after_clear_nothing_of_before_counts():
    buffer = JitterBuffer(MARGIN)
    buffer.add(0.0, 0.0, target_at(1.0))
    buffer.clear()
    assert buffer.due(1.0) is None


def test_another_clock_begins_again():
    buffer = JitterBuffer(MARGIN)
    buffer.add(10.0, 0.0, target_at(1.0))
    buffer.add(10.1, 1000.0, target_at(2.0))
    assert buffer.due(10.1) is None and buffer.due(10.1 + MARGIN + 1e-9) == target_at(2.0)


def test_samples_that_nobody_takes_do_not_pile_up():
    buffer = JitterBuffer(MARGIN)
    for i in range(10 * MAX_WAITING):
        buffer.add(0.001 * i, 0.001 * i, target_at(float(i)))
    assert buffer.due(100.0) == target_at(float(10 * MAX_WAITING - 1))
