import math

import pytest

from franka_sim.gripper import Gripper, HandOutcome
from hric_core.errors import CommandError

DT = 0.001


def run(hand, motion=None, seconds=5.0):
    """Step until the motion ends, or for the given time; return the time that passed [s]."""
    for step in range(round(seconds / DT)):
        if motion is not None and motion.outcome is not None:
            return step * DT
        hand.step(DT)
    return seconds


def closed_on(object_width, width=0.03, inner=0.005, outer=0.005, force=20.0):
    hand = Gripper()
    hand.object_width = object_width
    motion = hand.grasp(width, inner, outer, 0.1, force)
    run(hand, motion)
    return hand, motion


def test_it_starts_open_and_holds_nothing():
    hand = Gripper()
    assert (hand.width, hand.max_width, hand.is_grasped, hand.force) == (0.08, 0.08, False, 0.0)


def test_a_move_takes_the_way_over_the_speed():
    hand = Gripper()
    motion = hand.move(0.02, 0.05)
    assert motion.outcome is None
    assert run(hand, motion) == pytest.approx(0.06 / 0.05, abs=1.5 * DT)
    assert (hand.width, motion.outcome, motion.reason) == (0.02, HandOutcome.SUCCESS, "")


def test_a_move_opens_too():
    hand = Gripper()
    run(hand, hand.move(0.0, 0.1))
    motion = hand.move(0.05, 0.1)
    run(hand, motion)
    assert (hand.width, motion.outcome) == (0.05, HandOutcome.SUCCESS)


def test_a_move_to_where_the_fingers_are_succeeds_in_the_next_step():
    hand = Gripper()
    motion = hand.move(0.08, 0.1)
    hand.step(DT)
    assert motion.outcome is HandOutcome.SUCCESS


def test_a_speed_beyond_the_hands_own_is_carried_out_at_that():
    hand = Gripper()
    assert run(hand, hand.move(0.0, 9.0)) == pytest.approx(0.08 / hand.config.max_speed, abs=1.5 * DT)


def test_a_move_stops_at_an_object_and_is_unsuccessful():
    hand = Gripper()
    hand.object_width = 0.03
    motion = hand.move(0.02, 0.1)
    run(hand, motion)
    assert (hand.width, motion.outcome, hand.is_grasped) == (0.03, HandOutcome.UNSUCCESSFUL, False)
    assert "object stopped the fingers at 0.0300 m" in motion.reason


def test_a_move_that_ends_above_an_object_does_not_feel_it():
    hand = Gripper()
    hand.object_width = 0.03
    motion = hand.move(0.031, 0.1)
    run(hand, motion)
    assert motion.outcome is HandOutcome.SUCCESS


def test_a_grasp_of_an_object_of_the_expected_width_holds_it_with_the_force():
    hand, motion = closed_on(0.032)
    assert (hand.width, hand.is_grasped, hand.force, motion.outcome) == (0.032, True, 20.0, HandOutcome.SUCCESS)


@pytest.mark.parametrize(
    ("object_width", "hit"), [(0.0249, False), (0.0251, True), (0.0349, True), (0.0351, False), (None, False)]
)
def test_a_grasp_hits_between_its_tolerances(object_width, hit):
    hand, motion = closed_on(object_width)
    assert hand.is_grasped is hit
    assert motion.outcome is (HandOutcome.SUCCESS if hit else HandOutcome.UNSUCCESSFUL)
    assert bool(motion.reason) is not hit


def test_a_missed_grasp_leaves_no_force():
    assert closed_on(None)[0].force == 0.0


def test_a_grasp_with_a_wide_inner_tolerance_succeeds_on_nothing():
    hand, motion = closed_on(None, inner=0.04)
    assert (hand.width, motion.outcome) == (0.0, HandOutcome.SUCCESS)


def test_a_grasp_of_something_wider_than_the_opening_travels_outwards():
    hand = Gripper()
    run(hand, hand.move(0.01, 0.1))
    motion = hand.grasp(0.078, 0.005, 0.005, 0.1, 10.0)
    run(hand, motion)
    assert (hand.width, motion.outcome) == (0.08, HandOutcome.SUCCESS)


