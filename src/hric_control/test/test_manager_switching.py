import threading
import time

import pytest

from hric_control.manager.switching import BEST_EFFORT, STRICT
from hric_core.errors import HricError, ResourceConflictError, UnknownNameError


def test_a_switch_starts_a_loaded_controller(rig) -> None:
    rig.start("left")
    assert rig.states() == {"left": "running"} and rig.made["left"].calls == ["init", "starting"]


def test_a_switch_stops_and_starts_in_one_go_and_the_robot_is_asked_then_told(rig) -> None:
    rig.start("left")
    rig.hw.calls.clear()
    rig.load("both")
    rig.manager.switch(["both"], ["left"])
    assert rig.states() == {"left": "stopped", "both": "running"}
    assert rig.hw.calls == [("prepare_switch", ["both"], ["left"]), ("do_switch", ["both"], ["left"])]


@pytest.mark.parametrize("strictness", [STRICT, BEST_EFFORT])
def test_two_controllers_that_claim_a_joint_do_not_run_together_and_both_are_named(rig, strictness: int) -> None:
    rig.start("left")
    rig.load("both")
    with pytest.raises(ResourceConflictError, match="joint1 is claimed by both left and both"):
        rig.manager.switch(["both"], [], strictness)
    assert rig.states() == {"left": "running", "both": "initialized"}


def test_two_controllers_of_one_request_that_claim_a_joint_are_refused(rig) -> None:
    rig.load("left", "both")
    with pytest.raises(ResourceConflictError, match="joint1 is claimed by both left and both"):
        rig.manager.switch(["left", "both"], [])
    assert rig.states() == {"left": "initialized", "both": "initialized"}


def test_controllers_on_different_joints_and_readers_run_together(rig) -> None:
    rig.start("left", "right", "reader")
    assert set(rig.states().values()) == {"running"}


def test_strict_refuses_an_unknown_name_to_start_with_those_loaded(rig) -> None:
    rig.load("left", "right")
    with pytest.raises(
        UnknownNameError, match=r"no controller 'lift' in the manager, to start \(load it first\); valid: left, right"
    ):
        rig.manager.switch(["right", "lift"], [])
    assert rig.states()["right"] == "initialized"


def test_strict_refuses_an_unknown_name_to_stop(rig) -> None:
    rig.start("left")
    with pytest.raises(UnknownNameError, match="no controller 'lift' in the manager, to stop; valid: left"):
        rig.manager.switch([], ["left", "lift"])
    assert rig.states() == {"left": "running"}


def test_strict_refuses_to_stop_what_is_not_running(rig) -> None:
    rig.load("left")
    with pytest.raises(HricError, match="left cannot be stopped: it is initialized, not running"):
        rig.manager.switch([], ["left"])


def test_strict_refuses_to_start_what_is_running(rig) -> None:
    rig.start("left")
    with pytest.raises(HricError, match="left cannot be started: it is running already"):
        rig.manager.switch(["left"], [])


@pytest.mark.parametrize("strictness", [STRICT, BEST_EFFORT])
def test_a_running_controller_in_both_lists_is_refused(rig, strictness: int) -> None:
    rig.start("left")
    with pytest.raises(HricError, match="left is running and named both to start and to stop"):
        rig.manager.switch(["left"], ["left"], strictness)
    assert rig.made["left"].calls == ["init", "starting"]


def test_a_stopped_controller_in_both_lists_is_refused_when_strict_and_started_at_best_effort(rig) -> None:
    rig.load("left")
    with pytest.raises(HricError, match="left cannot be stopped"):
        rig.manager.switch(["left"], ["left"])
    rig.manager.switch(["left"], ["left"], BEST_EFFORT)
    assert rig.states() == {"left": "running"}


def test_best_effort_leaves_out_what_cannot_be_switched_and_tells_each(rig, caplog: pytest.LogCaptureFixture) -> None:
    rig.load("left", "right")
    rig.manager.switch(["left"], [])
    rig.manager.switch(["left", "lift", "right"], ["reader"], BEST_EFFORT)
    assert rig.states() == {"left": "running", "right": "running"}
    assert all(
        text in caplog.text for text in ("left cannot be started", "no controller 'lift'", "no controller 'reader'")
    )


