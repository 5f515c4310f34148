"""Sequence numbers and times of samples whose stamps jitter or jump, or that only have arrival times."""

import numpy as np
import pytest
from busy_run import CALM, END, BusyDriver, BusyRun

from hric_perception.chunk import Chunk, Layout, Merger, chunk_message, read_chunk
from hric_perception.sample_clock import SampleClock

RATE = 2000.0
LAYOUT = Layout("test", ("time",), ("s",), RATE)


class Run:
    """Robot time as monotonic time plus an offset, which the test may change."""

    def __init__(self) -> None:
        self.offset = 100.0

    def __call__(self, monotonic: float) -> float:
        return monotonic + self.offset


class Device:
    """Device that sends blocks of samples whose values are their times by its own clock."""

    def __init__(self, latency: float | None = None, block: int = 20, rate: float = RATE) -> None:
        self.run, self.block, self.rate, self.number, self.monotonic = Run(), block, rate, 0, 0.0
        self.clock = SampleClock(LAYOUT, self.run, latency)
        self.chunks: list[Chunk] = []

    def send(self, late: float = 0.0) -> None:
        times = self.monotonic + np.arange(self.number, self.number + self.block) / self.rate
        self.number += self.block
        self.chunks += self.clock.add(float(times[-1]) + late, 100.0 + times[:, None])

    def errors(self, after: float = 0.0) -> np.ndarray:
        """Return assigned minus true times of the samples [s]."""
        return np.concatenate(
            [chunk.times - chunk.data[:, 0] for chunk in self.chunks if chunk.data[0, 0] >= 100.0 + after]
        )


def test_exact_stamps_are_kept_and_a_gap_of_three_samples_is_seen() -> None:
    device = Device()
    for _ in range(50):
        device.send()
    device.number += 3
    for _ in range(50):
        device.send()
    assert np.abs(device.errors()).max() < 1e-7
    assert [chunk.first for chunk in device.chunks[49:52]] == [980, 1003, 1023] and device.clock.lost == 3


def test_jitter_of_the_stamps_is_smoothed() -> None:
    device, random = Device(), np.random.default_rng(1)
    for _ in range(500):
        device.send(2e-3 * float(random.standard_normal()))
    assert np.abs(device.errors(1.0)).max() < 1e-3 and device.errors(1.0).std() < 5e-4
    assert device.clock.lost == 0 and device.clock.jumps == 0


def test_a_gap_among_jitter_counts_once_it_lasts_and_nothing_is_placed_wrongly_meanwhile() -> None:
    device, random = Device(), np.random.default_rng(1)
    for index in range(500):
        if index == 300:
            device.number += 600
        device.send(2e-3 * float(random.standard_normal()))
    assert device.clock.lost == pytest.approx(600, abs=4)
    assert np.abs(device.errors(1.0)).max() < 3e-3
    assert sum(len(chunk.data) for chunk in device.chunks) == 500 * 20


def test_one_late_block_is_no_gap() -> None:
    device, random = Device(), np.random.default_rng(1)
    for index in range(400):
        device.send(0.05 if index == 200 else 2e-3 * float(random.standard_normal()))
    assert device.clock.lost == 0 and np.abs(device.errors(1.0)).max() < 2e-3


def test_a_clock_that_is_set_back_begins_a_new_line_with_numbers_that_go_on() -> None:
    device = Device()
    for index in range(100):
        if index == 50:
            device.run.offset -= 50.0
        device.send()
    errors = device.errors()
    assert np.abs(errors[:1000]).max() < 1e-7 and np.abs(errors[1000:] + 50.0).max() < 1e-7
    assert device.clock.jumps == 1 and device.clock.lost == 0
    assert (np.diff([chunk.first for chunk in device.chunks]) == 20).all()


def test_two_gaps_that_follow_each_other_are_both_placed() -> None:
    device = Device()
    for index in range(100):
        device.number += {40: 100, 42: 50}.get(index, 0)
        device.send()
    assert np.abs(device.errors()).max() < 1e-7 and device.clock.lost == 150