def test_an_object_that_is_taken_away_is_no_longer_grasped_and_the_fingers_close():
    hand, _ = closed_on(0.03)
    hand.object_width = None
    run(hand, seconds=0.01)
    assert hand.is_grasped
    run(hand, seconds=1.0)
    assert (hand.is_grasped, hand.width) == (False, 0.0)


def test_an_object_that_is_held_stays_held():
    hand, _ = closed_on(0.03)
    run(hand, seconds=1.0)
    assert (hand.is_grasped, hand.width) == (True, 0.03)


def test_homing_closes_and_opens_fully():
    hand = Gripper()
    run(hand, hand.move(0.04, 0.1))
    motion, narrowest = hand.homing(), 1.0
    while motion.outcome is None:
        hand.step(DT)
        narrowest = min(narrowest, hand.width)
    assert (narrowest, hand.width, motion.outcome) == (0.0, 0.08, HandOutcome.SUCCESS)


def test_homing_on_an_object_is_unsuccessful():
    hand = Gripper()
    hand.object_width = 0.03
    motion = hand.homing()
    run(hand, motion)
    assert (hand.width, motion.outcome) == (0.03, HandOutcome.UNSUCCESSFUL)


def test_a_stop_aborts_what_runs_and_the_fingers_stand():
    hand = Gripper()
    motion = hand.move(0.0, 0.1)
    run(hand, seconds=0.1)
    width, stop = hand.width, hand.stop()
    run(hand, seconds=0.5)
    assert (motion.outcome, stop.outcome, hand.width) == (HandOutcome.ABORTED, HandOutcome.SUCCESS, width)
    assert "stop" in motion.reason


def test_a_stop_lets_go():
    hand, _ = closed_on(0.03)
    hand.stop()
    assert (hand.is_grasped, hand.force) == (False, 0.0)


def test_a_stop_with_nothing_to_stop_succeeds():
    assert Gripper().stop().outcome is HandOutcome.SUCCESS


def test_a_second_request_aborts_the_first():
    hand = Gripper()
    first = hand.move(0.0, 0.1)
    run(hand, seconds=0.1)
    second = hand.move(0.08, 0.1)
    assert (first.outcome, second.outcome) == (HandOutcome.ABORTED, None)
    run(hand, second)
    assert (hand.width, second.outcome) == (0.08, HandOutcome.SUCCESS)


@pytest.mark.parametrize(
    ("request_it", "words"),
    [
        (lambda hand: hand.move(0.081, 0.1), "width 0.081 m; valid: 0 to 0.08 m"),
        (lambda hand: hand.move(-0.01, 0.1), "width -0.01"),
        (lambda hand: hand.move(math.nan, 0.1), "width nan"),
        (lambda hand: hand.move(0.01, 0.0), "speed 0.0 m/s; valid: above 0"),
        (lambda hand: hand.move(0.01, math.nan), "speed nan"),
        (lambda hand: hand.move(0.01, math.inf), "speed inf"),
        (lambda hand: hand.grasp(0.01, math.nan, 0.0, 0.1, 1.0), "tolerances nan"),
        (lambda hand: hand.grasp(0.01, 0.0, -1.0, 0.1, 1.0), "tolerances 0.0 and -1.0"),
        (lambda hand: hand.grasp(0.01, 0.0, 0.0, 0.1, math.nan), "force nan"),
        (lambda hand: hand.grasp(0.01, 0.0, 0.0, 0.1, 141.0), "force 141.0 N; valid: 0 to 140 N"),
    ],
)
def test_a_wrong_request_fails_with_its_reason_and_what_runs_goes_on(request_it, words):
    hand = Gripper()
    running = hand.move(0.04, 0.1)
    motion = request_it(hand)
    assert motion.outcome is HandOutcome.FAIL
    assert words in motion.reason
    run(hand, running)
    assert (hand.width, running.outcome) == (0.04, HandOutcome.SUCCESS)


@pytest.mark.parametrize("width", [0.0, -0.01, 0.081, math.nan])
def test_an_object_that_does_not_fit_is_refused(width):
    with pytest.raises(CommandError, match="does not fit"):
        Gripper().object_width = width


def test_a_grasp_with_no_tolerance_at_all_misses_even_the_expected_width():
    assert closed_on(0.03, inner=0.0, outer=0.0)[1].outcome is HandOutcome.UNSUCCESSFUL
