"""The clock of a simulated robot."""

import os
import signal
import threading
import time

import pytest
from cost_ratio import cost_ratio

from hric_control.sim.sim_loop import SimLoop
from hric_core.errors import HricError

pytestmark = pytest.mark.alone


class Runner:
    """Loop that runs in a thread and whose cycles are recorded."""

    def __init__(self, loop, until=None):
        self.loop, self.until = loop, until
        self.times, self.resets, self.thread_ids = [], [], set()
        self.error = None
        self.thread = threading.Thread(target=self._run, daemon=True)

    def cycle(self, now, period, reset):
        self.times.append(now)
        self.resets.append(reset)
        self.thread_ids.add(threading.get_ident())
        return self.until is None or len(self.times) < self.until

    def _run(self):
        try:
            self.loop.run(self.cycle)
        except Exception as error:
            self.error = error

    def __enter__(self):
        self.thread.start()
        wait(lambda: self.loop.running or self.loop.cycles)
        return self

    def __exit__(self, *_):
        self.loop.stop()
        self.thread.join(30.0)
        assert not self.thread.is_alive()


def wait(condition, timeout=30.0):
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.001)


def test_robot_time_is_a_whole_number_of_cycles_without_drift():
    loop, seen = SimLoop(0.001, 0.0), []
    loop.run(lambda now, period, reset: seen.append((now, period)) or len(seen) < 5001)
    assert seen[0] == (0.0, 0.001)
    assert seen[5000][0] == 5000 * 0.001
    assert (loop.cycles, loop.time) == (5001, 5.001)  # the last one counts


def test_stop_within_a_cycle_lets_that_cycle_finish_and_the_next_run_goes_on_in_time():
    loop, seen = SimLoop(0.001, 0.0), []

    def cycle(now, period, reset):
        seen.append(now)
        if len(seen) % 3 == 0:
            loop.stop()
        return True

    loop.run(cycle)
    assert (loop.cycles, loop.time) == (3, 0.003)
    loop.run(cycle)
    assert seen == [i * 0.001 for i in range(6)]


def test_a_stop_before_run_counts():
    loop = SimLoop(0.001, 0.0)
    loop.stop()
    loop.run(lambda *_: pytest.fail("no cycle should run"))


def test_a_paced_loop_keeps_the_wall_clock_and_a_factor_scales_it():
    for factor in (1.0, 4.0):
        loop, n = SimLoop(0.001, factor), int(300 * factor)
        begin = time.perf_counter()
        runner = Runner(loop, until=n)
        loop.run(runner.cycle)
        nominal = n * 0.001 / factor  # and more where the machine is busy; never less
        assert 0.9 * nominal < time.perf_counter() - begin < 3.0 * nominal
        assert factor / 3.0 < loop.stats.rtf < 1.1 * factor


def test_a_cycle_that_was_late_is_caught_up_and_a_long_stall_is_not():
    loop, stalls = SimLoop(0.001, 1.0), {100: 0.03, 200: 0.25}
    count = 0

    def cycle(now, period, reset):
        nonlocal count
        count += 1
        time.sleep(stalls.get(count, 0.0))
        return count < 500

    begin = time.perf_counter()
    loop.run(cycle)
    spent = time.perf_counter() - begin
    assert (
        0.70 < spent < 1.5
    )  # 0.5 s of cycles and the stall of 0.25 s, which is not made up for by cycles without a pause
    assert loop.stats.slowed >= 1
    assert loop.stats.missed_deadlines >= 20


def test_while_paused_time_stands_and_requests_are_served_in_the_loop():
    loop = SimLoop(0.001, 0.0)
    with Runner(loop) as runner:
        loop.pause()
        before = loop.request(lambda: loop.time)
        assert loop.request(threading.get_ident) == runner.thread.ident
        time.sleep(0.02)
        assert loop.time == before
        loop.unpause()
        wait(lambda: loop.time > before)


def test_step_runs_exactly_the_cycles_asked_for():
    loop = SimLoop(0.001, 1.0)
    loop.pause()
    with Runner(loop) as runner:
        assert loop.step(7) == 0.007
        assert len(runner.times) == 7
        assert loop.step(1) == 0.008
        begin = time.perf_counter()
        loop.step(5000)
        assert time.perf_counter() - begin < 5.0  # not paced
        assert len(runner.times) == 5008


def test_step_is_refused_when_there_is_nothing_to_step():
    loop = SimLoop(0.001, 0.0)
    with pytest.raises(HricError, match="not running"):
        loop.step(1)
    with pytest.raises(HricError, match="at least 1; got 0"):
        loop.step(0)
    with Runner(loop), pytest.raises(HricError, match="not paused"):
        loop.step(1)