def test_strictness_0_is_best_effort_with_a_warning_and_others_are_refused(
    rig, caplog: pytest.LogCaptureFixture
) -> None:
    rig.load("left")
    rig.manager.switch(["left", "lift"], [], 0)
    assert rig.states() == {"left": "running"} and "strictness is not set, BEST_EFFORT is used" in caplog.text
    with pytest.raises(HricError, match=r"strictness must be 1 \(BEST_EFFORT\) or 2 \(STRICT\), not 3"):
        rig.manager.switch([], ["left"], 3)


def test_a_name_given_twice_counts_once(rig) -> None:
    rig.load("left")
    rig.manager.switch(["left", "left"], [])
    assert rig.made["left"].calls == ["init", "starting"]


def test_an_empty_switch_is_granted_and_does_not_touch_the_robot(rig) -> None:
    rig.manager.switch([], [])
    assert rig.hw.calls == []


def test_what_the_robot_refuses_to_prepare_is_not_switched(rig) -> None:
    rig.load("left")
    rig.hw.refuse = HricError("effort mode needs the arm unlocked")
    with pytest.raises(HricError, match="effort mode needs the arm unlocked"):
        rig.manager.switch(["left"], [])
    assert rig.states() == {"left": "initialized"}


@pytest.mark.parametrize("timeout", [-1.0, float("nan")])
def test_a_timeout_that_is_no_time_is_refused(rig, timeout: float) -> None:
    with pytest.raises(HricError, match="timeout of a switch must be 0"):
        rig.manager.switch([], [], timeout=timeout)


class Loop:
    """The rig's loop in a thread, as on the live robot."""

    def __init__(self, rig) -> None:
        self._rig, self._end = rig, threading.Event()
        self._thread = threading.Thread(target=self._run)
        rig.manager.loop_running = True

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *args: object) -> None:
        self._end.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._end.wait(0.001):
            self._rig.cycle()


def test_a_switch_beside_the_loop_returns_after_the_loop_has_made_it(rig) -> None:
    rig.load("left")
    with Loop(rig):
        rig.manager.switch(["left"], [])
        assert rig.states() == {"left": "running"}
        rig.manager.switch([], ["left"])
        assert rig.states() == {"left": "stopped"}
    calls = rig.made["left"].calls
    assert calls[:3] == ["init", "starting", "update"] and calls[-1] == "stopping"


def test_a_switch_takes_effect_within_one_cycle(rig) -> None:
    rig.start("left")
    rig.load("both")
    rig.manager.loop_running = True
    order: list[str] = []
    for name in ("left", "both"):
        for what in ("starting", "update", "stopping"):
            original = getattr(rig.made[name], what)
            setattr(rig.made[name], what, lambda *a, o=original, t=f"{name} {what}": (order.append(t), o(*a)))
    rig.manager._loaded["left"].update = rig.made["left"].update
    rig.manager._loaded["both"].update = rig.made["both"].update
    caller = threading.Thread(target=lambda: rig.manager.switch(["both"], ["left"]))
    rig.cycle()
    caller.start()
    while not rig.manager._loop._switching:
        time.sleep(1e-4)
    rig.cycle()
    caller.join()
    assert order == ["left update", "left stopping", "both starting", "both update"]


def test_without_a_loop_a_switch_is_cancelled_in_time_and_not_made_later(rig) -> None:
    rig.load("left")
    rig.manager.loop_running, rig.manager.loop_timeout = True, 0.05
    with pytest.raises(
        HricError,
        match=r"loop is not running \(paused\?\): the switch was cancelled after 0.05 s; nothing was changed",
    ):
        rig.manager.switch(["left"], [])
    rig.cycle(3)
    assert rig.states() == {"left": "initialized"} and rig.made["left"].calls == ["init"]


def test_from_the_loops_own_thread_a_switch_is_made_at_once(rig) -> None:
    rig.load("left")
    rig.cycle()
    rig.manager.loop_running = True
    rig.manager.switch(["left"], [])
    assert rig.states() == {"left": "running"}


def test_a_controller_cannot_switch_from_within_its_update(rig) -> None:
    rig.load("left", "right")
    rig.made["left"].update = lambda time, period: rig.manager.switch(["right"], [])
    rig.manager._loaded["left"].update = rig.made["left"].update
    rig.manager.switch(["left"], [])
    rig.cycle()
    assert rig.states() == {"left": "aborted", "right": "initialized"}


def test_before_a_run_the_state_is_read_before_a_controller_starts(rig) -> None:
    order: list[str] = []
    rig.load("left")
    rig.hw.read = lambda time, period: order.append("read")
    rig.made["left"].starting = lambda time: order.append("starting")
    rig.manager.switch(["left"], [])
    assert order == ["read", "starting"]


