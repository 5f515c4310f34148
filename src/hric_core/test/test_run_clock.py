"""Robot time from clock pairs: with late cycles, lost time, pauses and other paces."""

import numpy as np
import pytest

from hric_core.robot_time.clock import HORIZON, NS, RunClock

START = 40_000 * NS
PERIOD = 0.02


class Run:
    """Loop that publishes a clock pair every 20 ms of wall time."""

    def __init__(self, pace: float = 1.0, told: float | None = None, seed: int = 0) -> None:
        self.clock, self.wall, self.time = RunClock(), 0.0, 0.0
        self.pace, self.told = pace, pace if told is None else told
        self._random = np.random.default_rng(seed)

    def go(self, seconds: float, late: float = 0.0) -> None:
        for _ in range(round(seconds / PERIOD)):
            self.wall += PERIOD
            self.time += PERIOD * self.pace
            delay = late + float(self._random.exponential(50e-6))
            self.clock.add(START + round((self.wall + delay) * NS), self.time, self.told)

    def stand(self, seconds: float) -> None:
        pace, self.pace = self.pace, 0.0
        self.go(seconds)
        self.pace = pace

    def ask(self) -> float:
        """Return the clock's present robot time and settle the clock up to it."""
        now = START + round(self.wall * NS)
        self.clock.settle(now)
        told = self.clock.robot_time(now)
        assert told is not None
        return told

    def error(self, ago: float = 0.0) -> float:
        """Error of the clock's robot time at an earlier instant [s]."""
        told = self.clock.robot_time(START + round((self.wall - ago) * NS))
        assert told is not None
        return told - (self.time - ago * self.pace)


@pytest.mark.parametrize("pace", [0.1, 0.5, 1.0, 3.0])
def test_the_time_is_known_at_any_pace_without_the_jitter_of_the_loop(pace: float) -> None:
    run = Run(pace)
    errors = []
    for _ in range(100):
        run.go(0.1)
        errors.append(run.error(0.013))
    assert max(map(abs, errors[10:])) < 30e-6 * pace


def test_a_loop_that_catches_up_does_not_move_the_line() -> None:
    run = Run()
    run.go(2.0)
    for late in (0.06, 0.03, 0.01):
        run.go(PERIOD, late)
        assert abs(run.error()) < 30e-6


def test_time_that_the_loop_has_lost_is_met_within_half_a_second_without_going_back() -> None:
    run, told = Run(), []
    run.go(2.0)
    run.wall += 0.15
    for _ in range(30):
        run.go(PERIOD)
        told.append(run.ask())
    assert min(np.diff(told)) > 0.05 * PERIOD
    assert abs(run.error()) < 3e-3
    run.go(2.0)
    assert abs(run.error()) < 30e-6


def test_a_machine_that_does_not_keep_up_is_followed_at_its_own_pace() -> None:
    run = Run(pace=0.7, told=1.0)
    run.go(3.0)
    for _ in range(20):
        run.go(0.1)
        assert abs(run.error()) < 1e-3


def test_a_paused_run_goes_on_and_what_was_before_stays() -> None:
    run = Run()
    run.go(2.0)
    run.stand(1.0)
    assert run.clock.standing
    assert run.clock.robot_time(START + round((run.wall + 0.3) * NS)) == run.time
    run.go(0.1)
    assert not run.clock.standing
    assert abs(run.error()) < 0.3e-3
    assert run.clock.robot_time(START + round(1.5 * NS)) == pytest.approx(1.5, abs=1e-4)
    assert run.clock.robot_time(START + round(2.5 * NS)) == pytest.approx(2.0, abs=1e-9)


def test_when_a_time_of_the_run_was_is_known_through_a_pause() -> None:
    run = Run(0.5)
    run.go(2.0)
    run.stand(1.0)
    run.go(1.0)
    for time, wall in ((0.75, 1.5), (1.25, 3.5)):
        found = run.clock.monotonic(time)
        assert found is not None and (found - START) / NS == pytest.approx(wall, abs=1e-3)


def test_a_run_that_restarts_begins_a_new_line() -> None:
    run = Run()
    run.go(2.0)
    run.time = 0.0
    run.go(0.1)
    assert abs(run.error()) < 0.3e-3


@pytest.mark.parametrize("pace", [1.0, None])
def test_pairs_that_go_back_a_little_bend_the_line_and_no_time_goes_back(pace: float | None) -> None:
    """This happens with a real arm if a busy machine receives its states late."""
    clock, told = RunClock(), []
    for index in range(400):
        wall = 0.02 * index
        clock.add(START + round(wall * NS), wall + (0.05 if 2.0 < wall < 3.0 else 0.0), pace)
        at = START + round((wall + 0.01) * NS)
        clock.settle(at)
        told.append(clock.robot_time(at))
    assert min(np.diff(np.array(told))) > 0.0
    assert told[-1] == pytest.approx(0.02 * 399 + 0.01, abs=0.3e-3)


def test_a_robot_that_is_gone_leaves_the_time_standing() -> None:
    run = Run()
    run.go(2.0)
    late = [
        run.clock.robot_time(START + round((run.wall + after) * NS))
        for after in (HORIZON, HORIZON + 1.0, HORIZON + 100.0)
    ]
    assert late[1] == late[2] == pytest.approx(late[0], abs=1e-3) == pytest.approx(run.time + HORIZON, abs=1e-3)


def test_nothing_is_known_before_the_first_pair() -> None:
    assert RunClock().robot_time(START) is None and RunClock().monotonic(1.0) is None


def test_a_pair_that_comes_after_a_later_one_is_left_out() -> None:
    run = Run()
    run.go(2.0)
    before = run.clock.robot_time(START + 2 * NS)
    run.clock.add(START + NS, 99.0, 1.0)
    assert run.clock.robot_time(START + 2 * NS) == before


@pytest.mark.parametrize("lost", [0.002, 0.01, 0.04, 0.2])
def test_no_time_comes_twice_where_the_loop_loses_some_and_the_line_is_right_again_soon(lost: float) -> None:
    run = Run()
    run.go(2.0)
    told = []
    for step in range(140):
        run.wall += lost if step == 10 else 0.0
        for part in range(5):  # measurements that come 6 ms late, 4 ms apart, between the pairs
            at = START + round((run.wall - 0.006 + 0.2 * part * PERIOD) * NS)
            run.clock.settle(at)
            told.append(run.clock.robot_time(at))
        run.go(PERIOD)
    assert min(np.diff(np.array(told))) > 0.0
    assert abs(run.error()) < 0.3e-3


def test_who_looks_back_later_finds_the_time_that_was_returned_then() -> None:
    """All processes that receive the pairs within `LEAD` map a time in the same way, also if asked later."""
    run = Run()
    run.go(2.0)
    told, asked = [], []
    for step in range(100):
        run.wall += 0.01 if step % 7 == 3 else 0.0
        run.go(PERIOD)
        asked.append(START + round((run.wall + 0.025) * NS))
        told.append(run.clock.robot_time(asked[-1]))
    assert [run.clock.robot_time(at) for at in asked] == pytest.approx(told, abs=1e-9)


def test_a_robot_that_falls_silent_and_comes_back_gives_the_time_at_once() -> None:
    run = Run()
    run.go(2.0)
    before = run.ask()
    run.wall, run.time = run.wall + 20.0, run.time + 20.0
    run.go(PERIOD)
    assert run.ask() > before and abs(run.error()) < 0.3e-3
