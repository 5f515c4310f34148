"""Cartesian motion generators: the motion that they command, and the errors that they report; checked by pinocchio."""

from typing import Any

import numpy as np
import pinocchio
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import RobotState
from franka_sim.box.kinematics import moved, twist_between
from franka_sim.box.motion import MotionGenerator, make_generator
from franka_sim.box.requests import GeneratorMode, MotionCommand

READY = [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]
REST, STILL = [0.0] * 7, [0.0] * 6
LIMITS = franka_limits()
DT = 0.001
POSE, TWIST = GeneratorMode.CARTESIAN_POSITION, GeneratorMode.CARTESIAN_VELOCITY

START_INVALID = "cartesian_position_motion_generator_start_pose_invalid"
INVALID_FRAME = "cartesian_position_motion_generator_invalid_frame"
TOO_FAST = "cartesian_motion_generator_velocity_limits_violation"
VELOCITY_JUMP = "cartesian_motion_generator_velocity_discontinuity"
ACCELERATION_JUMP = "cartesian_motion_generator_acceleration_discontinuity"
ELBOW_LIMIT = "cartesian_motion_generator_elbow_limit_violation"
ELBOW_SIGN = "cartesian_motion_generator_elbow_sign_inconsistent"
ELBOW_START = "cartesian_motion_generator_start_elbow_invalid"
START_SIGN = "start_elbow_sign_inconsistent"
JOINT_RANGE = "cartesian_motion_generator_joint_position_limits_violation"
JOINT_FAST = "cartesian_motion_generator_joint_velocity_limits_violation"
JOINT_JUMP = "cartesian_motion_generator_joint_velocity_discontinuity"


@pytest.fixture(scope="module")
def model() -> KdlFrankaModel:
    return KdlFrankaModel(panda_description.load(meshes=False, collision=False), "panda")


def started(kind: GeneratorMode, model: KdlFrankaModel, q: list[float] = READY) -> tuple[MotionGenerator, RobotState]:
    generator, state = make_generator(kind, model, LIMITS), RobotState()
    state.q_d[:] = q
    assert generator.start(state) == frozenset()
    return generator, state


def command(**fields: Any) -> MotionCommand:
    return MotionCommand(
        **({"q": REST, "dq": REST, "O_T_EE": [0.0] * 16, "O_dP_EE": STILL, "elbow": None, "tau": REST} | fields)
    )


def only(index: int, value: float, base: list[float] = STILL) -> list[float]:
    return [x + value if i == index else x for i, x in enumerate(base)]


def swing(t: float, duration: float) -> float:
    """From 0 to 1 with zero velocity, acceleration and jerk at both ends."""
    s = min(t / duration, 1.0)
    return s**4 * (35.0 - 84.0 * s + 70.0 * s * s - 20.0 * s**3)


def run(generator: MotionGenerator, twist: list[float], duration: float = 0.3, hold: int = 2000) -> frozenset[str]:
    """Accelerate to a twist and keep it until an error occurs or the steps end."""
    for step in range(int(duration / DT) + hold):
        share = swing(step * DT, duration)
        errors = generator.advance(command(O_dP_EE=[share * x for x in twist]))
        if errors:
            return errors
    return frozenset()


@pytest.mark.parametrize("kind", [POSE, TWIST])
def test_a_motion_starts_at_rest_at_the_pose_of_q_d(model, kind) -> None:
    _, state = started(kind, model)
    T = model.pose(FrankaFrame.END_EFFECTOR, READY).T.ravel()
    np.testing.assert_allclose(state.O_T_EE_c, T, atol=1e-14)
    np.testing.assert_allclose(state.O_T_EE_d, T, atol=1e-14)
    assert state.O_dP_EE_c == state.O_dP_EE_d == state.O_ddP_EE_c == STILL
    assert state.elbow_c == state.elbow_d == [0.0, -1.0]
    assert state.delbow_c == state.ddelbow_c == [0.0, 0.0]


