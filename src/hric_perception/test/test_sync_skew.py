"""The synchroniser's three policies on streams whose values are the time of their samples."""

import numpy as np
import pytest
from time_coded import START, Stream, plan, skews, synchronise, wave

from hric_perception.sync.core import Synchroniser

ROBOT, MOCAP, EMG, PLATE = (
    Stream(1000.0),
    Stream(240.0, 0.0055, phase=0.0013),
    Stream(2000.0, 0.004, 20, 0.0002),
    Stream(1000.0, 0.02, 10, 0.0004),
)
STREAMS = [ROBOT, MOCAP, EMG, PLATE]
ROUNDING = 1e-8
"""Rounding error of robot times of 100 s as floats [s]."""


@pytest.mark.parametrize("rate", [100.0, 1000.0, 59.94])
def test_resampled_values_are_those_of_the_instant(rate: float) -> None:
    batch, _ = synchronise(plan("resample", 4, rate=rate), STREAMS, 2.0)
    assert batch.valid.all() and np.abs(skews(batch)).max() < ROUNDING
    assert (
        np.abs(batch.values[:, 1::2] - wave(batch.stamps * 1e-9)[:, None]).max() < 0.1 * (np.pi / 240) ** 2 / 8 * 1.01
    )


@pytest.mark.parametrize("rate", [100.0, 1000.0, 59.94])
def test_no_instant_is_left_out_and_none_comes_twice(rate: float) -> None:
    batch, _ = synchronise(plan("resample", 4, rate=rate), STREAMS, 2.0)
    ticks = batch.stamps * 1e-9 * rate
    assert np.abs(ticks - np.rint(ticks)).max() < 1e-5 and (np.diff(np.rint(ticks)) == 1).all()
    assert (
        batch.stamps[0] * 1e-9 < START + 0.001 + 1 / rate + ROUNDING
        and batch.stamps[-1] * 1e-9 > START + 2.0 - 0.03 - 1 / rate
    )


def test_the_ticks_of_a_slow_stream_are_among_those_of_a_fast_one_with_the_same_values() -> None:
    slow, fast = (synchronise(plan("resample", 4, rate=rate), STREAMS, 1.0)[0] for rate in (100.0, 1000.0))
    assert set(slow.stamps.tolist()) <= set(fast.stamps.tolist())
    same = np.isin(fast.stamps, slow.stamps)
    assert (fast.values[same] == slow.values).all()


@pytest.mark.parametrize("reference", [0, 1, 2])
def test_approximate_skew_is_at_most_half_a_period_of_the_slower_signal(reference: int) -> None:
    batch, _ = synchronise(plan("approximate", 4, reference=f"/s{reference}"), STREAMS, 2.0)
    for index, stream in enumerate(STREAMS):
        slower = min(stream.rate, STREAMS[reference].rate)
        assert np.abs(skews(batch)[:, index]).max() <= 0.5 / slower + ROUNDING, index


def test_approximate_takes_each_sample_of_the_reference_once() -> None:
    batch, synchroniser = synchronise(plan("approximate", 4, reference="/s1"), STREAMS, 2.0)
    assert np.abs(skews(batch)[:, 1]).max() < ROUNDING
    assert (
        np.abs(np.diff(batch.stamps) * 1e-9 - 1 / 240).max() < ROUNDING
        and len(batch.stamps) + synchroniser.dropped > (2.0 - 0.04) * 240
    )


def test_ages_give_the_stamps_of_the_samples_used() -> None:
    batch, _ = synchronise(plan("approximate", 4, reference="/s1"), STREAMS, 1.0)
    assert np.abs(batch.age + skews(batch)).max() < ROUNDING
    batch, _ = synchronise(plan("resample", 4, rate=100.0), STREAMS, 1.0)
    assert (batch.age >= 0).all() and (batch.age.max(axis=0) < 1.0 / np.array([one.rate for one in STREAMS])).all()


def test_exact_takes_samples_of_the_same_stamp_and_no_others() -> None:
    streams = [Stream(100.0), Stream(50.0, 0.02), Stream(25.0, 0.01, 5)]
    batch, synchroniser = synchronise(plan("exact", 3, reference="/s0"), streams, 2.0)
    assert (
        np.abs(skews(batch)).max() < ROUNDING
        and (np.diff(batch.stamps) == 40_000_000).all()
        and len(batch.stamps) >= 49
    )
    assert 3 * (len(batch.stamps) - 1) <= synchroniser.dropped <= 3 * len(batch.stamps)


