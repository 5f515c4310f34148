"""Muscles that move a body: the torque that they produce for a desired one."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from bodies import body
from numpy.testing import assert_allclose

from hric_core.errors import HricError, ParameterError
from hric_human.control import HumanControl, Person
from hric_human.muscles.anatomy import BUILT_IN, load
from hric_human.muscles.drive import MuscleDrive
from hric_human.muscles.muscle_set import STIFFNESS, MuscleSet
from hric_human.muscles.static_optimization import StaticOptimization

CYCLE = 1e-3
Q = [0.7, 0.3, 0.2, 1.3, 0.1, 0.1, 0.0]
REST = [0.0] * 7


def person(parts: str = "right_arm") -> Person:
    return HumanControl(body(parts=parts), {}, 0).person


def drive(one: Person | None = None, strength: float = 1.0, **settings: float) -> MuscleDrive:
    return MuscleDrive(MuscleSet((one or person()).body, load(BUILT_IN), strength), CYCLE, **settings)


def updated(muscles: MuscleDrive, tau: Sequence[float], cycles: int) -> list[float]:
    """Return the torque in the last of several cycles at rest."""
    for _ in range(cycles):
        given = muscles.update(Q, REST, tau)
    return given


def test_a_posture_that_is_held_costs_no_torque_from_the_first_cycle_on() -> None:
    one = person()
    muscles, weight = drive(one), one.own_weight(Q)
    assert_allclose([muscles.update(Q, REST, weight) for _ in range(25)], np.tile(weight, (25, 1)), atol=1e-9)
    assert muscles.activation.min() >= 0.01 and muscles.activation.max() < 0.5


def test_a_new_torque_is_there_at_the_next_decision() -> None:
    one = person()
    muscles, before = drive(one), np.array(one.own_weight(Q))
    updated(muscles, before, 10)
    after = (before + np.eye(7)[3] * 0.5).tolist()
    given = np.array([muscles.update(Q, REST, after)[3] for _ in range(11)]) - before[3]
    assert abs(given[0]) < 1e-9 and (np.diff(given) > 0.0).all()
    assert given[10] == pytest.approx(0.5, rel=0.01)


def test_activation_follows_excitation_by_its_dynamics() -> None:
    one = person()
    muscles, weight = drive(one), one.own_weight(Q)
    updated(muscles, weight, 10)
    muscles.update(Q, REST, [2.0 * value for value in weight])
    a, e = muscles.activation, muscles.excitation
    assert np.abs(e - a).max() > 0.05
    muscles.update(Q, REST, weight)
    speed = [muscles.approach_speed(*pair) for pair in zip(a.tolist(), e.tolist(), strict=True)]
    assert_allclose(muscles.activation, e + (a - e) * np.exp(-CYCLE * np.array(speed)), rtol=1e-12)


def test_the_excitation_reaches_the_aim_at_the_next_decision_with_the_speed_of_now() -> None:
    one = person()
    muscles, weight = drive(one), one.own_weight(Q)
    updated(muscles, weight, 10)
    muscles.update(Q, REST, [1.1 * value for value in weight])
    a, e, state = muscles.activation, muscles.excitation, muscles.state
    assert state is not None
    law = StaticOptimization(len(a), 7)
    aim = law.solve(state.arms, state.gain, 1.1 * np.array(weight) - state.passive @ state.arms).activation
    speed = [muscles.approach_speed(*pair) for pair in zip(a.tolist(), aim.tolist(), strict=True)]
    assert_allclose(e, np.clip(a - (aim - a) / np.expm1(-10 * CYCLE * np.array(speed)), 0.0, 1.0), atol=1e-9)
    assert np.abs(e - a).max() > 0.01


def test_a_torque_that_is_not_finite_is_refused() -> None:
    with pytest.raises(HricError, match="static optimisation: an input is not finite"):
        drive().update(Q, REST, [math.nan] * 7)


def test_what_was_not_foreseen_meets_short_range_stiffness_and_damping() -> None:
    """Stiffness is 75/m times force, damping 0.05 s times stiffness; the forces themselves follow only the curves."""
    one = person()
    muscles, weight = drive(one), one.own_weight(Q)
    updated(muscles, weight, 5)
    moved, speed = np.array(Q), np.zeros(7)
    moved[3] += 0.01
    speed[3] = 0.2
    given = muscles.update(moved.tolist(), speed.tolist(), weight)
    assert muscles.state is not None
    at_decision = muscles.muscles.at(Q, REST)
    own = np.where(muscles.muscles.is_muscle, at_decision.forces(muscles.activation), 0.0)
    stiffness = STIFFNESS * np.einsum("k,ki,kj->ij", own, at_decision.arms, at_decision.arms)
    expected = muscles.state.torque(muscles.activation) - stiffness @ (moved - Q + 0.05 * speed)
    assert stiffness[3, 3] > 5.0
    assert_allclose(given, expected, atol=1e-9)


def test_a_motion_that_goes_on_as_it_was_meets_no_stiffness() -> None:
    one = person()
    muscles, weight, dq = drive(one), one.own_weight(Q), [0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0]
    q = np.array(Q)
    for _ in range(5):
        given = muscles.update(q.tolist(), dq, weight)
        assert muscles.state is not None
        assert_allclose(given, muscles.state.torque(muscles.activation), atol=1e-9)
        q += CYCLE * np.array(dq)


def test_co_contraction_raises_all_muscles_stiffens_the_elbow_and_leaves_the_torque() -> None:
    one = person()
    weight, found = one.own_weight(Q), []
    for co_contraction in (0.0, 0.1):
        muscles = drive(one, co_contraction=co_contraction)
        assert_allclose(updated(muscles, weight, 15), weight, atol=1e-9)
        assert muscles.state is not None
        found.append(muscles.muscles.intrinsic(muscles.state, muscles.activation).stiffness[3, 3])
        assert muscles.activation[np.array(muscles.muscles.is_muscle)].min() >= 0.01 + co_contraction - 1e-9
    assert found[1] > 2.0 * found[0]


def test_more_than_muscles_can_give_is_what_they_give_and_counts_once_while_it_stays() -> None:
    one = person()
    muscles, weight = drive(one, strength=0.2), one.own_weight(Q)
    assert muscles.at_limit == [False] * len(muscles.muscles.names)
    heavy = [*weight[:3], 60.0, *weight[4:]]
    for tau in (heavy, weight, heavy):
        given = updated(muscles, tau, 200)
    full = [name for name, there in zip(muscles.muscles.names, muscles.at_limit, strict=True) if there]
    assert {"right_bic_l", "right_bic_b"} <= set(full)
    assert {count for count, there in zip(muscles.limited, muscles.at_limit, strict=True) if there} == {2}
    assert given[3] < 30.0
    assert_allclose(np.array(heavy) - given, muscles.shortfall, atol=0.02)


def test_joints_without_muscles_get_the_wanted_torque() -> None:
    one = person("upper_body")
    muscles = drive(one)
    tau = (np.array(one.own_weight(one.rest)) + 0.3).tolist()
    given = muscles.update(one.rest, [0.0] * len(tau), tau)
    others = [index for index in range(len(tau)) if index not in muscles.muscles.joints]
    assert len(others) > 3
    assert [given[index] for index in others] == [tau[index] for index in others]


def test_a_restart_gives_what_the_first_start_gave() -> None:
    one = person()
    muscles, weight = drive(one), one.own_weight(Q)
    first = [muscles.update(Q, [0.01 * n] * 7, weight) for n in range(15)]
    muscles.restart()
    assert [muscles.update(Q, [0.01 * n] * 7, weight) for n in range(15)] == first


def test_a_rate_of_no_whole_number_of_cycles_is_named() -> None:
    with pytest.raises(
        ParameterError, match=r"human\.muscles\.rate is 300\.0; valid: a divisor of the cycle rate, 1000 Hz"
    ):
        drive(rate=300.0)