def test_the_joints_follow_a_path_and_each_field_says_what_was_commanded(model) -> None:
    generator, state = started(POSE, model)
    start, last_q = state.O_T_EE_c[:], READY
    last, last_twist = start, np.zeros(6)
    for step in range(1, 800):
        T = moved(
            only(12, 0.1 * swing(step * DT, 0.8), start), [0.0, 0.0, 0.0, 0.0, 0.3 * swing(step * DT, 0.8), 0.0], 1.0
        )
        assert generator.advance(command(O_T_EE=T)) == frozenset()
        np.testing.assert_allclose(model.pose(FrankaFrame.END_EFFECTOR, state.q_d).T.ravel(), T, atol=1e-10)
        assert state.O_T_EE_c == T
        twist = np.array(twist_between(last, T, DT))
        np.testing.assert_allclose(state.O_dP_EE_c, twist, atol=1e-12)
        np.testing.assert_allclose(state.O_ddP_EE_c, (twist - last_twist) / DT, atol=1e-8)
        np.testing.assert_allclose(state.dq_d, np.subtract(state.q_d, last_q) / DT, atol=1e-9)
        assert state.elbow_c[0] == state.q_d[2]
        last, last_twist, last_q = T, twist, state.q_d[:]
    np.testing.assert_allclose(
        model.zero_jacobian(FrankaFrame.END_EFFECTOR, state.q_d) @ state.dq_d, state.O_dP_EE_c, atol=1e-3
    )


def test_a_commanded_twist_moves_the_pose_by_its_integral(model) -> None:
    generator, state = started(TWIST, model)
    start = np.reshape(state.O_T_EE_c, (4, 4)).T
    travel = np.zeros(6)
    for step in range(600):
        twist = swing(step * DT, 0.3) * np.array([0.1, 0.05, -0.1, 0.0, 0.0, 0.2])
        assert generator.advance(command(O_dP_EE=twist.tolist())) == frozenset()
        travel += twist * DT
    T = np.reshape(state.O_T_EE_c, (4, 4)).T
    np.testing.assert_allclose(T[:3, 3] - start[:3, 3], travel[:3], atol=1e-12)
    np.testing.assert_allclose(T[:3, :3], pinocchio.exp3(travel[3:]) @ start[:3, :3], atol=1e-12)
    np.testing.assert_allclose(model.pose(FrankaFrame.END_EFFECTOR, state.q_d), T, atol=1e-10)


def test_a_first_pose_far_away_is_an_invalid_start(model) -> None:
    for T_of in (lambda T: only(13, 0.01, T), lambda T: moved(T, [0.0, 0.0, 0.0, 0.1, 0.0, 0.0], 1.0)):
        generator, state = started(POSE, model)
        assert generator.advance(command(O_T_EE=T_of(state.O_T_EE_c))) == {START_INVALID}
        assert state.q_d == READY


def test_a_motion_does_not_start_out_of_range_and_says_where_it_is_singular(model) -> None:
    for kind, name in ((POSE, START_INVALID), (TWIST, JOINT_RANGE)):
        generator, state = make_generator(kind, model, LIMITS), RobotState()
        assert generator.start(state) == {name}
        assert generator.is_singular(state)
        state.q_d[:] = READY
        assert not generator.is_singular(state)
        assert generator.start(state) == frozenset()


def test_a_later_step_in_pose_is_too_fast_and_too_sudden(model) -> None:
    generator, state = started(POSE, model)
    T = state.O_T_EE_c[:]
    assert generator.advance(command(O_T_EE=T)) == frozenset()
    assert generator.advance(command(O_T_EE=only(14, 0.01, T))) == {TOO_FAST, VELOCITY_JUMP, ACCELERATION_JUMP}
    assert state.O_T_EE_c == T and state.q_d == READY and state.O_dP_EE_c == STILL


@pytest.mark.parametrize("index", range(6))
def test_translation_and_rotation_have_their_own_limits_of_acceleration_and_jerk(model, index) -> None:
    limit = LIMITS.translation if index < 3 else LIMITS.rotation
    generator, _ = started(TWIST, model)
    assert generator.advance(command(O_dP_EE=only(index, 1.5 * limit.jerk * DT**2))) == {ACCELERATION_JUMP}
    generator, _ = started(TWIST, model)
    assert generator.advance(command(O_dP_EE=only(index, 1.5 * limit.acceleration * DT))) == {
        VELOCITY_JUMP,
        ACCELERATION_JUMP,
    }
    generator, _ = started(TWIST, model)
    assert generator.advance(command(O_dP_EE=only(index, 1.1 * limit.velocity))) == {TOO_FAST}


