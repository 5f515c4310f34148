"""The hand through libfranka against an emulated control box in a process of its own."""

import time
from contextlib import contextmanager

import pytest
from fci_peer import control_box, new_address

from franka_hw_interface.hand import HandOutcome
from franka_real.libfranka_hand import LibfrankaHand, connector, hand_of_node
from hric_core.errors import HricError, ParameterError
from hric_core.local.node import LocalNode

LIMIT = 30.0
BOTH = pytest.mark.parametrize("library", ["panda_py", "pylibfranka"])


def wait(condition, limit=LIMIT):
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, "it takes too long"
        time.sleep(0.01)


@contextmanager
def connected(library="panda_py", hand_object=0.0):
    with control_box("--constant", "--console") as (ip, process):
        if hand_object:
            process.stdin.write(f"object {hand_object}\n")
            process.stdin.flush()
        reports = []
        hand = LibfrankaHand(connector(ip, library), reports.append)
        hand.box, hand.reports = process, reports
        try:
            yield hand
        finally:
            hand.close()


def done(motion):
    wait(lambda: motion.outcome is not None)
    return motion.outcome


@BOTH
def test_it_homes_moves_grasps_misses_and_stops(library):
    with connected(library, 0.03) as hand:
        assert (hand.width, hand.max_width) == (0.08, 0.08)
        assert done(hand.move(0.05, 0.1)) is HandOutcome.SUCCESS
        assert hand.width == 0.05
        assert done(hand.grasp(0.03, 0.005, 0.005, 0.1, 20.0)) is HandOutcome.SUCCESS
        assert hand.is_grasped
        assert done(hand.stop()) is HandOutcome.SUCCESS
        wait(lambda: not hand.is_grasped)
        missed = hand.grasp(0.01, 0.005, 0.005, 0.1, 20.0)
        assert done(missed) is HandOutcome.UNSUCCESSFUL
        assert missed.reason
        hand.box.stdin.write("object 0\n")
        hand.box.stdin.flush()
        assert done(hand.homing()) is HandOutcome.SUCCESS


@BOTH
def test_what_the_hand_refuses_fails_with_libfrankas_words(library):
    with connected(library) as hand:
        motion = hand.move(0.5, 0.1)
        assert done(motion) is HandOutcome.FAIL
        assert "failed" in motion.reason


def test_a_stop_aborts_the_motion_that_runs():
    with connected() as hand:
        motion = hand.move(0.0, 0.001)
        wait(lambda: hand.width < 0.0799)
        assert motion.outcome is None
        assert done(hand.stop()) is HandOutcome.SUCCESS
        assert done(motion) is HandOutcome.ABORTED
        assert hand.width > 0.05


def test_a_stop_right_after_a_request_aborts_it_as_well():
    with connected() as hand:
        for _ in range(20):
            motion = hand.move(0.0, 0.001)
            hand.stop()
            assert done(motion) is HandOutcome.ABORTED


def test_a_new_motion_ends_the_one_before():
    with connected() as hand:
        first = hand.move(0.0, 0.001)
        wait(lambda: hand.width < 0.0799)
        second = hand.move(0.03, 0.1)
        assert (done(first), done(second)) == (HandOutcome.ABORTED, HandOutcome.SUCCESS)
        assert hand.width == 0.03


def test_many_requests_at_once_leave_the_last_one_in_force():
    with connected() as hand:
        motions = [hand.move(0.01 * k, 0.1) for k in range(1, 8)]
        assert done(motions[-1]) is HandOutcome.SUCCESS
        assert {done(motion) for motion in motions[:-1]} == {HandOutcome.ABORTED}
        assert hand.width == 0.07


def test_panda_pys_calls_let_other_threads_run_during_a_motion():
    with connected() as hand:
        motion, turns = hand.move(0.0, 0.05), 0
        while motion.outcome is None:
            time.sleep(0.01)
            turns += 1
        assert turns > 20


def test_a_hand_that_goes_away_is_reported_once_and_one_that_comes_back_is_found_again():
    ip = new_address()
    reports = []
    with control_box("--constant", ip=ip):
        hand = LibfrankaHand(connector(ip), reports.append)
    try:
        wait(lambda: reports)
        assert "the hand does not respond" in reports[0]
        assert done(hand.move(0.03, 0.1)) is HandOutcome.FAIL
        with control_box("--constant", ip=ip):
            wait(lambda: len(reports) > 1)
            assert reports[1] == "the hand responds again"
            assert done(hand.move(0.03, 0.1)) is HandOutcome.SUCCESS
    finally:
        hand.close()


def test_an_address_without_a_hand_is_refused_soon_and_by_name():
    address = new_address()
    with pytest.raises(HricError, match=f"{address}.*1338"):
        connector(address)()


def test_an_unknown_library_is_refused_with_the_valid_ones():
    with pytest.raises(ParameterError, match="valid: auto, panda_py, pylibfranka"):
        hand_of_node(LocalNode({"robot_ip": "127.0.0.1", "library": "libfranka"}))
