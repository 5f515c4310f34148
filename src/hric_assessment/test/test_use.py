"""Static and repeated use: what is held, and how often a motion comes again."""

import math

import numpy as np
import pytest

from hric_assessment.ergonomics.use import held, repeats

TIME = np.arange(0.0, 150.0, 0.02)
TEN = math.radians(10.0)


def wave(per_minute: float, degrees: float) -> np.ndarray:
    """A cosine from peak to peak [rad], shape (n, 1)."""
    return (0.5 * math.radians(degrees) * np.cos(2.0 * np.pi * TIME * per_minute / 60.0))[:, None]


@pytest.mark.parametrize(("degrees", "expected"), [(0.0, True), (9.0, True), (11.0, False)])
def test_angles_within_the_tolerance_are_held(degrees: float, expected: bool) -> None:
    assert (held(TIME, wave(6.0, degrees), TEN, 60.0) > 60.0).all() == expected


def test_a_posture_is_held_between_two_motions_alone() -> None:
    moving = (TIME < 20.0) | (TIME > 100.0)
    use = held(TIME, np.where(moving[:, None], wave(10.0, 40.0), 0.3), TEN, 60.0)
    assert (use[(TIME > 20.5) & (TIME < 99.5)] > 60.0).all()
    assert not use[(TIME < 15.0) | (TIME > 105.0)].any()


def test_one_of_several_signals_that_moves_is_enough_to_move() -> None:
    assert not held(TIME, np.hstack([wave(0.0, 0.0), wave(6.0, 30.0)]), TEN, 60.0).any()


@pytest.mark.parametrize(("last", "expected"), [(59.0, False), (60.0, False), (60.02, True), (62.0, True)])
def test_a_recording_shorter_than_static_use_shows_none(last: float, expected: bool) -> None:
    rows = last > TIME
    assert held(TIME[rows], wave(0.0, 0.0)[rows], TEN, 60.0).any() == expected


def test_a_stretch_is_held_from_its_first_block_to_its_last_as_long_as_a_minute_and_one_block() -> None:
    blocks = np.arange(len(TIME)) // 10
    shaken = (blocks % 2).astype(float)
    still = (blocks >= 150) & (blocks < 500)
    use = held(TIME, np.where(still, 0.3, shaken)[:, None], TEN, 60.0)
    np.testing.assert_allclose(use, np.where(still, 60.2, 0.0))


@pytest.mark.parametrize(("step", "expected"), [(TEN, True), (1.001 * TEN, False)])
def test_a_difference_of_the_tolerance_is_held(step: float, expected: bool) -> None:
    there = np.where(TIME % 20.0 < 10.0, 0.0, step)
    assert (held(TIME, there[:, None], TEN, 60.0) > 0.0).all() == expected


def test_no_signals_are_neither_held_nor_repeated() -> None:
    nothing = np.full((len(TIME), 2), np.nan)
    assert not held(TIME, nothing, TEN, 60.0).any() and not repeats(TIME, nothing, TEN).any()


def test_what_is_lost_is_on_a_straight_line_between_the_means_beside_it() -> None:
    """A ramp of which 10 s are lost moves on as it did: by 9 degrees a minute it is held, by 11 it is not."""
    for degrees, expected in ((9.0, True), (11.0, False)):
        ramp = math.radians(degrees) * TIME[:, None] / 60.0
        ramp[(TIME > 40.0) & (TIME < 50.0)] = np.nan
        assert (held(TIME, ramp, TEN, 60.0) > 0.0).all() == expected


def test_noise_of_three_degrees_does_not_end_what_is_held() -> None:
    noise = np.random.default_rng(1).normal(0.0, math.radians(3.0), (len(TIME), 1))
    assert (held(TIME, noise, TEN, 60.0) > 60.0).all()
    assert not repeats(TIME, noise, TEN).any()


def test_lost_samples_do_not_end_what_is_held() -> None:
    signals = np.hstack([wave(0.0, 0.0), np.full((len(TIME), 1), np.nan)])
    signals[(TIME > 70.0) & (TIME < 72.0)] = np.nan
    assert (held(TIME, signals, TEN, 60.0) > 60.0).all()


@pytest.mark.parametrize("per_minute", [1, 3, 4, 12, 40])
def test_a_motion_is_counted_there_and_back(per_minute: int) -> None:
    middle = (TIME > 60.0) & (TIME < 90.0)
    assert set(repeats(TIME, wave(per_minute, 30.0), TEN)[middle]) <= {float(per_minute), per_minute + 1.0}


@pytest.mark.parametrize("per_minute", [3, 4])
def test_the_fullest_minute_has_a_whole_count_of_a_periodic_motion(per_minute: int) -> None:
    assert repeats(TIME, wave(per_minute, 30.0), TEN).max() == per_minute


@pytest.mark.parametrize("seed", range(3))
def test_at_each_instant_the_fullest_minute_with_it_counts(seed: int) -> None:
    """There for half a second, back again at known times; counted by hand over all minutes that begin at a block."""
    backs = np.sort(np.random.default_rng(seed).choice(np.arange(4, 740, 8), 12, replace=False))
    there = np.isin(np.arange(len(TIME)) // 10, np.concatenate([backs - 3, backs - 2, backs - 1]))
    found = repeats(TIME, np.column_stack([0.0 * TIME, TEN * there]), TEN)[::10]
    begins = np.arange(-300, 750)
    counts = np.array([np.count_nonzero((backs >= begin) & (backs < begin + 300)) for begin in begins])
    expected = [counts[(begins <= block) & (begins > block - 300)].max() for block in range(750)]
    assert found.tolist() == expected


def test_a_signal_that_begins_raised_and_comes_down_and_up_repeats_once() -> None:
    dip = np.where((TIME > 30.0) & (TIME < 31.0), 0.0, 1.0)[:, None]
    assert repeats(TIME, dip, TEN)[TIME < 80.0].tolist() == [1.0] * np.count_nonzero(TIME < 80.0)


def test_motions_smaller_than_the_amplitude_do_not_repeat() -> None:
    assert not repeats(TIME, wave(20.0, 9.0), TEN).any()


def test_a_motion_that_goes_on_one_way_does_not_repeat() -> None:
    assert not repeats(TIME, np.linspace(0.0, 3.0, len(TIME))[:, None], TEN).any()


def test_four_repeats_within_seconds_are_four_in_their_minute() -> None:
    burst = np.where((TIME < 8.0)[:, None], wave(30.0, 40.0), 0.5 * math.radians(40.0))
    use = repeats(TIME, burst, TEN)
    assert use[TIME < 60.0].max() == 4.0
    assert not use[TIME > 70.0].any()


def test_a_jump_of_the_stamps_by_a_year_takes_no_memory() -> None:
    jumped = TIME + np.where(TIME > 70.0, 3e7, 0.0)
    assert (held(jumped, wave(0.0, 0.0), TEN, 60.0) > 60.0).all()


@pytest.mark.parametrize("step", [1.0, -1.0])
def test_one_step_after_the_first_block_is_no_repeat(step: float) -> None:
    assert not repeats(TIME, step * (TIME >= 0.2)[:, None], TEN).any()
