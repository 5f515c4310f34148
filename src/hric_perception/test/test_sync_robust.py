"""The synchroniser when sources die, come back, jump in time, or send rubbish."""

import dataclasses

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from time_coded import NS, START, Stream, plan, skews, synchronise

from hric_msgs.msg import SampleChunk
from hric_perception.sync import messages
from hric_perception.sync.core import Synchroniser

ROBOT, MOCAP = Stream(1000.0), Stream(240.0, 0.0055, phase=0.0013)
ROUNDING = 1e-8


def seconds(batch: object) -> np.ndarray:
    return batch.stamps * 1e-9 - START  # type: ignore[attr-defined]


def test_a_source_that_dies_is_named_within_a_second_and_holds_up_nobody() -> None:
    dying = dataclasses.replace(MOCAP, silent=(1.0, np.inf))
    batch, synchroniser = synchronise(plan("resample", 2, rate=100.0), [ROBOT, dying], 3.0)
    assert (np.diff(batch.stamps) == NS // 100).all() and seconds(batch)[-1] > 2.98
    after = seconds(batch) > 0.999
    assert batch.valid[:, 0].all() and batch.valid[~after, 1].all() and not batch.valid[after, 1].any()
    assert np.isnan(batch.values[after, 2:]).all()
    named = [now for now in np.arange(START + 1.0, START + 2.0, 0.05) if "/s1" in synchroniser.starving(now)]
    assert named and named[0] < START + 1.6 and "silent for" in synchroniser.starving(START + 2.9)["/s1"]


def test_a_hiccup_that_is_shorter_than_the_delay_loses_nothing_though_the_source_is_named() -> None:
    synchroniser = Synchroniser(plan("resample", 2, rate=100.0, delay=1.0), 0.0)
    valid, named = [], []
    for part in range(300):
        now, stamps = 0.01 * part, np.array([part * NS // 100])
        synchroniser.push(0, stamps, np.zeros((1, 2)), now)
        if not 100 <= part < 180:
            held = np.arange(100 if part == 180 else part, part + 1) * (NS // 100)
            synchroniser.push(1, held, np.zeros((len(held), 2)), now)
        batch = synchroniser.take(now)
        valid += [] if batch is None else batch.valid.tolist()
        named += synchroniser.starving(now)
    assert len(valid) == 300 and np.all(valid) and "/s1" in named


def test_a_process_that_stood_for_seconds_takes_up_where_it_was_and_leaves_out_no_instant() -> None:
    synchroniser = Synchroniser(plan("resample", 2, rate=100.0, delay=1.0), 0.0)
    stamps, valid = [], []
    for now, begin, end in ((1.0, 0, 1000), (4.5, 1000, 4500), (5.0, 4500, 5000)):
        for index in (0, 1):
            held = np.arange(begin, end) * (NS // 1000)
            synchroniser.push(index, held, np.zeros((len(held), 2)), now + 1e-3 * index)
        while (batch := synchroniser.take(now + 0.01)) is not None:
            stamps += batch.stamps.tolist()
            valid += batch.valid.tolist()
    assert synchroniser.restarts == 0 and len(stamps) == 500
    assert np.all(np.diff(stamps) == NS // 100) and np.all(valid)


def test_a_source_that_comes_back_is_used_again() -> None:
    gone = dataclasses.replace(MOCAP, silent=(0.5, 1.5))
    batch, synchroniser = synchronise(plan("resample", 2, rate=100.0), [ROBOT, gone], 2.5)
    back = seconds(batch) > 1.6
    assert batch.valid[back].all() and np.abs(skews(batch)[back]).max() < ROUNDING
    assert not synchroniser.starving(START + 2.5) and (np.diff(batch.stamps) == NS // 100).all()


def test_a_source_that_never_comes_is_named_and_the_others_begin_without_it() -> None:
    absent = dataclasses.replace(MOCAP, silent=(0.0, np.inf))
    batch, synchroniser = synchronise(plan("resample", 2, rate=100.0), [ROBOT, absent], 2.0)
    assert seconds(batch)[-1] > 1.9 and batch.valid[:, 0].all() and not batch.valid[:, 1].any()
    assert synchroniser.starving(START + 2.0) == {"/s1": "no message yet"}
    assert synchroniser.starving(START + 11.0)["/s1"] == "no message since the start"


def test_a_source_that_is_not_heard_yet_is_waited_for_while_all_nodes_start_and_is_an_error_afterwards() -> None:
    absent = dataclasses.replace(MOCAP, silent=(0.0, np.inf))
    _, synchroniser = synchronise(plan("resample", 2, rate=100.0), [ROBOT, absent], 2.0)

    def told(after: float) -> tuple[int, str]:
        found = messages.status(synchroniser, START + after, ["/s0", "/s1"])
        state = messages.diagnostics(found, synchroniser, None, standing=False)
        return state.level, state.message

    assert told(2.0) == (DiagnosticStatus.WARN, "waiting for sources: /s1: no message yet")
    assert told(2.3)[0] == DiagnosticStatus.WARN
    assert told(11.0)[0] == DiagnosticStatus.ERROR


def test_the_reference_that_dies_is_named_and_no_sample_goes_out() -> None:
    dying = dataclasses.replace(MOCAP, silent=(1.0, np.inf))
    batch, synchroniser = synchronise(plan("approximate", 2, reference="/s1"), [ROBOT, dying], 2.0)
    assert seconds(batch)[-1] < 1.0 and list(synchroniser.starving(START + 2.0)) == ["/s1"]


@pytest.mark.parametrize("jump", [1000.0, -50.0])
def test_a_source_whose_clock_jumps_is_named_and_does_not_take_the_others_along(jump: float) -> None:
    jumping = dataclasses.replace(MOCAP, shift=lambda time: jump if 1.0 <= time < 2.0 else 0.0)
    batch, synchroniser = synchronise(plan("resample", 2, rate=100.0), [ROBOT, jumping], 3.0)
    assert (np.diff(batch.stamps) == NS // 100).all() and batch.valid[:, 0].all() and seconds(batch)[-1] > 2.9
    assert (
        not batch.valid[(seconds(batch) > 1.01) & (seconds(batch) < 1.99), 1].any()
        and batch.valid[seconds(batch) > 2.1].all()
    )
    assert synchroniser.restarts == 0 and synchroniser.intakes[1].refused["stamped by another clock"] >= 239


def test_the_source_that_jumped_is_named_with_the_reason() -> None:
    jumping = dataclasses.replace(MOCAP, shift=lambda time: 1000.0 if time > 1.0 else 0.0)
    _, synchroniser = synchronise(plan("resample", 2, rate=100.0), [ROBOT, jumping], 1.9)
    assert synchroniser.starving(START + 1.9) == {"/s1": "only samples that are stamped by another clock"}


def test_when_all_jump_as_in_a_new_run_the_synchroniser_follows() -> None:
    synchroniser = Synchroniser(plan("resample", 2, rate=100.0), 0.0)
    batches = []
    for begin, arrived in ((500.0, 0.0), (0.5, 2.0)):
        for index in range(2):
            stamps = np.rint((begin + np.arange(100) / 100) * NS).astype(np.int64)
            synchroniser.push(index, stamps, np.zeros((100, 2)), arrived)
        batches.append(synchroniser.take(arrived))
    assert [one.stamps[0] for one in batches if one is not None] == [500 * NS, NS // 2] and synchroniser.restarts == 1


def test_a_pause_of_the_run_makes_no_sample_invalid() -> None:
    synchroniser = Synchroniser(plan("resample", 2, rate=100.0), 0.0)
    valid = []
    for part in range(200):
        arrived = 0.01 * part + (10.0 if part >= 100 else 0.0)
        for index, late in ((0, 0.0), (1, 0.004)):
            synchroniser.push(index, np.array([part * NS // 100]), np.zeros((1, 2)), arrived + late)
            batch = synchroniser.take(arrived + late)
            valid += [] if batch is None else batch.valid.tolist()
    assert len(valid) == 200 and np.all(valid)


@pytest.mark.parametrize("each", [False, True])
def test_samples_out_of_order_and_doubles_are_refused_and_counted(each: bool) -> None:
    synchroniser = Synchroniser(plan("resample", 1, rate=100.0), 0.0)
    for stamps in ([10, 20, 30], [20, 30, 40], [35], [40]):
        synchroniser.push(0, np.array(stamps, np.int64), np.zeros((len(stamps), 2)), 0.0)
        if each:
            synchroniser.take(0.0)
    synchroniser.take(0.0)
    assert synchroniser.intakes[0].buffer.stamps.tolist() == [10, 20, 30, 40]
    assert synchroniser.intakes[0].refused == {"not later than the sample before": 4}


def test_a_stamp_far_off_among_good_ones_that_wait_spoils_none_of_them() -> None:
    synchroniser = Synchroniser(plan("resample", 1, rate=100.0), 0.0)
    for stamp in (1 * NS, 900 * NS, 1 * NS + 10, 1 * NS + 5, 1 * NS + 20):
        synchroniser.push(0, np.array([stamp]), np.zeros((1, 2)), 0.0)
    synchroniser.take(0.0)
    assert synchroniser.intakes[0].buffer.stamps.tolist() == [NS, NS + 10, NS + 20]
    assert synchroniser.intakes[0].refused == {"stamped by another clock": 1, "not later than the sample before": 1}


def test_a_value_that_is_not_finite_spoils_its_own_instants_only() -> None:
    synchroniser = Synchroniser(plan("resample", 1, rate=100.0), 0.0)
    values = np.ones((100, 2))
    values[50, 1] = np.nan
    values[70, 0] = np.inf
    synchroniser.push(0, np.arange(100) * 7_000_000, values, 0.0)
    batch = synchroniser.take(0.0)
    assert batch is not None and (~batch.valid[:, 0]).sum() <= 4 and np.isfinite(batch.values[batch.valid[:, 0]]).all()


def test_a_rate_that_changes_is_followed() -> None:
    synchroniser = Synchroniser(plan("resample", 1, rate=100.0), 0.0)
    for first, rate in ((0.0, 1000.0), (1.0, 250.0)):
        stamps = np.rint((first + np.arange(int(rate)) / rate) * NS).astype(np.int64)
        synchroniser.push(0, stamps, np.column_stack([stamps * 1e-9] * 2), first)
    batch = synchroniser.take(1.0)
    assert batch is not None and batch.valid.all() and np.abs(batch.values[:, 0] - batch.stamps * 1e-9).max() < ROUNDING
    assert synchroniser.intakes[0].rate() == pytest.approx(250.0, rel=0.02)


def test_a_chunk_that_contradicts_itself_is_counted_and_left_out() -> None:
    synchroniser = Synchroniser(plan("resample", 1, rate=100.0), 0.0)
    good = {"channels": ["time", "wave"], "rate": 1000.0, "data": [0.0] * 6}
    for wrong in (
        {"data": [0.0] * 5},
        {"rate": 0.0},
        {"rate": float("nan")},
        {"channels": []},
        {"channels": ["other", "wave"]},
        {},
    ):
        synchroniser.push_message(0, SampleChunk(**{**good, **wrong}), 0.0)
    synchroniser.take(0.0)
    assert (
        synchroniser.intakes[0].refused == {"malformed": 4, "without the requested values": 1}
        and synchroniser.intakes[0].samples == 3
    )


def test_memory_is_bounded_whatever_comes() -> None:
    synchroniser = Synchroniser(plan("resample", 2, rate=100.0, source={"capacity": 64}), 0.0)
    for part in range(50):
        synchroniser.push(0, np.arange(part * 100, part * 100 + 100) * 100, np.zeros((100, 2)), 0.0)
    synchroniser.take(0.0)
    assert synchroniser.intakes[0].buffer.stamps.tolist() == [100 * index for index in range(5000 - 64, 5000)]


def test_drop_outs_at_random_change_no_value_that_is_still_marked_valid() -> None:
    random = np.random.default_rng(7)
    synchroniser = Synchroniser(plan("resample", 1, rate=1000.0, source={"max_gap": 0.01}), 0.0)
    stamps = np.sort(random.choice(np.arange(5000) * 1_000_000, 2500, replace=False))
    synchroniser.push(0, stamps, np.column_stack([stamps * 1e-9] * 2), 0.0)
    while (batch := synchroniser.take(0.0)) is not None:
        good = batch.valid[:, 0]
        assert good.sum() > 0 and np.abs(batch.values[good, 0] - batch.stamps[good] * 1e-9).max() < ROUNDING
