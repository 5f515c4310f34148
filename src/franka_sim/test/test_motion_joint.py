"""Joint motion generators: the motion that they command, and the errors that they report."""

from typing import Any

import numpy as np
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_hw_interface.robot_state import ERROR_NAMES, RobotState
from franka_sim.box import rate_limits
from franka_sim.box.motion import MotionGenerator, elbow, make_generator
from franka_sim.box.motion import cartesian as cartesian_module
from franka_sim.box.motion import joint as joint_module
from franka_sim.box.requests import GeneratorMode, MotionCommand
from hric_core.errors import UnknownNameError

READY = [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]
REST = [0.0] * 7
LIMITS = franka_limits()
DT = 0.001
POSITION, VELOCITY = GeneratorMode.JOINT_POSITION, GeneratorMode.JOINT_VELOCITY

START_INVALID = "joint_position_motion_generator_start_pose_invalid"
OUT_OF_RANGE = "joint_motion_generator_position_limits_violation"
TOO_FAST = "joint_motion_generator_velocity_limits_violation"
VELOCITY_JUMP = "joint_motion_generator_velocity_discontinuity"
ACCELERATION_JUMP = "joint_motion_generator_acceleration_discontinuity"


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
        **({"q": REST, "dq": REST, "O_T_EE": [0.0] * 16, "O_dP_EE": [0.0] * 6, "elbow": None, "tau": REST} | fields)
    )


def only(joint: int, value: float, base: list[float] = REST) -> list[float]:
    return [x + value if i == joint else x for i, x in enumerate(base)]


def ramp(generator: MotionGenerator, joint: int, velocity: float, acceleration: float) -> None:
    """Accelerate one joint to a velocity within the limits."""
    v, a = 0.0, 0.0
    while abs(velocity - v) > 1e-9:
        a = min(abs(a) + 0.9 * LIMITS.jerk[joint] * DT, acceleration, 500.0 * abs(velocity - v)) * np.sign(velocity - v)
        v += a * DT if abs(velocity - v) > 1e-6 else velocity - v
        assert generator.advance(command(dq=only(joint, v))) == frozenset()


def test_every_name_that_a_generator_can_give_is_one_of_libfrankas() -> None:
    names: set[str] = set()
    for module in (rate_limits, joint_module, cartesian_module, elbow):
        for value in vars(module).values():
            names |= value if isinstance(value, frozenset) else set()
    for errors in (rate_limits.JOINT_ERRORS, rate_limits.CARTESIAN_ERRORS, rate_limits.CARTESIAN_JOINT_ERRORS):
        names |= {errors.velocity, errors.acceleration, errors.jerk}
    names |= {rate_limits.JOINT_ERRORS.position, rate_limits.CARTESIAN_JOINT_ERRORS.position}
    assert len(names) > 15
    assert names <= set(ERROR_NAMES)


def test_modes_that_generate_no_motion_have_no_generator(model) -> None:
    for mode in (GeneratorMode.IDLE, GeneratorMode.NONE):
        with pytest.raises(UnknownNameError, match="CARTESIAN_POSITION"):
            make_generator(mode, model, LIMITS)


@pytest.mark.parametrize("kind", [POSITION, VELOCITY])
def test_a_motion_starts_at_rest_at_q_d_and_writes_into_the_lists_of_the_state(model, kind) -> None:
    generator, state = make_generator(kind, model, LIMITS), RobotState()
    lists = state.q_d, state.dq_d, state.ddq_d
    state.q_d[:], state.dq_d[:], state.ddq_d[:] = READY, [1.0] * 7, [1.0] * 7
    assert generator.start(state) == frozenset()
    assert (state.q_d, state.dq_d, state.ddq_d) == (READY, REST, REST)
    assert generator.advance(command(q=only(0, 1e-6, READY), dq=only(0, 1e-3))) == frozenset()
    assert (
        state.q_d[0] == pytest.approx(1e-6)
        and state.dq_d[0] == pytest.approx(1e-3)
        and state.ddq_d[0] == pytest.approx(1.0)
    )
    assert all(now is before for now, before in zip((state.q_d, state.dq_d, state.ddq_d), lists, strict=True))


def test_a_first_position_far_from_q_d_is_an_invalid_start(model) -> None:
    generator, state = started(POSITION, model)
    assert generator.advance(command(q=only(4, 0.01, READY))) == {START_INVALID}
    assert state.q_d == READY


def test_a_position_motion_does_not_start_out_of_range(model) -> None:
    generator, state = make_generator(POSITION, model, LIMITS), RobotState()
    state.q_d[:] = [0.0] * 7
    assert generator.start(state) == {START_INVALID}


def test_a_velocity_motion_that_starts_out_of_range_may_only_lead_inwards(model) -> None:
    # q = 0, the thesis's start, is out of joint 4's range.
    inwards, state = started(VELOCITY, model, REST)
    ramp(inwards, 3, -0.1, 5.0)
    assert state.q_d[3] < 0.0
    outwards, _ = started(VELOCITY, model, REST)
    assert outwards.advance(command(dq=only(3, 1e-3))) == {OUT_OF_RANGE}


