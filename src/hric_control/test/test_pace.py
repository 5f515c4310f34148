"""The schedule of a paced simulation: announced in advance, and slower if the loop or another process is late."""

import random

import pytest

from hric_control.sim.pace import CATCH_UP, LEAD, STEP, Pace
from hric_core.robot_time.schedule import NS, Schedule

MS = 1_000_000
PERIOD = 0.001


class Loop:
    """Loop with cycles of 1 ms on a machine that is only calculated.

    Args:
        factor: requested robot time per wall time.
        stalls: (cycle, duration [s]) in which the machine does not let it run.
        limit: as of `Pace`.
    """

    def __init__(self, factor=1.0, stalls=(), limit=None, cost=0):
        self.pace, self.now, self.cycles = Pace(factor), 5 * NS, 0
        self.pace.limit, self.stalls, self.cost = limit, dict(stalls), cost
        self.knots, self.announced = [], []
        self.pace.on_knot = self._on_knot
        self.begun = []

    def _on_knot(self, monotonic, run):
        self.knots.append((monotonic, run))
        self.announced.append((self.now, monotonic))

    @property
    def time(self):
        return self.cycles * PERIOD

    def run(self, cycles, until=None):
        self.pace.due(self.now, self.time)
        for _ in range(cycles):
            self.begun.append((self.now, self.time))
            self.now += self.cost + round(self.stalls.pop(self.cycles, 0.0) * NS)
            self.cycles += 1
            while True:
                due = self.pace.due(self.now, self.time)
                if due is not None and due <= self.now:
                    break
                if until is not None and self.now > until:
                    return self
                self.now = self.now + 2 * MS if due is None else min(due, self.now + 10 * MS)
        return self

    def schedule(self):
        made = Schedule(*self.knots[0])
        for knot in self.knots[1:]:
            made.add(*knot)
        return made


@pytest.mark.parametrize("factor", [0.01, 0.25, 1.0, 4.0])
def test_a_quiet_loop_begins_each_cycle_when_the_pace_wants_it(factor):
    loop = Loop(factor).run(400)
    (first, _), *_ = loop.begun
    for at, run in loop.begun[1:]:
        assert at - first == pytest.approx(run / factor * NS, abs=2)


def test_each_piece_is_announced_before_it_begins():
    loop = Loop().run(2000)
    for (now, end), (_, begin) in zip(loop.announced[2:], loop.announced[1:], strict=False):
        assert now <= begin and end - begin == STEP


def test_a_short_stall_is_made_up_for_and_a_long_one_is_lost():
    short = Loop(stalls=[(100, 0.02)]).run(1000)
    assert short.now - 5 * NS == pytest.approx(1.0 * NS, abs=2 * MS)
    long = Loop(stalls=[(100, 0.5)]).run(1000)
    lost = (long.now - 5 * NS) / NS - 1.0
    assert 0.5 - (LEAD + STEP) / NS <= lost <= 0.5


def test_a_loop_that_is_too_slow_gives_the_pace_and_is_hardly_behind_its_schedule():
    loop = Loop(cost=2 * MS).run(4000)
    schedule = loop.schedule()
    behind = [schedule.robot_time(at) - run for at, run in loop.begun[1000:]]
    assert max(behind) < 1.5 * STEP / NS
    assert loop.time / ((loop.now - 5 * NS) / NS) == pytest.approx(0.5, rel=0.03)


def test_the_schedule_stays_below_the_limit_and_the_loop_with_it():
    limit = 0.35
    loop = Loop(limit=lambda wanted: min(wanted, limit)).run(1000, until=8 * NS)
    assert loop.time <= limit + 2 * PERIOD and loop.knots[-1][1] == pytest.approx(limit)
    assert loop.knots[-1][0] > 7 * NS  # a run that stands says so


def test_a_paused_loop_announces_that_it_stands():
    loop = Loop().run(100)
    reached = loop.knots[-1][1]
    for _ in range(50):
        loop.pace.stand(loop.now, loop.time)
        loop.now += STEP
    assert loop.knots[-1][1] == reached <= loop.time + CATCH_UP
    assert loop.knots[-1][0] >= loop.now
    loop.pace.stand(loop.now, loop.time + 3.0)  # steps of a paused run
    assert loop.knots[-1][1] == loop.time + 3.0


def test_whoever_waits_for_the_knots_gets_one_map_whatever_the_load_and_whenever_they_come():
    dice = random.Random(4)
    loop = Loop(stalls=[(k, dice.expovariate(10.0)) for k in range(50, 3000, 40)]).run(3000)
    emulator, driver, last = Schedule(*loop.knots[0]), Schedule(*loop.knots[0]), 0.0
    knots, later = iter(loop.knots[1:]), iter(loop.knots[1:])
    for _ in range(len(loop.knots) - 1):
        emulator.add(*next(knots))
        sample = dice.uniform(last, emulator.end[1])  # it makes only what was announced
        stamp, last = emulator.monotonic(sample), max(last, sample)
        while driver.end[0] < stamp:  # and the driver waits for what covers the stamp
            driver.add(*next(later))
        assert driver.robot_time(stamp) == pytest.approx(sample, abs=3e-9) or emulator.monotonic(sample) == stamp


def test_a_knot_that_goes_back_is_left_out_and_old_ones_are_forgotten():
    schedule = Schedule(0, 0.0)
    schedule.add(10, 1.0)
    schedule.add(5, 2.0)
    schedule.add(20, 0.5)
    assert schedule.end == (10, 1.0)
    for k in range(5000):
        schedule.add(20 + k, 2.0 + k)
    assert schedule.robot_time(20 + 4000) == 4002.0 and schedule.robot_time(-3) > 0.0
    assert schedule.monotonic(1e9) is None
