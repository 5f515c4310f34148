"""The load of muscles after a run: closed forms, and inverse dynamics by other code."""

import numpy as np
import pytest
from bodies import body
from numpy.testing import assert_allclose

from hric_core.errors import HricError
from hric_core.geometry import Pose
from hric_human.body import Body
from hric_human.control.kinematics import HandChain, own_weight
from hric_human.control.strength import strength
from hric_human.control.whole_body import ExternalLoad
from hric_human.muscles.after_run import AfterRun, RecordedMotion, smoothed
from hric_human.muscles.anatomy import BUILT_IN, load
from hric_human.muscles.muscle_set import MuscleSet
from hric_human.muscles.static_optimization import StaticOptimization

TIME = np.arange(0.0, 4.0, 0.005)
ROOT = Pose((0.3, -0.1, 1.2))
HELD = [0.7, 0.3, 0.2, 1.3, 0.1, 0.1, 0.0]


def after(one: Body) -> AfterRun:
    anatomy = load(BUILT_IN)
    return AfterRun(one, MuscleSet(one, anatomy), anatomy, ROOT)


def held(q: list[float], instants: int = 5) -> RecordedMotion:
    """A posture that does not change."""
    rows = np.tile(q, (instants, 1))
    return RecordedMotion(0.01 * np.arange(instants), rows, np.zeros(rows.shape), np.zeros(rows.shape))


def test_a_smooth_motion_has_the_derivatives_of_its_formula() -> None:
    phase = np.pi * TIME[:, None] + np.array([0.0, 0.4, 0.8])
    motion = smoothed(TIME, 0.5 * np.sin(phase), rate=100.0)
    inside = (motion.time > 0.3) & (motion.time < 3.6)
    now = np.pi * motion.time[inside, None] + np.array([0.0, 0.4, 0.8])
    assert np.diff(motion.time) == pytest.approx(0.01)
    assert_allclose(motion.q[inside], 0.5 * np.sin(now), atol=1e-3)
    assert_allclose(motion.dq[inside], 0.5 * np.pi * np.cos(now), atol=3e-3)
    assert_allclose(motion.ddq[inside], -0.5 * np.pi**2 * np.sin(now), atol=1e-2)


def test_what_is_faster_than_the_cutoff_is_noise() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.002, (len(TIME), 1))
    slow = 0.5 * np.sin(np.pi * TIME[:, None])
    rough, smooth = smoothed(TIME, slow + noise, None), smoothed(TIME, slow + noise)
    inside = (rough.time > 0.3) & (rough.time < 3.6)
    expected = -0.5 * np.pi**2 * np.sin(np.pi * rough.time[inside])
    errors = [np.sqrt(np.mean((motion.ddq[inside, 0] - expected) ** 2)) for motion in (rough, smooth)]
    assert errors[1] < 1e-2 * errors[0]


def test_a_held_posture_needs_the_torque_of_its_own_weight() -> None:
    one = body(parts="right_arm")
    found = after(one).of(held(HELD))
    assert found.joints == tuple(one.joints)
    assert_allclose(found.torque, np.tile(own_weight(one)(HELD), (5, 1)), atol=1e-9)


def test_activations_of_a_held_posture_are_those_of_its_torque() -> None:
    one = body(parts="right_arm")
    muscles = MuscleSet(one, load(BUILT_IN))
    state, torque = muscles.at(HELD, [0.0] * 7), np.array(own_weight(one)(HELD))
    solver = StaticOptimization(len(muscles.names), 7)
    expected = solver.solve(state.arms, state.gain, torque - state.passive @ state.arms)
    found = after(one).of(held(HELD))
    assert_allclose(found.activation, np.tile(expected.activation, (5, 1)), atol=1e-9)
    assert not found.shortfall.any() and not found.outside["right"].any()


def test_the_forces_of_muscles_give_the_torque_of_a_motion_with_a_load() -> None:
    one = body(parts="right_arm")
    q = np.array(HELD) + 0.2 * np.sin(2.0 * TIME[:, None] + np.arange(7))
    motion = smoothed(TIME, q)
    point = np.array([HandChain(one, "right").pose(row).position for row in motion.q]) + ROOT.position
    n = len(motion.time)
    found = after(one).of(
        motion, [ExternalLoad("r_wrist", np.tile([5.0, -3.0, -10.0], (n, 1)), np.zeros((n, 3)), point)]
    )
    muscles = MuscleSet(one, load(BUILT_IN))
    for t in range(0, n, 10):
        arms = muscles.at(motion.q[t].tolist(), motion.dq[t].tolist()).arms
        assert_allclose(arms.T @ found.force[t], found.torque[t] - found.shortfall[t], atol=1e-8)
    weakest, strongest = np.array(strength(one))
    assert_allclose(found.share, np.maximum(found.torque / strongest, found.torque / weakest))


def test_a_weight_in_the_hand_needs_the_torque_of_the_jacobian() -> None:
    one = body(parts="right_arm")
    hand, weight = HandChain(one, "right"), np.array([0.0, 0.0, -20.0])
    point = np.array(hand.pose(HELD).position) + ROOT.position
    carried = ExternalLoad("r_wrist", np.tile(weight, (5, 1)), np.zeros((5, 3)), np.tile(point, (5, 1)))
    found, without = after(one).of(held(HELD), [carried]), after(one).of(held(HELD))
    posed = hand.posed(HELD)
    J = np.array(posed.velocities(posed.point(hand.p_link_hand))).T
    assert_allclose(found.torque[0] - without.torque[0], -J.T @ weight, atol=1e-9)
    assert found.activation[0].max() > without.activation[0].max()
    for joint in ("right_shoulder", "right_elbow"):
        assert np.linalg.norm(found.contact[joint][0]) > np.linalg.norm(without.contact[joint][0])


def test_both_arms_have_the_same_load_in_mirrored_postures() -> None:
    found = after(body(parts="both_arms")).of(held(2 * HELD))
    right, left = np.split(found.activation[0], 2)
    assert_allclose(right, left, atol=1e-9)
    assert_allclose(found.contact["left_elbow"] * [1.0, -1.0, 1.0], found.contact["right_elbow"], atol=1e-6)


def test_an_arm_beyond_the_range_of_muscle_paths_is_flagged_and_the_other_is_not() -> None:
    straight = [*HELD[:3], 0.0, *HELD[4:]]
    found = after(body(parts="both_arms")).of(held(HELD + straight))
    assert not found.outside["right"].any() and found.outside["left"].all()
    assert found.known("right_bic_l").all() and not found.known("left_elbow").any()


def test_what_is_no_motion_is_refused() -> None:
    with pytest.raises(HricError, match="a motion of 5 samples cannot be smoothed; valid: 20 samples or more"):
        smoothed(TIME[:5], np.zeros((5, 7)))
    with pytest.raises(
        HricError, match=r"filter is 200.0 Hz; valid: above 0, below half of the sample rate of 200.0 Hz"
    ):
        smoothed(TIME, np.zeros((len(TIME), 7)), 200.0)