def test_a_later_step_in_position_is_too_fast_and_too_sudden(model) -> None:
    generator, state = started(POSITION, model)
    assert generator.advance(command(q=READY)) == frozenset()
    assert generator.advance(command(q=only(2, 0.01, READY))) == {TOO_FAST, VELOCITY_JUMP, ACCELERATION_JUMP}
    assert state.q_d == READY and state.dq_d == REST


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_each_joint_has_its_own_limits(model, joint, sign) -> None:
    jerk = LIMITS.jerk[joint] * DT * DT
    generator, _ = started(VELOCITY, model)
    assert generator.advance(command(dq=only(joint, sign * 0.99 * jerk))) == frozenset()
    generator, _ = started(VELOCITY, model)
    assert generator.advance(command(dq=only(joint, sign * 1.5 * jerk))) == {ACCELERATION_JUMP}
    generator, _ = started(VELOCITY, model)
    assert generator.advance(command(dq=only(joint, sign * 1.5 * LIMITS.acceleration[joint] * DT))) == {
        VELOCITY_JUMP,
        ACCELERATION_JUMP,
    }
    middle = ((np.array(LIMITS.lower) + LIMITS.upper) / 2 - sign * 0.4).tolist()
    generator, state = started(VELOCITY, model, middle)
    ramp(generator, joint, sign * LIMITS.velocity[joint], 0.9 * LIMITS.acceleration[joint])
    errors: frozenset[str] = frozenset()
    for share in np.linspace(1.0, 1.02, 60):
        last = state.dq_d[joint]
        errors = generator.advance(command(dq=only(joint, sign * share * LIMITS.velocity[joint])))
        if errors:
            break
    assert errors == {TOO_FAST}
    assert abs(last) > LIMITS.velocity[joint]


@pytest.mark.parametrize("upper", [True, False])
def test_a_motion_that_passes_the_range_of_a_joint_is_refused_at_its_limit(model, upper) -> None:
    generator, state = started(VELOCITY, model)
    ramp(generator, 3, 1.0 if upper else -1.0, 5.0)
    errors: frozenset[str] = frozenset()
    for _ in range(4000):
        errors = generator.advance(command(dq=state.dq_d[:]))
        if errors:
            break
    assert errors == {OUT_OF_RANGE}
    assert state.q_d[3] == pytest.approx(LIMITS.upper[3] if upper else LIMITS.lower[3], abs=1.1e-3)


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("kind", [POSITION, VELOCITY])
def test_values_that_are_not_finite_are_refused_and_never_reach_the_state(model, kind, bad) -> None:
    generator, state = started(kind, model)
    assert generator.advance(command(q=READY)) == frozenset()
    errors = generator.advance(command(q=only(1, bad, READY), dq=only(1, bad)))
    assert {OUT_OF_RANGE, TOO_FAST} <= errors
    assert (state.q_d, state.dq_d, state.ddq_d) == (READY, REST, REST)


def test_lost_packets_are_bridged_with_constant_acceleration(model) -> None:
    generator, state = started(VELOCITY, model)
    for v in (0.004, 0.010, 0.018):
        assert generator.advance(command(dq=only(5, v))) == frozenset()
    q, a = state.q_d[5], 8.0
    for n in range(1, 11):
        assert generator.advance(None) == frozenset()
        assert state.ddq_d[5] == pytest.approx(a)
        assert state.dq_d[5] == pytest.approx(0.018 + n * a * DT)
        q += state.dq_d[5] * DT
        assert state.q_d[5] == pytest.approx(q)


def test_before_the_first_command_nothing_moves_and_nothing_is_excused(model) -> None:
    generator, state = started(POSITION, model)
    for _ in range(5):
        assert generator.advance(None) == frozenset()
    assert state.q_d == READY
    assert generator.advance(command(q=only(0, 1.5 * LIMITS.jerk[0] * DT**3, READY))) == {ACCELERATION_JUMP}


def test_bridging_that_leads_beyond_a_limit_ends_the_motion_by_that_limit(model) -> None:
    generator, state = started(VELOCITY, model)
    ramp(generator, 0, 2.1, 10.0)
    assert generator.advance(command(dq=only(0, 2.1 + 0.007))) == frozenset()
    errors: frozenset[str] = frozenset()
    for _ in range(20):
        errors = generator.advance(None)
        if errors:
            break
    assert errors == {TOO_FAST}
    assert state.dq_d[0] < 1.01 * LIMITS.velocity[0]


def test_after_a_loss_one_may_brake_at_once_but_not_speed_up(model) -> None:
    def after_loss(change: float) -> frozenset[str]:
        generator, state = started(VELOCITY, model)
        ramp(generator, 0, 1.0, 10.0)
        assert generator.advance(command(dq=only(0, 1.005))) == frozenset()
        assert generator.advance(None) == frozenset()
        return generator.advance(command(dq=only(0, state.dq_d[0] + change)))

    assert after_loss(-0.014) == frozenset()
    assert after_loss(0.015) == {ACCELERATION_JUMP}
    assert after_loss(-0.02) == {VELOCITY_JUMP}


def test_braking_at_once_without_a_loss_is_a_jump(model) -> None:
    generator, _ = started(VELOCITY, model)
    ramp(generator, 0, 1.0, 10.0)
    assert generator.advance(command(dq=only(0, 1.005))) == frozenset()
    assert generator.advance(command(dq=only(0, 1.005 - 0.014))) == {ACCELERATION_JUMP}


def test_a_motion_must_end_at_rest(model) -> None:
    generator, _ = started(VELOCITY, model)
    ramp(generator, 0, 0.5, 10.0)
    assert generator.advance(command(dq=only(0, 0.5), finished=True)) == {VELOCITY_JUMP}
    generator, _ = started(VELOCITY, model)
    assert generator.advance(command(dq=REST, finished=True)) == frozenset()
    generator, _ = started(POSITION, model)
    assert generator.advance(command(q=READY, finished=True)) == frozenset()


def test_a_generator_serves_one_motion_after_the_other(model) -> None:
    generator, state = started(VELOCITY, model)
    ramp(generator, 0, 0.5, 10.0)
    assert generator.start(state) == frozenset()
    assert state.dq_d == REST
    assert generator.advance(command(dq=REST)) == frozenset()
    assert generator.advance(command(dq=only(0, 0.5))) == {VELOCITY_JUMP, ACCELERATION_JUMP}