def test_news_of_the_run_that_come_late_make_no_gap() -> None:
    """The run lost 7 ms, which an emulated device knew one block before the pair came here."""
    device = Device()
    for index in range(100):
        if index == 50:
            device.monotonic += 7e-3
        if index == 51:
            device.run.offset -= 7e-3
        before = device.monotonic
        times = device.monotonic + np.arange(device.number, device.number + 20) / RATE
        device.number += 20
        device.chunks += device.clock.add(float(times[-1]), 100.0 + (times - before)[:, None])
    assert np.abs(device.errors()).max() < 1e-7 and device.clock.lost == 0


def test_arrivals_that_come_late_in_bursts_give_times_within_the_shortest_delay() -> None:
    device, random = Device(1e-3, block=27), np.random.default_rng(1)
    stall = 0.0
    for index in range(600):
        stall = 0.4 if index == 400 else max(0.0, stall - 27 / RATE)
        device.send(1e-3 + stall + float(random.exponential(3e-3)))
    assert device.clock.lost == 0 and device.clock.jumps == 0
    assert np.abs(device.errors(1.0)).max() < 2e-3


def test_a_device_whose_rate_is_off_by_a_permille_is_followed() -> None:
    for latency in (None, 0.0):
        device = Device(latency, rate=RATE * 1.001)
        for _ in range(1000):
            device.send()
        assert np.abs(device.errors(3.0)).max() < 1e-4, latency


def test_chunks_are_joined_and_cut_to_the_length_of_a_message_and_end_before_a_missing_sample() -> None:
    joined: list[Chunk] = []
    merger = Merger(0.01, joined.append)
    for first, count in ((0, 7), (7, 7), (14, 8), (22, 5), (40, 5), (45, 70)):
        merger.add(Chunk(LAYOUT, first / RATE, first, np.arange(first, first + count)[:, None] / RATE))
    assert [(chunk.first, len(chunk.data)) for chunk in joined] == [(0, 20), (20, 7), (40, 20), (60, 20), (80, 20)]
    assert all(np.allclose(chunk.times, chunk.data[:, 0]) for chunk in joined)


@pytest.mark.parametrize(("latency", "jitter", "block"), [(None, 0.0, 20), (None, 1e-3, 20), (1e-3, 3e-3, 27)])
@pytest.mark.parametrize("seed", range(3))
def test_on_a_busy_machine_each_sample_is_later_than_the_one_before(
    seed: int, latency: float | None, jitter: float, block: int
) -> None:
    """A device at its own pace beside a run that stalls, loses time, and publishes that late: exact stamps, stamps that
    jitter, arrivals."""
    random, busy = np.random.default_rng(seed), BusyRun(seed, 1.0, load=1.0)
    clock, chunks = SampleClock(LAYOUT, BusyDriver(busy).robot_time, latency), []
    number, arrived = round(0.5 * RATE), 0.0
    while number < (END - 0.2) * RATE:
        number += block
        late = 0.0 if latency is None else latency + float(random.exponential(jitter))
        stamp = (number - 1) / RATE + (late or jitter * float(random.standard_normal()))
        arrived = stamp if latency is None else max(arrived, stamp)
        chunks += clock.add(arrived, np.arange(number - block, number)[:, None] / RATE)
    times, walls = (
        np.concatenate([chunk.times for chunk in chunks]),
        np.concatenate([chunk.data[:, 0] for chunk in chunks]),
    )
    assert len(times) > 50_000 and np.diff(times).min() > 0.0
    errors = np.abs(times - busy.truth(walls))
    assert np.median(errors) < 0.15 and np.percentile(errors[walls > CALM + 4.0], 90) < 10e-3


def test_samples_that_lie_closer_together_are_so_in_messages_and_in_pieces_of_chunks() -> None:
    whole = Chunk(LAYOUT, 1.0, 40, np.arange(8.0)[:, None], pace=2.0)
    joined: list[Chunk] = []
    merger = Merger(0.002, joined.append)
    for chunk in (Chunk(LAYOUT, 0.999, 38, np.zeros((2, 1))), whole, Chunk(LAYOUT, 1.002, 48, np.zeros((2, 1)))):
        merger.add(chunk)
    merger.flush()
    times = np.concatenate([read_chunk(chunk_message(chunk)).times for chunk in joined])
    assert times == pytest.approx([0.999, 0.9995, *(1.0 + np.arange(8) / 4000), 1.002, 1.0025], abs=1e-9)
