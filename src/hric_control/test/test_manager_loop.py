import contextlib
import signal
import time

import pytest
from cost_ratio import cost_ratio

from hric_control.manager.switching import BEST_EFFORT, SwitchPlan, SwitchRequest
from hric_core.errors import CommandError, HricError


def test_running_controllers_are_updated_every_cycle_in_the_order_of_their_start(rig) -> None:
    order: list[str] = []
    rig.load("left", "right", "reader")
    for name in ("left", "right", "reader"):
        rig.manager._loaded[name].update = lambda time, period, name=name: order.append(name)
    rig.manager.switch(["reader", "left"], [])
    rig.cycle(2)
    assert order == ["reader", "left", "reader", "left"]


def test_a_controller_that_fails_is_aborted_told_once_and_the_others_go_on(
    rig, caplog: pytest.LogCaptureFixture
) -> None:
    rig.fail = {"update": CommandError("command is not finite: joint1=nan")}
    rig.start("left")
    rig.fail = {}
    rig.start("right")
    rig.hw.calls.clear()
    rig.cycle(3)
    assert rig.states() == {"left": "aborted", "right": "running"}
    assert (
        rig.made["left"].calls == ["init", "starting", "update", "stopping"]
        and rig.made["right"].calls.count("update") == 3
    )
    assert caplog.text.count("controller left is aborted, it failed in update: command is not finite: joint1=nan") == 1
    assert rig.hw.calls == [("do_switch", [], ["left"])]
    told = {status.name: status.error for status in rig.manager.list()}
    assert told == {"left": "it failed in update: command is not finite: joint1=nan", "right": ""}