def switch_in_thread(rig, **arguments: object) -> tuple[threading.Thread, list[Exception]]:
    errors: list[Exception] = []

    def call() -> None:
        try:
            rig.manager.switch(["left", "right"], [], **arguments)
        except HricError as error:
            errors.append(error)

    rig.manager.loop_running = True
    thread = threading.Thread(target=call)
    thread.start()
    while not rig.manager._loop._switching and thread.is_alive():
        time.sleep(1e-4)
    return thread, errors


def test_controllers_wait_until_the_robot_is_ready(rig) -> None:
    rig.load("left", "right")
    rig.cycle()
    rig.hw.ready = False
    thread, errors = switch_in_thread(rig)
    rig.cycle(3)
    assert rig.states() == {"left": "waiting", "right": "waiting"} and rig.manager.switch_pending and thread.is_alive()
    rig.hw.ready = True
    rig.cycle()
    thread.join(30.0)
    assert rig.states() == {"left": "running", "right": "running"} and errors == []


def test_start_asap_starts_each_controller_as_soon_as_the_robot_is_ready_for_it(rig) -> None:
    rig.load("left", "right")
    rig.cycle()
    rig.hw.switch_done = lambda start: "right" not in [info.name for info in start] or bool(rig.hw.ready)
    rig.hw.ready = False
    thread, _ = switch_in_thread(rig, start_asap=True)
    rig.cycle(2)
    assert rig.states() == {"left": "running", "right": "waiting"}
    rig.hw.ready = True
    rig.cycle()
    thread.join(30.0)
    assert rig.states() == {"left": "running", "right": "running"}


def test_without_start_asap_all_wait_for_the_last(rig) -> None:
    rig.load("left", "right")
    rig.cycle()
    rig.hw.switch_done = lambda start: "right" not in [info.name for info in start] or bool(rig.hw.ready)
    rig.hw.ready = False
    thread, _ = switch_in_thread(rig)
    rig.cycle(2)
    assert rig.states() == {"left": "waiting", "right": "waiting"}
    rig.hw.ready = True
    rig.cycle()
    thread.join(30.0)


def test_a_robot_that_is_not_ready_in_time_aborts_the_start(rig) -> None:
    rig.load("left", "right")
    rig.cycle()
    rig.hw.ready = False
    thread, errors = switch_in_thread(rig, timeout=0.005)
    rig.cycle(10)
    thread.join(30.0)
    assert rig.states() == {"left": "aborted", "right": "aborted"}
    assert "left was not started: the robot was not ready within 0.005 s" in str(errors[0])


def test_a_robot_that_fails_to_switch_aborts_the_start_with_its_reason(rig) -> None:
    rig.load("left", "right")
    rig.cycle()
    rig.hw.ready = HricError("the brakes did not open")
    thread, errors = switch_in_thread(rig)
    rig.cycle()
    thread.join(30.0)
    assert rig.states() == {"left": "aborted", "right": "aborted"} and "the brakes did not open" in str(errors[0])


def test_a_loop_that_stops_while_the_robot_switches_ends_the_wait(rig) -> None:
    rig.load("left", "right")
    rig.cycle()
    rig.hw.ready, rig.manager.loop_timeout = False, 1.0
    thread, errors = switch_in_thread(rig)
    rig.cycle(2)
    thread.join(30.0)
    assert "the control loop stopped while the robot was switching" in str(errors[0])
    rig.hw.ready = True
    rig.cycle(2)
    assert rig.states() == {"left": "aborted", "right": "aborted"}


def test_a_failing_do_switch_is_told_and_nothing_is_started(rig) -> None:
    rig.load("left")

    def fail(start: object, stop: object) -> None:
        raise HricError("no connection")

    rig.hw.do_switch = fail
    with pytest.raises(HricError, match="the robot could not switch: no connection"):
        rig.manager.switch(["left"], [])
    assert rig.states() == {"left": "aborted"}


def test_switch_pending_is_true_for_the_cycle_of_the_switch_only(rig) -> None:
    rig.load("left")
    rig.cycle()
    assert not rig.manager.switch_pending
    rig.manager.loop_running = True
    thread = threading.Thread(target=lambda: rig.manager.switch(["left"], []))
    thread.start()
    while not rig.manager._loop._switching:
        time.sleep(1e-4)
    rig.cycle()
    assert rig.manager.switch_pending
    rig.cycle()
    assert not rig.manager.switch_pending
    thread.join()
