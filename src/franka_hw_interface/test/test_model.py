"""One suite for every implementation of FrankaModel, against a second rigid-body library. The cases and implementations
stand in conftest.py."""

from dataclasses import replace

import numpy as np
import pytest

from franka_hw_interface.model import FrankaFrame, FrankaModelHandle
from franka_hw_interface.robot_state import RobotState
from hric_core.errors import CommandError

STATES = 1000
with_payload = pytest.mark.parametrize("case", ["payload and own frames, tilted, another arm_id"], indirect=True)
"""Where there is something before that a refusal must leave as it was; what is refused does not depend on how the arm
is mounted."""


def test_mass_coriolis_and_gravity_equal_the_second_library_over_1000_states(model, tolerance, oracle, states) -> None:
    worst = np.zeros(4)
    for q, dq in zip(*states(STATES), strict=True):
        M, c, g = oracle.dynamics(q, dq)
        found = (
            model.mass(q) - M,
            model.coriolis(q, dq) - c,
            model.gravity(q) - g,
            np.array(model.gravity_list(q.tolist())) - g,
        )
        worst = np.maximum(worst, [np.abs(difference).max() for difference in found])
    assert (worst < tolerance).all(), f"mass, Coriolis, gravity, gravity_list differ by {worst}"


def test_poses_and_both_jacobians_of_all_frames_equal_the_second_library_over_1000_states(
    model, tolerance, oracle, states
) -> None:
    worst = dict.fromkeys(FrankaFrame, np.zeros(3))
    for q in states(STATES)[0]:
        for frame, (T, zero, body) in oracle.kinematics(q).items():
            found = (
                model.pose(frame, q) - T,
                model.zero_jacobian(frame, q) - zero,
                model.body_jacobian(frame, q) - body,
            )
            worst[frame] = np.maximum(worst[frame], [np.abs(difference).max() for difference in found])
    assert (np.array(list(worst.values())) < tolerance).all(), f"pose, zero and body Jacobian differ by {worst}"


def test_gravity_takes_another_gravity_vector_in_the_base_frame(model, tolerance, oracle, states) -> None:
    q, other = states(1)[0][0], np.array([1.0, -2.0, 3.0])
    oracle.model.gravity.linear = oracle.world_base.rotation @ other
    g = oracle.dynamics(q, np.zeros(7))[2]
    assert np.abs(model.gravity(q, other) - g).max() < tolerance
    assert np.abs(model.gravity(q, other.tolist()) - g).max() < tolerance
    assert np.abs(model.gravity(q) - g).max() > 1e-3


def test_a_load_replaces_the_one_before_and_zero_takes_it_off(model, states) -> None:
    q = states(1)[0][0]
    model.set_load(0.0, [0, 0, 0], [0] * 9)
    without, revision = model.mass(q), model.revision
    model.set_load(3.0, [0, 0, 0.1], np.eye(3) * 0.01)
    assert model.revision > revision
    heavier = model.mass(q)
    model.set_load(3.0, [0, 0, 0.1], np.eye(3) * 0.01)
    assert np.array_equal(model.mass(q), heavier)
    assert (np.linalg.eigvalsh(heavier - without) > -1e-12).all()
    model.set_load(0.0, [0, 0, 0], [0] * 9)
    assert np.array_equal(model.mass(q), without)


@with_payload
@pytest.mark.parametrize(
    ("mass", "com", "inertia", "said"),
    [
        (-1.0, [0, 0, 0], [0] * 9, "negative"),
        (float("nan"), [0, 0, 0], [0] * 9, "not finite"),
        (1.0, [0, 0], [0] * 9, "2 values; it needs 3"),
        (1.0, [0, 0, float("inf")], [0] * 9, "not finite"),
        (1.0, [0, 0, 0], [0, 1, 0, 0, 0, 0, 0, 0, 0], "not symmetric"),
        (1.0, [0, 0, 0], [-1, 0, 0, 0, 1, 0, 0, 0, 1], "negative principal moment"),
        (500.0, [0, 0, 0], [0] * 9, "exceeds the maximum of 20 kg"),
        (1.0, [0, 0, 100.0], [0] * 9, "exceeds the maximum"),
    ],
)
def test_what_is_no_payload_is_refused_and_the_one_before_stays(model, states, mass, com, inertia, said) -> None:
    q = states(1)[0][0]
    before = model.gravity(q)
    with pytest.raises(CommandError, match=said):
        model.set_load(mass, com, inertia)
    assert np.array_equal(model.gravity(q), before)


@with_payload
def test_frames_that_are_no_poses_are_refused_and_those_before_stay(model, states) -> None:
    q, mirror = states(1)[0][0], np.diag([1.0, 1.0, -1.0, 1.0])
    before = model.pose(FrankaFrame.STIFFNESS, q)
    with pytest.raises(CommandError, match="right-handed"):
        model.set_ee(mirror)
    with pytest.raises(CommandError, match="EE_T_K"):
        model.set_stiffness_frame(np.eye(4) * np.nan)
    assert np.array_equal(model.pose(FrankaFrame.STIFFNESS, q), before)


@with_payload
def test_a_state_of_the_wrong_length_is_refused(model) -> None:
    with pytest.raises(CommandError, match="6 values for 7 joints"):
        model.mass([0.0] * 6)


def test_a_handle_evaluates_another_motion_and_another_payload_and_leaves_the_present_ones(
    model, case, oracle_of, tolerance, states
) -> None:
    positions, velocities = states(3)
    state = RobotState()
    state.q[:], state.dq[:] = positions[0].tolist(), velocities[0].tolist()
    handle = FrankaModelHandle("panda_model", model, state)
    before = handle.mass().copy(), handle.gravity().copy()
    mass, com, inertia = 1.7, (0.02, 0.01, -0.03), np.diag([0.004, 0.006, 0.005])
    heavier = handle.with_load(mass, com, inertia.ravel().tolist())
    present, loaded = oracle_of(case), oracle_of(replace(case, load=(mass, com, inertia)))
    for q, dq in zip(positions[1:], velocities[1:], strict=True):
        M, c, g = loaded.dynamics(q, dq)
        there = heavier.at(q, dq)
        assert np.abs(there.mass() - M).max() < tolerance
        assert np.abs(there.coriolis() - c).max() < tolerance
        assert np.abs(there.gravity() - g).max() < tolerance
        for frame, (T, zero, body) in present.kinematics(q).items():
            elsewhere = handle.at(q)
            assert np.abs(elsewhere.pose(frame) - T).max() < tolerance
            assert np.abs(elsewhere.zero_jacobian(frame) - zero).max() < tolerance
            assert np.abs(elsewhere.body_jacobian(frame) - body).max() < tolerance
    state.tick += 1
    assert np.array_equal(handle.mass(), before[0]) and np.array_equal(handle.gravity(), before[1])
    assert np.abs(heavier.mass() - loaded.dynamics(positions[0], velocities[0])[0]).max() < tolerance


def test_a_handle_refuses_an_impossible_payload_and_keeps_its_own(model, states) -> None:
    state = RobotState()
    state.q[:] = states(1)[0][0].tolist()
    handle = FrankaModelHandle("panda_model", model, state)
    before = handle.mass().copy()
    with pytest.raises(CommandError, match="must not be negative"):
        handle.with_load(-1.0, [0.0] * 3, [0.0] * 9)
    state.tick += 1
    assert np.array_equal(handle.mass(), before)