def test_stop_ends_a_paused_loop_and_a_step_that_was_not_finished():
    loop, said = SimLoop(0.001, 0.0), []
    loop.pause()
    runner = Runner(loop)

    def slow(now, period, reset):
        time.sleep(0.01)
        return True

    runner.cycle = slow

    def stepper():
        try:
            loop.step(1000)
        except HricError as error:
            said.append(str(error))

    with runner:
        thread = threading.Thread(target=stepper)
        thread.start()
        wait(lambda: loop.cycles > 2)
        begin = time.perf_counter()
        loop.stop()
        runner.thread.join(30.0)
        assert time.perf_counter() - begin < 5.0  # of 10 s
        thread.join(30.0)
    assert len(said) == 1
    assert "of 1000 steps" in said[0]


def test_a_request_runs_between_two_cycles_and_returns_or_raises_to_its_caller():
    loop = SimLoop(0.001, 0.0)
    inside = False

    def cycle(now, period, reset):
        nonlocal inside
        inside = True
        time.sleep(0.0002)
        inside = False
        return True

    runner = Runner(loop)
    runner.cycle = cycle
    with runner:
        assert not any(loop.request(lambda: inside) for _ in range(50))

        def wrong():
            raise HricError("no such model")

        with pytest.raises(HricError, match="no such model"):
            loop.request(wrong)
        assert loop.request(lambda: "still running") == "still running"


def test_a_request_without_a_running_loop_is_done_at_once_by_the_caller():
    assert SimLoop(0.001).request(threading.get_ident) == threading.get_ident()


def test_a_request_from_within_the_loop_is_done_at_once():
    loop, seen = SimLoop(0.001, 0.0), []
    loop.run(lambda *_: seen.append(loop.request(lambda: loop.request(lambda: "done"))) or False)
    assert seen == ["done"]


def test_requests_that_meet_the_end_of_the_loop_are_answered():
    for _ in range(30):
        loop = SimLoop(0.001, 0.0)
        with Runner(loop, until=50):
            answers = [loop.request(lambda i=i: i) for i in range(20)]
        assert answers == list(range(20))


def test_an_error_of_the_cycle_ends_the_run_and_reaches_its_caller():
    loop = SimLoop(0.001, 0.0)

    def cycle(*_):
        raise HricError("the robot is on fire")

    with pytest.raises(HricError, match="on fire"):
        loop.run(cycle)
    assert not loop.running


def test_controllers_are_restarted_in_the_next_cycle_only():
    loop = SimLoop(0.001, 0.0)
    runner = Runner(loop, until=4)
    loop.after_cycle.append(lambda now: loop.restart_controllers() if loop.cycles == 1 else None)
    loop.run(runner.cycle)
    assert runner.resets == [False, False, True, False]


def test_hooks_get_the_time_at_which_the_cycle_measured_and_idle_comes_every_0_1_s_when_not_paced():
    loop, hooked, idle = SimLoop(0.001, 0.0), [], []
    loop.after_cycle.append(hooked.append)
    loop.on_idle = lambda: idle.append(loop.time)
    loop.run(Runner(loop, until=201).cycle)
    assert hooked[:3] == [0.0, 0.001, 0.002]
    assert idle == pytest.approx([0.1, 0.2])


def test_the_factor_is_checked():
    for bad in (-1.0, float("nan"), "fast", True):
        with pytest.raises(HricError, match=r"real_time_factor is .*; valid: a finite number of 0 or more"):
            SimLoop(0.001, bad)
    with pytest.raises(HricError, match="time_step must be above 0"):
        SimLoop(0.0)


@pytest.mark.parametrize("paused", [False, True])
@pytest.mark.parametrize("factor", [0.0, 0.01, 1.0])
def test_a_signal_handler_may_stop_the_loop_of_the_main_thread(factor, paused):
    loop = SimLoop(0.001, factor)
    if paused:
        loop.pause()
    before = signal.signal(signal.SIGUSR1, lambda *_: loop.stop())
    try:
        threading.Timer(0.05, lambda: os.kill(os.getpid(), signal.SIGUSR1)).start()
        loop.run(lambda *_: True)
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_ctrl_c_is_not_swallowed():
    loop = SimLoop(0.001, 1.0)
    threading.Timer(0.05, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            loop.run(lambda *_: True)
    finally:
        signal.signal(signal.SIGINT, before)
    assert not loop.running


def test_the_loop_itself_costs_a_few_calls(figure):
    loop = SimLoop(0.001, 0.0)

    def cycle_until(end):
        return lambda now, period, reset: loop.cycles < end

    def calls():
        cycle = cycle_until(loop.cycles + 100)
        for _ in range(100):
            cycle(0.0, 0.001, False)

    ratio = cost_ratio(lambda: loop.run(cycle_until(loop.cycles + 100)), calls, times=1)
    figure("a cycle of the simulation's loop beside the call in it", ratio, "1")
    assert ratio < 20.0