@pytest.mark.parametrize("error", [SystemExit(0), KeyboardInterrupt(), GeneratorExit(), BaseException("odd")])
@pytest.mark.parametrize("where", ["update", "starting", "stopping"])
def test_a_controller_that_would_end_the_process_is_stopped_and_named_and_the_others_go_on(
    error: BaseException, where: str, rig, caplog: pytest.LogCaptureFixture
) -> None:
    rig.fail = {where: error}
    rig.load("left")
    rig.fail = {}
    rig.load("right")
    before = signal.signal(signal.SIGINT, lambda *_: None)  # as commands and nodes do
    try:
        with contextlib.suppress(HricError):
            rig.manager.switch(["left", "right"], [])
        rig.cycle(2)
        rig.manager.switch([], ["left"], BEST_EFFORT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert rig.made["right"].calls.count("update") == 2
    assert f"failed in {where}: {type(error).__name__}" in caplog.text and "controller left" in caplog.text


def test_a_ctrl_c_that_python_itself_delivers_is_not_taken_for_a_controllers_failure(rig) -> None:
    rig.fail = {"update": KeyboardInterrupt()}
    rig.start("left")
    with pytest.raises(KeyboardInterrupt):
        rig.cycle()


def test_a_programming_error_aborts_with_its_place(rig, caplog: pytest.LogCaptureFixture) -> None:
    rig.fail = {"update": IndexError("list index out of range")}
    rig.start("left")
    rig.cycle()
    assert "IndexError: list index out of range (" in caplog.text and "(recorded_calls.py:" in caplog.text


def test_an_aborted_controller_frees_its_joints_and_can_be_started_again(rig) -> None:
    rig.fail = {"update": CommandError("no")}
    rig.start("left")
    rig.cycle()
    rig.fail = {}
    rig.start("both")
    assert rig.states() == {"left": "aborted", "both": "running"}
    rig.manager.switch([], ["both"])
    rig.made["left"].fail = {}
    rig.manager.switch(["left"], [])
    rig.cycle()
    assert rig.states()["left"] == "running"


def test_a_controller_that_fails_in_starting_is_aborted_and_the_caller_hears_why(rig) -> None:
    rig.fail = {"starting": CommandError("outside the workspace")}
    rig.load("left")
    rig.fail = {}
    rig.load("right")
    with pytest.raises(CommandError.__base__, match="left failed in starting: outside the workspace"):
        rig.manager.switch(["left", "right"], [])
    assert rig.states() == {"left": "aborted", "right": "running"}


def test_a_controller_that_fails_in_stopping_is_stopped_all_the_same(rig, caplog: pytest.LogCaptureFixture) -> None:
    rig.fail = {"stopping": ValueError("late")}
    rig.start("left")
    rig.manager.switch([], ["left"])
    assert rig.states() == {"left": "stopped"} and "controller left failed in stopping: ValueError: late" in caplog.text


def test_a_reset_restarts_the_running_controllers_before_their_update(rig) -> None:
    rig.load("right")
    rig.start("left")
    rig.cycle()
    rig.cycle(reset=True)
    assert rig.made["left"].calls == ["init", "starting", "update", "stopping", "starting", "update"]
    assert rig.made["right"].calls == ["init"]


def test_a_controller_that_fails_to_restart_is_aborted(rig) -> None:
    rig.start("left", "right")
    rig.made["left"].fail = {"starting": CommandError("no")}
    rig.cycle(reset=True)
    assert rig.states() == {"left": "aborted", "right": "running"}


def test_statistics_are_those_of_the_updates(rig) -> None:
    rig.load("left", "right")
    rig.manager._loaded["left"].update = lambda t, period: time.sleep(0.002 if t > 0.0025 else 0.0001)
    rig.manager.switch(["left"], [])
    rig.cycle(4)
    left, right = rig.manager.statistics()
    assert (left.updates, left.running, right.updates, right.running) == (4, True, 0, False)
    assert 0.002 <= left.max_time < 0.5 and left.overruns >= 1 and left.last_overrun == pytest.approx(0.003)
    assert 0.0005 < left.mean_time < left.max_time and left.variance_time > 1e-8
    assert right.max_time == 0.0 and right.last_overrun < 0.0


def test_mean_and_variance_are_exact(rig, monkeypatch: pytest.MonkeyPatch) -> None:
    durations = [1e-4, 3e-4, 2e-4, 2e-4]
    instants = iter([value for i, spent in enumerate(durations) for value in (float(i), i + spent)])
    rig.start("left")
    monkeypatch.setattr("hric_control.manager.loop.perf_counter", lambda: next(instants))
    rig.cycle(4)
    statistics = rig.manager.statistics()[0]
    assert statistics.mean_time == pytest.approx(2e-4, rel=1e-9)
    assert statistics.variance_time == pytest.approx(0.5e-8, rel=1e-6)
    assert statistics.max_time == pytest.approx(3e-4, rel=1e-9)


def test_a_restart_of_a_controller_begins_new_statistics(rig) -> None:
    rig.start("left")
    rig.cycle(3)
    rig.manager.switch([], ["left"])
    rig.manager.switch(["left"], [])
    rig.cycle()
    assert rig.manager.statistics()[0].updates == 1


def test_a_tick_comes_once_per_period_of_robot_time(rig) -> None:
    ticks: list[float] = []
    rig.manager.call_periodically(0.01, ticks.append)
    rig.cycle(25)
    rig.manager.call_periodically(0.01, None)
    rig.cycle(25)
    assert ticks == pytest.approx([0.0, 0.01, 0.02])


def test_an_update_with_two_controllers_costs_the_loop_a_few_calls(rig, figure) -> None:
    def nothing(time: float, period: float) -> None: ...

    rig.load("left", "right")
    for name in ("left", "right"):
        rig.manager._loaded[name].update = nothing
    rig.manager.switch(["left", "right"], [])
    rig.cycle()
    ratio = cost_ratio(lambda: rig.manager.update(1.0, 1e-3, False), lambda: (nothing(1.0, 1e-3), nothing(1.0, 1e-3)))
    figure("an update of the manager beside the two calls of its controllers", ratio, "1")
    assert ratio < 20.0


def test_a_request_is_carried_out_or_cancelled_and_never_both(rig) -> None:
    rig.load("left")
    loop, entry = rig.manager._loop, rig.manager._loaded["left"]
    for lock in ("begin", "finish"):
        request = SwitchRequest(SwitchPlan((entry,), (), ()))
        getattr(request, lock).acquire()
        loop.hand_over(request)
        rig.cycle(2)
        assert rig.made["left"].calls == ["init"] and not entry.running
        assert request.done.is_set() == (lock == "finish")


def test_a_controller_aborted_between_the_request_and_the_switch_is_not_stopped_again(rig) -> None:
    rig.fail = {"update": CommandError("no")}
    rig.start("left")
    request = SwitchRequest(SwitchPlan((), (rig.manager._loaded["left"],), ()))
    rig.cycle()
    rig.manager._loop.hand_over(request)
    rig.cycle()
    assert (
        rig.states() == {"left": "aborted"} and rig.made["left"].calls.count("stopping") == 1 and request.done.is_set()
    )