def broken_frames(T: list[float]) -> dict[str, list[float]]:
    x, y = T[0:4], T[4:8]
    return {
        "not finite": only(5, float("nan"), T),
        "stretched": [1.001 * v if i < 12 else v for i, v in enumerate(T)],
        "left-handed": y + x + T[8:],
        "last row": only(3, 0.01, T),
        "all zero": [0.0] * 16,
    }


@pytest.mark.parametrize("how", ["not finite", "stretched", "left-handed", "last row", "all zero"])
def test_what_is_no_pose_is_an_invalid_frame(model, how) -> None:
    generator, state = started(POSE, model)
    T = state.O_T_EE_c[:]
    assert generator.advance(command(O_T_EE=T)) == frozenset()
    assert generator.advance(command(O_T_EE=broken_frames(T)[how])) == {INVALID_FRAME}
    assert state.O_T_EE_c == T


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_twist_that_is_not_finite_is_refused(model, bad) -> None:
    generator, state = started(TWIST, model)
    assert generator.advance(command(O_dP_EE=only(4, bad))) == {TOO_FAST}
    assert generator.advance(command(O_dP_EE=[1e308] * 6)) == {TOO_FAST}
    assert state.q_d == READY and state.O_dP_EE_c == STILL


def test_lost_packets_are_bridged_with_constant_acceleration(model) -> None:
    generator, state = started(TWIST, model)
    for v in (0.001, 0.003, 0.006):
        assert generator.advance(command(O_dP_EE=only(2, v))) == frozenset()
    z = state.O_T_EE_c[14]
    for n in range(1, 11):
        assert generator.advance(None) == frozenset()
        assert state.O_ddP_EE_c[2] == pytest.approx(3.0)
        assert state.O_dP_EE_c[2] == pytest.approx(0.006 + n * 3.0 * DT)
        z += state.O_dP_EE_c[2] * DT
        assert state.O_T_EE_c[14] == pytest.approx(z)
        np.testing.assert_allclose(
            model.pose(FrankaFrame.END_EFFECTOR, state.q_d).T.ravel(), state.O_T_EE_c, atol=1e-10
        )


def test_before_the_first_command_nothing_moves(model) -> None:
    generator, state = started(POSE, model)
    for _ in range(5):
        assert generator.advance(None) == frozenset()
    assert state.q_d == READY and state.dq_d == REST


def test_a_motion_must_end_at_rest(model) -> None:
    generator, state = started(TWIST, model)
    assert run(generator, only(2, -0.1), hold=0) == frozenset()
    assert generator.advance(command(O_dP_EE=state.O_dP_EE_c, finished=True)) == {VELOCITY_JUMP}
    generator, state = started(POSE, model)
    assert generator.advance(command(O_T_EE=state.O_T_EE_c, finished=True)) == frozenset()


def test_an_elbow_commanded_at_a_fixed_pose_turns_joint_3_and_keeps_the_pose(model) -> None:
    generator, state = started(POSE, model)
    T, last = state.O_T_EE_c[:], 0.0
    for step in range(1, 1200):
        q3 = 0.4 * swing(step * DT, 1.0)
        assert generator.advance(command(O_T_EE=T, elbow=(q3, -1.0))) == frozenset()
        assert state.elbow_c == [q3, -1.0]
        assert state.elbow_d[0] == pytest.approx(q3, abs=1e-10)
        assert state.delbow_c[0] == pytest.approx((q3 - last) / DT)
        last = q3
    np.testing.assert_allclose(model.pose(FrankaFrame.END_EFFECTOR, state.q_d).T.ravel(), T, atol=1e-10)
    # No longer commanded, it stays.
    for _ in range(200):
        assert generator.advance(command(O_T_EE=T)) == frozenset()
    assert state.q_d[2] == pytest.approx(0.4, abs=1e-6)


