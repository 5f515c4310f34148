"""The programs that move a hand, and how the reactive one answers the robot."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hric_core.errors import HricError
from hric_human.hand import Hand, Program, read_program

SINUSOID = {
    "program": "sinusoid",
    "centre": [0.6, 0.0, 0.4],
    "amplitude": [0.0, 0.1, 0.05],
    "frequency": 0.25,
    "cycles": 1.5,
    "ramp": 1.0,
}
POINTS = {"program": "minimum_jerk", "points": [[0.2, 0.5, 0, 1], [1.2, 0.5, 0.3, 1], [2.5, 0.4, 0.3, 0.8]]}
REACTIVE = {
    "program": "reactive",
    "rest": [0.8, -0.4, 0.3],
    "reaction_delay": 0.25,
    "standoff": 0.12,
    "too_near": 0.05,
    "dwell": 0.5,
    "repeats": 2,
}
ARM = (0.45, 0.0, 0.45)


def program(content: dict[str, Any], seed: int = 0) -> Program:
    return read_program(content, seed)


def path(
    one: Program, end: float, step: float = 1e-3, arm: Callable[[float], tuple[float, float, float]] = lambda time: ARM
) -> np.ndarray:
    """Positions on a grid, shape (n, 3); the arm is seen at 100 Hz."""
    found = []
    for k in range(round(end / step)):
        if k % 10 == 0:
            one.see(k * step, arm(k * step))
        found.append(one.pose(k * step).position)
    return np.array(found)


def test_the_sinusoid_has_its_full_amplitude_from_the_first_swing_on_and_ends_where_it_began() -> None:
    one = program(SINUSOID)
    way = path(one, 8.0)
    assert way.max(axis=0) == pytest.approx([0.6, 0.1, 0.45], abs=1e-6)
    assert way.min(axis=0) == pytest.approx([0.6, -0.1, 0.35], abs=1e-6)
    assert np.argmax(way[:, 1]) * 1e-3 == pytest.approx(1.0 + 0.5, abs=1e-3)  # a quarter of a swing, and half the ramp
    for time in (-1.0, 0.0, 7.0, 9.0):
        assert one.pose(time).position == pytest.approx((0.6, 0.0, 0.4), abs=1e-12)
    assert [one.phase(time) for time in (-1.0, 3.0, 7.0)] == ["rest", "moving", "done"]


def moving_arm(time: float) -> tuple[float, float, float]:
    """Rests, and moves by 5 cm while the hand approaches."""
    return (0.45, 0.05 * min(1.0, max(0.0, time - 1.0)), 0.45)


@pytest.mark.parametrize("content", [SINUSOID, POINTS, REACTIVE], ids=lambda content: content["program"])
def test_a_program_is_continuous_up_to_the_acceleration(content: dict[str, Any]) -> None:
    step = 1e-3
    way = path(program(content), 8.0, step, moving_arm)
    velocity, acceleration = np.diff(way, axis=0) / step, np.diff(way, n=2, axis=0) / step**2
    assert np.abs(velocity).max() > 0.1
    assert np.abs(np.diff(velocity, axis=0)).max() <= np.abs(acceleration).max() * step * 1.001
    jerk = np.abs(np.diff(acceleration, axis=0)) / step
    assert jerk.max() < 200.0  # a step of the acceleration by 0.2 m/s^2 would be one of it
    assert np.abs(acceleration[0]).max() < 0.1 and np.abs(velocity[-1]).max() == 0.0


def test_the_minimum_jerk_hand_rests_at_its_points_and_peaks_between_them() -> None:
    way = path(program(POINTS), 3.0)
    assert (
        way[0] == pytest.approx([0.5, 0, 1])
        and way[1200] == pytest.approx([0.5, 0.3, 1])
        and way[-1] == pytest.approx([0.4, 0.3, 0.8])
    )
    assert np.diff(way[:, 1]).max() / 1e-3 == pytest.approx(1.875 * 0.3 / 1.0, rel=1e-4)  # Flash and Hogan 1985


@pytest.mark.parametrize("content", [POINTS, REACTIVE], ids=lambda content: content["program"])
def test_variation_repeats_with_the_seed_and_differs_between_seeds(content: dict[str, Any]) -> None:
    varied = content | {"variation": {"position": 0.01, "time": 0.1}}
    first, again, other = (path(program(varied, seed), 3.0, 1e-2) for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert 1e-3 < np.abs(first - other).max() < 0.3
    assert np.array_equal(path(program(content, 3), 3.0, 1e-2), path(program(content, 4), 3.0, 1e-2))


def phases(one: Program, end: float, arm: Callable[[float], tuple[float, float, float]]) -> list[tuple[float, str]]:
    found = [(0.0, "")]
    for k in range(round(end / 1e-3)):
        if k % 10 == 0:
            one.see(k * 1e-3, arm(k * 1e-3))
        if (word := one.phase(k * 1e-3)) != found[-1][1]:
            found.append((k * 1e-3, word))
    return found[1:]


def test_the_reactive_hand_takes_over_from_an_arm_at_rest_and_draws_back() -> None:
    told = phases(program(REACTIVE), 12.0, lambda time: ARM)
    assert [word for _, word in told] == [
        "rest",
        *["approach", "pause", "retreat", "rest"],
        *["approach", "pause", "retreat", "done"],
    ]
    assert told[1][0] == pytest.approx(0.5, abs=0.011)
    one = program(REACTIVE)
    way = path(one, 12.0)
    nearest = np.linalg.norm(way - ARM, axis=1).min()
    assert nearest == pytest.approx(0.12, abs=1e-9)
    assert way[0] == pytest.approx(REACTIVE["rest"]) and way[-1] == pytest.approx(REACTIVE["rest"])


def test_it_waits_for_an_arm_that_moves_and_reacts_a_reaction_time_after_its_rest() -> None:
    stop = 2.0
    told = phases(program(REACTIVE), 5.0, lambda time: (0.45, 0.1 * max(0.0, stop - time), 0.45))
    assert told[1][1] == "approach"
    assert stop + 0.25 < told[1][0] < stop + 0.25 + 0.1 + 0.02


def test_it_goes_after_an_arm_that_moves_while_it_approaches() -> None:
    way = path(program(REACTIVE), 2.4, arm=moving_arm)
    arm = np.array(moving_arm(2.4))
    home = np.array(REACTIVE["rest"])
    assert way[-1] == pytest.approx(arm + 0.12 * (home - arm) / np.linalg.norm(home - arm), abs=NEW_GOAL)


NEW_GOAL = 5e-3


def test_it_draws_back_at_once_from_an_arm_that_comes_too_near() -> None:
    def rush(time: float) -> tuple[float, float, float]:
        x, y, z = ARM
        return (x + 0.07 * min(1.0, max(0.0, time - 1.9) / 0.1), y - 0.1 * min(1.0, max(0.0, time - 1.9) / 0.1), z)

    calm = dict((word, time) for time, word in reversed(phases(program(REACTIVE), 4.0, lambda time: ARM)))
    told = dict((word, time) for time, word in reversed(phases(program(REACTIVE), 4.0, rush)))
    assert told["retreat"] < calm["retreat"] - 0.1
    assert told["retreat"] >= 1.9 + 0.25


def test_the_reactive_hand_is_the_same_in_any_order_of_calls() -> None:
    plain, asked = program(REACTIVE), program(REACTIVE)
    for k in range(400):
        time = k * 0.01
        plain.see(time, moving_arm(time))
        asked.see(time, moving_arm(time))
        ahead = asked.pose(time + 0.02)
        assert plain.pose(time) == asked.pose(time)
        assert ahead == asked.pose(time + 0.02)


def test_the_hand_rests_until_it_is_started_and_then_for_begin() -> None:
    hand = Hand(program(SINUSOID), begin=0.5)
    assert {hand(time).position for time in (0.0, 5.0, 100.0)} == {(0.6, 0.0, 0.4)} and hand.phase(100.0) == "rest"
    hand.start(100.0)
    assert hand(100.5).position == (0.6, 0.0, 0.4)
    assert hand(102.0).position == program(SINUSOID).pose(1.5).position
    with pytest.raises(HricError, match="the hand's program has already started at 100"):
        hand.start(101.0)


BAD = {
    "no program 'walk' in human; valid: minimum_jerk, reactive, sinusoid, startled": {"program": "walk"},
    "no parameter 'speed' in human": {"program": "sinusoid", "speed": 1},
    "no parameter 'points' in human": {"program": "sinusoid", "points": []},
    "human.frequency is -1; valid: a finite number above 0 to 10": {"frequency": -1},
    "human.cycles is 1.3; valid: a multiple of 0.5": {"cycles": 1.3},
    "human.ramp is 20.0; valid: at most the duration of all cycles, 12 s": {"ramp": 20},
    r"human.centre is \[0, 'a', 0\]; valid: a list of 3 finite numbers": {"centre": [0, "a", 0]},
    "human.points must have one row or more": {"program": "minimum_jerk"},
    r"human.points\[0\] is \[0, 1\]; valid: a list of 4 or 7 finite numbers": {
        "program": "minimum_jerk",
        "points": [[0, 1]],
    },
    "human.points: the times must increase from row to row": {
        "program": "minimum_jerk",
        "points": [[0, 0, 0, 0], [0, 1, 0, 0]],
    },
    "human.variation.time is 2; valid: a finite number from 0 to 0.3": {
        "program": "minimum_jerk",
        "points": [[0, 0, 0, 0]],
    }
    | {"variation": {"time": 2}},
    "human.repeats is 0; valid: a whole number from 1 to 1000": {"program": "reactive", "repeats": 0},
    "human.too_near is 0.5; valid: a finite number from 0 to standoff, 0.12": {"program": "reactive", "too_near": 0.5},
    "human.rest is nan; valid: a list of 3 finite numbers": {"program": "reactive", "rest": float("nan")},
}


@pytest.mark.parametrize("text", BAD)
def test_a_value_that_cannot_be_is_refused_by_its_full_name_with_what_is_valid(text: str) -> None:
    with pytest.raises(HricError, match=text):
        program(BAD[text])


def test_pairs_of_programs_share_nothing() -> None:
    one, other = program(REACTIVE), program(REACTIVE)
    path(one, 3.0)
    assert other.phase(3.0) == "rest"
    assert all(a != b for a, b in itertools.pairwise(word for _, word in phases(other, 3.0, lambda time: ARM)))
