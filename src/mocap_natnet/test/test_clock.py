"""Clocks of server, client and run, compared with true times."""

import numpy as np
import pytest

from hric_core.robot_time.clock import RunClock
from mocap_natnet.client.frame_clock import NS, EchoClock, ExposureClock, RunningMinimum
from mocap_natnet.codec.types import Frame, Suffix

FREQUENCY = 3_312_787
START = 123_456 * NS


def echoes(clock: EchoClock, begin: float, end: float, drift: float, epoch: float = 900.0, busy: float = 0.2) -> None:
    """Add ten echoes per second, some of them slow in one direction."""
    random = np.random.default_rng(round(1e3 * begin))
    for t in np.arange(begin, end, 0.1):
        there, back = 30e-6 + random.exponential([5e-6, 5e-6])
        if random.random() < busy:
            there += random.exponential(5e-3)
        ticks = round((epoch + (t + there) * (1 + drift)) * FREQUENCY)
        clock.add(START + round(t * NS), START + round((t + there + back) * NS), ticks)


def ticks_at(t: float, drift: float, epoch: float = 900.0) -> int:
    return round((epoch + t * (1 + drift)) * FREQUENCY)


@pytest.mark.parametrize("drift", [0.0, 50e-6, -50e-6, 200e-6])
def test_ticks_become_local_times_within_20_us_after_the_window_is_full(drift: float) -> None:
    clock = EchoClock(FREQUENCY)
    echoes(clock, 0.0, 60.0, drift)
    errors = [clock.local(ticks_at(t, drift)) / NS - START / NS - t for t in (58.0, 60.0, 60.2)]
    assert max(map(abs, errors)) < 20e-6
    assert clock.drift == pytest.approx(1e6 * drift, abs=1.0)


def test_the_first_second_is_within_a_tenth_of_a_millisecond() -> None:
    clock = EchoClock(FREQUENCY)
    assert not clock.synchronised and clock.local(5) is None
    for end in (0.3, 0.6, 1.0):
        echoes(clock, end - 0.3, end, 50e-6, busy=0.0)
        assert clock.local(ticks_at(end, 50e-6)) == pytest.approx(START + end * NS, abs=0.1e-3 * NS)


def test_another_clock_is_noticed_after_three_echoes() -> None:
    clock = EchoClock(FREQUENCY)
    echoes(clock, 0.0, 10.0, 0.0)
    echoes(clock, 10.0, 11.0, 0.0, epoch=17.0, busy=0.0)
    assert clock.restarts == 1
    assert clock.local(ticks_at(11.0, 0.0, 17.0)) == pytest.approx(START + 11.0 * NS, abs=0.1e-3 * NS)


def test_a_single_wrong_echo_changes_nothing() -> None:
    clock = EchoClock(FREQUENCY)
    echoes(clock, 0.0, 10.0, 0.0)
    before = clock.local(ticks_at(10.0, 0.0))
    clock.add(START + 10 * NS, START + 10 * NS + 50_000, 2**63)
    clock.add(START + 10 * NS, START + 9 * NS, 5)
    assert clock.local(ticks_at(10.0, 0.0)) == before and clock.restarts == 0


def test_an_exposure_in_the_future_or_far_in_the_past_does_not_count() -> None:
    clock = ExposureClock(0.0055)
    clock.restart(FREQUENCY)
    assert clock.echo is not None
    echoes(clock.echo, 0.0, 5.0, 0.0)
    now = START + 5 * NS
    for t, means in ((4.99, "mid-exposure"), (-6.0, "reception"), (5.5, "reception")):
        exposed, told = clock.exposed(Frame(1, suffix=Suffix(mid_exposure=ticks_at(t, 0.0), transmitted=1)), now)
        assert told == means
        assert exposed == pytest.approx(START + 4.99 * NS if means == "mid-exposure" else now - 5_500_000, abs=1e5)


def test_a_frame_that_a_stalled_machine_delivers_late_keeps_its_exposure() -> None:
    clock = ExposureClock(0.0055)
    clock.restart(FREQUENCY)
    assert clock.echo is not None
    echoes(clock.echo, 0.0, 5.0, 0.0)
    for t in np.arange(3.0, 4.995, 0.01):  # two seconds of frames at once
        exposed, means = clock.exposed(Frame(1, suffix=Suffix(mid_exposure=ticks_at(t, 0.0))), START + 5 * NS)
        assert means == "mid-exposure" and exposed == pytest.approx(START + t * NS, abs=1e5)


def test_the_running_minimum_is_that_of_the_window() -> None:
    random, minimum, seen = np.random.default_rng(0), RunningMinimum(), []
    for index, value in enumerate(random.random(3000).tolist()):
        seen.append((index * 0.02, value))
        assert minimum.add(index * 0.02, value) == min(v for t, v in seen[-600:] if t >= index * 0.02 - 10.0)


def test_the_time_of_the_run_is_read_from_a_line_through_late_ticks() -> None:
    random, clock = np.random.default_rng(0), RunClock()
    assert clock.robot_time(START) is None
    for index in range(500):
        clock.add(START + round((index * 0.02 + random.exponential(20e-6)) * NS), 7.0 + 0.5 * index * 0.01 * 2)
    assert clock.robot_time(START + round(9.985 * NS)) == pytest.approx(7.0 + 0.5 * 9.985, abs=2e-5)


def test_a_run_that_jumps_back_begins_a_new_line() -> None:
    clock = RunClock()
    for index in range(100):
        clock.add(START + index * 10_000_000, 50.0 + index * 0.01)
    clock.add(START + NS, 0.0)
    assert clock.robot_time(START + NS + 5_000_000) == pytest.approx(0.005)


# -- time stamps that cannot be ----------------------------------------------------------------------------------------


def stamped(clock: ExposureClock, t: float, stamp: float) -> tuple[float, str]:
    """Return (time of the exposure [s], method) of a frame that arrives at t [s]."""
    exposed, means = clock.exposed(Frame(1, suffix=Suffix(time_stamp=stamp)), START + round(t * NS))
    return (exposed - START) / NS, means


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf"), 1e300, 1e6, -5.0])
def test_a_time_stamp_that_cannot_be_is_that_of_its_arrival_and_spoils_no_other(wrong: float) -> None:
    clock = ExposureClock(0.005)
    for t in np.arange(0.0, 1.0, 0.01):
        stamped(clock, t, 40.0 + t)
    assert stamped(clock, 1.0, wrong) == (pytest.approx(0.995), "reception")
    assert stamped(clock, 1.01, 41.01) == (pytest.approx(1.005), "time stamp")


def test_time_stamps_of_another_clock_count_from_the_third_on() -> None:
    clock = ExposureClock(0.005)
    for t in np.arange(0.0, 1.0, 0.01):
        stamped(clock, t, 40.0 + t)
    assert [stamped(clock, t, 7.0 + t)[1] for t in (1.0, 1.01, 1.02, 1.03)] == [
        "reception",
        "reception",
        "time stamp",
        "time stamp",
    ]
    assert stamped(clock, 1.04, 8.04)[0] == pytest.approx(1.035)