def test_exact_finds_nothing_where_stamps_differ_by_a_nanosecond() -> None:
    batch, _ = synchronise(plan("exact", 2, reference="/s0"), [Stream(100.0), Stream(100.0, phase=1e-9)], 0.5)
    assert len(batch.stamps) == 0


def test_incomplete_instants_go_out_marked_on_request() -> None:
    batch, synchroniser = synchronise(
        plan("exact", 2, reference="/s0", incomplete="mark"), [Stream(100.0), Stream(50.0)], 1.0
    )
    assert len(batch.stamps) == 99 and batch.valid[:, 1].sum() == 50 and batch.valid[:, 0].all()
    assert np.isnan(batch.values[~batch.valid[:, 1], 2]).all() and synchroniser.incomplete == 49


def test_an_approximate_partner_beyond_the_tolerance_drops_the_instant() -> None:
    batch, synchroniser = synchronise(
        plan("approximate", 2, reference="/s0", tolerance=0.004), [Stream(100.0), Stream(50.0)], 1.0
    )
    assert len(batch.stamps) == 50 and synchroniser.dropped == 49


def test_a_source_that_is_late_by_any_time_below_the_delay_is_used() -> None:
    late = [ROBOT, Stream(240.0, 0.2, jitter=0.04, phase=0.0013)]
    batch, synchroniser = synchronise(plan("resample", 2, rate=100.0), late, 2.0)
    assert batch.valid[batch.stamps * 1e-9 < START + 1.7].all() and np.nanmax(np.abs(skews(batch))) < ROUNDING
    assert synchroniser.intakes[1].late == 0


def test_a_source_later_than_the_delay_is_counted_late_and_holds_up_nobody() -> None:
    batch, synchroniser = synchronise(plan("resample", 2, rate=100.0, delay=0.1), [ROBOT, Stream(240.0, 0.3)], 2.0)
    inside = (batch.stamps * 1e-9 > START + 0.4) & (batch.stamps * 1e-9 < START + 1.85)
    assert batch.valid[:, 0].all() and not batch.valid[inside, 1].any() and synchroniser.intakes[1].late > 200


def test_values_held_are_the_last_ones_before_the_instant() -> None:
    held = {"signals": [{"field": "data[time, wave]", "interpolation": "hold"}]}
    batch, _ = synchronise(plan("resample", 2, rate=1000.0, source=held), [ROBOT, MOCAP], 1.0)
    assert (skews(batch) <= ROUNDING).all() and skews(batch)[:, 1].min() > -1 / 240 - ROUNDING
    assert np.abs(batch.age + skews(batch)).max() < ROUNDING


def test_a_gap_is_bridged_up_to_the_length_allowed() -> None:
    gap = Stream(100.0, silent=(0.495, 0.575))
    for allowed, missing in ((0.1, 0), (0.08, 8)):
        batch, _ = synchronise(plan("resample", 2, rate=100.0, source={"max_gap": allowed}), [ROBOT, gap], 1.0)
        assert (~batch.valid[:, 1]).sum() == missing


def test_times_of_today_lose_no_nanosecond() -> None:
    base = 1_790_000_000_123_456_789
    synchroniser = Synchroniser(plan("exact", 2, reference="/s0"), 0.0)
    for index in range(2):
        synchroniser.push(index, np.array([base, base + 1, base + 2 + index], np.int64), np.zeros((3, 2)), 0.0)
    batch = synchroniser.take(1.0)
    assert batch is not None and batch.stamps.tolist() == [base, base + 1]


def test_a_packet_cut_anywhere_gives_the_same_samples() -> None:
    whole = synchronise(plan("resample", 1, rate=700.0), [Stream(2000.0, 0.004, 40)], 1.0)[0]
    cut = synchronise(plan("resample", 1, rate=700.0), [Stream(2000.0, 0.004, 7)], 1.0)[0]
    count = min(len(whole.stamps), len(cut.stamps))
    assert count > 650 and (whole.values[:count] == cut.values[:count]).all()
