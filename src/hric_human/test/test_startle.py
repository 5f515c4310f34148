"""A hand that a robot startles: when it jerks, how far, and what it does not react to."""

import math
from typing import Any

import numpy as np
import pytest

from hric_core.errors import ParameterError
from hric_human.hand import read_program
from hric_human.hand.startle import expected_speed

HAND = (0.6, 0.0, 0.4)
STARTLED: dict[str, Any] = {"program": "startled", "points": [[0.0, *HAND]], "expected": [[0.1, 0.1], [0.5, 0.5]]}


def way(speed: float, **keys: Any) -> np.ndarray:
    """Positions of the hand every 10 ms, shape (200, 3); an arm comes along x from 0.4 m, up to 0.1 m, at a speed."""
    program = read_program({**STARTLED, **keys}, seed=0)
    found = []
    for k in range(200):
        program.see(0.01 * k, (HAND[0] - max(0.4 - speed * 0.01 * k, 0.1), HAND[1], HAND[2]))
        found.append(program.pose(0.01 * k).position)
    return np.array(found)


@pytest.mark.parametrize(("distance", "speed"), [(0.0, 0.1), (0.1, 0.1), (0.3, 0.3), (0.5, 0.5), (0.6, math.inf)])
def test_expected_speed_is_interpolated_between_rows(distance: float, speed: float) -> None:
    assert expected_speed(STARTLED["expected"], distance) == pytest.approx(speed)


def test_fast_arm_makes_the_hand_jerk_away() -> None:
    assert (way(0.8) - HAND).max(axis=0) == pytest.approx([0.15, 0.0, 0.0], abs=1e-6)


def test_hand_can_jerk_towards_the_arm() -> None:
    assert (way(0.8, towards=True) - HAND).min(axis=0) == pytest.approx([-0.15, 0.0, 0.0], abs=1e-6)


def test_hand_returns_after_the_startle() -> None:
    assert way(0.8)[-1] == pytest.approx(HAND, abs=1e-9)


def test_hand_jerks_only_after_its_latency() -> None:
    moved = np.flatnonzero(np.abs(way(0.8, latency=0.3) - HAND).max(axis=1) > 1e-9)
    assert 0.01 * moved[0] == pytest.approx(0.01 + 0.3, abs=0.021)


def test_expected_speed_startles_nobody() -> None:
    assert way(0.08) == pytest.approx(np.tile(HAND, (200, 1)))


def test_probability_zero_startles_nobody() -> None:
    assert way(0.8, probability=0.0) == pytest.approx(np.tile(HAND, (200, 1)))


def test_phase_says_that_the_hand_is_startled() -> None:
    program = read_program(STARTLED, seed=0)
    for k in range(30):
        program.see(0.01 * k, (0.2 + 0.008 * k, 0.0, 0.4))
    assert [program.phase(time) for time in (0.0, 0.2, 1.3, 1.5)] == ["done", "startled", "startled", "done"]


BAD = {
    "human.expected must have one row or more": {"expected": []},
    "human.expected: the distances must increase": {"expected": [[0.2, 0.1], [0.2, 0.3]]},
    "human.probability is 2; valid: a finite number from 0 to 1": {"probability": 2},
}


@pytest.mark.parametrize(("text", "keys"), BAD.items())
def test_bad_startle_is_refused_by_name(text: str, keys: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=text):
        read_program({**STARTLED, **keys}, seed=0)