def test_a_commanded_elbow_goes_on_with_constant_acceleration_when_packets_are_lost(model) -> None:
    generator, state = started(POSE, model)
    T, dt3 = state.O_T_EE_c[:], DT**3
    for n, q3 in enumerate((0.0, 3000.0 * dt3, 9000.0 * dt3)):
        assert generator.advance(command(O_T_EE=T, elbow=(q3, -1.0))) == frozenset(), n
    for _ in range(5):
        assert generator.advance(None) == frozenset()
    assert state.ddelbow_c[0] == pytest.approx(3.0)
    assert state.delbow_c[0] == pytest.approx(0.006 + 5 * 0.003)
    assert state.elbow_d[0] == pytest.approx(state.elbow_c[0], abs=1e-10)


def test_elbows_that_jump_or_name_the_other_side_are_refused_by_name(model) -> None:
    def errors(first: tuple[float, float], then: tuple[float, float] | None = None) -> frozenset[str]:
        generator, state = started(POSE, model)
        T = state.O_T_EE_c[:]
        refused = generator.advance(command(O_T_EE=T, elbow=first))
        assert state.q_d == pytest.approx(READY, abs=1e-12)
        return refused or (generator.advance(command(O_T_EE=T, elbow=then)) if then else refused)

    assert errors((0.0, -1.0), (0.0, -1.0)) == frozenset()
    assert errors((0.0, 1.0)) == {START_SIGN}
    assert errors((0.01, -1.0)) == {ELBOW_START}
    assert errors((1.5 * LIMITS.elbow.jerk * DT**3, -1.0)) == {ELBOW_LIMIT}
    assert errors((0.0, -1.0), (0.01, -1.0)) == {ELBOW_LIMIT}
    assert errors((0.0, -1.0), (0.0, 1.0)) == {ELBOW_SIGN}
    assert errors((0.0, -1.0), (0.0, 0.0)) == {ELBOW_SIGN}
    assert errors((0.0, -1.0), (float("nan"), -1.0)) == {ELBOW_LIMIT}


def test_a_path_that_leads_a_joint_out_of_its_range_is_refused(model) -> None:
    generator, state = started(TWIST, model)
    assert run(generator, only(5, 0.5), hold=20000) == {JOINT_RANGE}
    assert all(low <= x <= high for low, x, high in zip(LIMITS.lower, state.q_d, LIMITS.upper, strict=True))


def test_a_path_to_the_border_of_the_workspace_ends_by_what_it_needs_of_the_joints(model) -> None:
    generator, state = started(TWIST, model)
    errors = run(generator, only(0, 0.2), hold=20000)
    assert errors and errors <= {JOINT_RANGE, JOINT_FAST, JOINT_JUMP}
    assert np.isfinite(state.q_d).all()
    assert 0.5 < state.O_T_EE_c[12] < 0.9


def test_a_twist_that_the_end_effector_may_but_a_joint_may_not_is_refused(model) -> None:
    # 9 m/s2 at a lever of about half a metre are more than joint 2's 7.5 rad/s2.
    generator, _ = started(TWIST, model)
    errors: frozenset[str] = frozenset()
    for v in (0.005, 0.014, 0.023):
        errors = errors or generator.advance(command(O_dP_EE=only(0, v)))
    assert errors == {JOINT_JUMP}


def test_the_end_effector_that_was_set_is_the_one_that_follows(model) -> None:
    other = KdlFrankaModel(panda_description.load(meshes=False, collision=False), "panda")
    generator, state = make_generator(TWIST, other, LIMITS), RobotState()
    F_T_EE = np.eye(4)
    F_T_EE[2, 3] = 0.3
    other.set_ee(F_T_EE)
    state.q_d[:] = READY
    assert generator.start(state) == frozenset()
    np.testing.assert_allclose(state.O_T_EE_c, other.pose(FrankaFrame.END_EFFECTOR, READY).T.ravel(), atol=1e-13)
    assert run(generator, only(1, 0.1), hold=50) == frozenset()
    np.testing.assert_allclose(other.pose(FrankaFrame.END_EFFECTOR, state.q_d).T.ravel(), state.O_T_EE_c, atol=1e-10)
