"""Stops of spawned models: a spring and a damper computed from the effective inertia of the joint."""

import math

import pytest

from hric_control.plants import StopLaw
from hric_control.plants.stops import STOP_RATE

INERTIA, MASS = 0.21, 2.0
"""Inertia at a revolute joint [kg m^2] and mass at a prismatic one [kg]."""


@pytest.fixture
def law() -> StopLaw:
    law = StopLaw([(-1.0, 0.5), (0.0, 0.1)], lambda: [INERTIA, MASS])
    law.restart([0.0, 0.05])
    return law


def test_within_the_range_nothing_is_added(law: StopLaw) -> None:
    assert law.add([0.5, 0.1], [9.0, 9.0], [1.0, 2.0]) == [1.0, 2.0]


def test_beyond_an_end_the_joint_is_a_critically_damped_oscillator_of_the_inertia_that_it_meets(law: StopLaw) -> None:
    swing, slide = law.add([0.51, -0.002], [0.01, 0.0], [1.0, 0.0])
    assert swing == pytest.approx(1.0 - INERTIA * (STOP_RATE**2 * 0.01 + 2.0 * STOP_RATE * 0.01))
    assert slide == pytest.approx(MASS * STOP_RATE**2 * 0.002)


def test_the_inertia_is_asked_only_while_a_stop_acts() -> None:
    def unwanted() -> list[float]:
        raise AssertionError

    law = StopLaw([(-1.0, 0.5)], unwanted)
    law.restart([0.6])
    assert law.add([0.6], [0.0], [1.0]) == law.add([0.4], [0.0], [1.0]) == [1.0]


def test_a_stop_never_holds_a_joint_that_leaves_it(law: StopLaw) -> None:
    assert law.add([0.5001, 0.05], [-5.0, 0.0], [0.0, 0.0]) == [0.0, 0.0]


def test_a_joint_that_starts_outside_is_free_until_it_has_been_inside(law: StopLaw) -> None:
    law.restart([0.6, 0.05])
    assert law.add([0.6, 0.05], [0.0, 0.0], [0.0, 0.0]) == [0.0, 0.0]
    law.add([0.4, 0.05], [0.0, 0.0], [0.0, 0.0])
    assert law.add([0.6, 0.05], [0.0, 0.0], [0.0, 0.0])[0] < 0.0


def test_held_over_steps_of_a_millisecond_a_blow_on_the_stop_dies_out_without_another_one(law: StopLaw) -> None:
    q, dq, deepest = 0.49, 2.0, 0.0
    for _ in range(200):
        (effort, _) = law.add([q, 0.05], [dq, 0.0], [0.0, 0.0])
        dq += 1e-3 * effort / INERTIA
        q += 1e-3 * dq
        deepest = max(deepest, q - 0.5)
    assert deepest < 2.0 / STOP_RATE and dq <= 0.0 and math.isfinite(q)
