"""Asynchronous joint motion: the box plans the motion to sparse targets, within the limits of arm and client."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import fr3_limits
from franka_hw_interface.robot_state import ERROR_NAMES, RobotMode, RobotState
from franka_sim.box.config import motion_parameters
from franka_sim.box.motion import point_to_point
from franka_sim.box.motion.point_to_point import PointToPointGenerator
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest, RequestOutcome

READY = [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]
REST = [0.0] * 7
LIMITS = fr3_limits()
DT = 1e-3
POSITION, JOINT = GeneratorMode.JOINT_POSITION, ControllerMode.JOINT_IMPEDANCE


def to(q: list[float], finished: bool = False) -> MotionCommand:
    return MotionCommand(q, REST, [0.0] * 16, [0.0] * 6, None, REST, finished)


def beside(*steps: float) -> list[float]:
    return [x + dx for x, dx in zip(READY, steps, strict=True)]


def started(fastest: float = 0.5) -> tuple[PointToPointGenerator, RobotState]:
    names = KdlFrankaModel(panda_description.load(meshes=False, collision=False), "panda").joint_names
    generator = PointToPointGenerator(LIMITS, [fastest] * 7, names, motion_parameters(), DT)
    state = RobotState()
    state.q_d[:] = READY
    assert generator.start(state) == frozenset()
    return generator, state


def run(generator: PointToPointGenerator, state: RobotState, command: MotionCommand | None, cycles: int) -> np.ndarray:
    """Return positions and velocities of the cycles, shape (cycles, 2, 7)."""
    rows = []
    for k in range(cycles):
        assert generator.advance(command if k == 0 else None) == frozenset()
        rows.append([state.q_d[:], state.dq_d[:]])
    return np.array(rows)


def test_one_target_leads_to_rest_there_within_the_limits_of_client_and_arm() -> None:
    generator, state = started()
    target = beside(0.6, -0.3, 0.1, 0.4, 0.0, -0.2, 0.5)
    rows = run(generator, state, to(target), 2000)
    assert rows[-1, 0] == pytest.approx(target, abs=1e-12) and not rows[-1, 1].any()
    velocity = np.diff(np.vstack([[READY], rows[:, 0]]), axis=0) / DT
    acceleration = np.diff(velocity, axis=0) / DT
    jerk = np.diff(acceleration, axis=0) / DT
    assert abs(velocity).max() == pytest.approx(0.5, rel=1e-6), "the client's maximum is used and kept"
    assert (abs(acceleration) <= np.array(LIMITS.acceleration) * 1.001).all()
    assert (abs(jerk) <= np.array(LIMITS.jerk) * 1.01).all()


def test_all_joints_arrive_at_the_same_time() -> None:
    generator, state = started()
    rows = run(generator, state, to(beside(0.6, -0.3, 0.1, 0.4, 0.0, -0.2, 0.5)), 2000)
    moving = [np.flatnonzero(rows[:, 1, joint])[-1] for joint in (0, 1, 2, 3, 5, 6)]
    assert max(moving) - min(moving) <= 1


def test_the_arms_own_velocity_limit_holds_for_a_client_that_allows_more() -> None:
    generator, state = started(fastest=100.0)
    rows = run(generator, state, to(beside(2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)), 3000)
    assert abs(rows[:, 1, 0]).max() == pytest.approx(LIMITS.velocity[0], rel=1e-6)


def test_a_new_target_replaces_the_one_before_without_a_jump() -> None:
    generator, state = started()
    before = run(generator, state, to(beside(0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)), 400)
    back = beside(-0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    rows = np.vstack([before, run(generator, state, to(back), 3000)])
    assert rows[-1, 0] == pytest.approx(back, abs=1e-12)
    assert abs(np.diff(rows[:, 1, 0])).max() <= LIMITS.acceleration[0] * DT * 1.001


def test_the_last_command_brakes_the_arm_whatever_its_positions_are() -> None:
    generator, state = started()
    run(generator, state, to(beside(0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)), 400)
    fast = state.dq_d[0]
    assert fast > 0.4 and not generator.at_rest
    for _ in range(int(1000 * fast / LIMITS.acceleration[0]) + 10):
        assert generator.advance(to(REST, finished=True)) == frozenset()  # libfranka sends zeros with the last command
    assert generator.at_rest and state.dq_d == REST
    assert 0.0 < state.q_d[0] < 0.6


def test_the_last_command_ends_a_motion_at_once_if_the_arm_rests() -> None:
    generator, state = started()
    generator.advance(to(REST, finished=True))
    assert generator.at_rest and state.q_d == READY


@pytest.mark.parametrize("value", [2.9, float("nan"), float("inf")])
def test_a_target_out_of_range_moves_nothing_and_is_named_with_its_joint(value: float) -> None:
    generator, state = started()
    assert generator.advance(to([value, *READY[1:]])) == point_to_point.OUT_OF_RANGE
    assert "panda_joint1" in generator.reason
    assert state.q_d == READY


def test_a_start_outside_the_position_limits_is_refused() -> None:
    generator, state = started()
    state.q_d[3] = 0.1
    assert generator.start(state) == point_to_point.START_POSE_INVALID


def test_the_names_of_the_errors_are_libfrankas() -> None:
    assert set(ERROR_NAMES) >= point_to_point.OUT_OF_RANGE | point_to_point.NO_PLAN


def test_the_box_goes_on_to_the_target_without_further_commands_and_loses_no_packet(make_box: Callable) -> None:
    arm = make_box()
    arm.start(JOINT, POSITION, maximum_velocity=(0.5,) * 7)
    target = [*arm.state.q[:3], arm.state.q[3] + 0.2, *arm.state.q[4:]]
    arm.cycle(to(target))
    for _ in range(1000):
        arm.cycle()
    assert arm.box.mode is RobotMode.MOVE and arm.state.control_command_success_rate == 1.0
    assert arm.state.q == pytest.approx(target, abs=1e-4)
    arm.cycle(to(REST, finished=True))
    assert arm.box.mode is RobotMode.IDLE and arm.box.take_finished() is RequestOutcome.SUCCESS


def test_the_box_ends_the_motion_when_the_arm_has_braked(make_box: Callable) -> None:
    arm = make_box()
    arm.start(JOINT, POSITION, maximum_velocity=(0.5,) * 7)
    arm.cycle(to([*arm.state.q[:3], arm.state.q[3] + 0.5, *arm.state.q[4:]]))
    for _ in range(300):
        arm.cycle()
    arm.cycle(to(REST, finished=True))
    assert arm.box.mode is RobotMode.MOVE and arm.box.take_finished() is None
    for _ in range(100):
        arm.cycle()
    assert arm.box.mode is RobotMode.IDLE and arm.box.take_finished() is RequestOutcome.SUCCESS
    assert arm.state.current_errors == frozenset()


def test_a_target_out_of_range_is_a_reflex_with_its_reason(make_box: Callable) -> None:
    arm = make_box()
    arm.start(JOINT, POSITION, maximum_velocity=(0.5,) * 7)
    arm.cycle(to([3.0, *arm.state.q[1:]]))
    assert arm.state.current_errors == {"joint_motion_generator_position_limits_violation"}
    assert "panda_joint1 at 3 rad, limit 2.8973 rad" in arm.reports[-1]


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        (MoveRequest(ControllerMode.EXTERNAL, POSITION, maximum_velocity=(0.5,) * 7), "internal controller"),
        (MoveRequest(JOINT, GeneratorMode.JOINT_VELOCITY, maximum_velocity=(0.5,) * 7), "joint positions"),
        (MoveRequest(JOINT, POSITION, maximum_velocity=(0.5,) * 6 + (0.0,)), "above 0"),
        (MoveRequest(JOINT, POSITION, maximum_velocity=(0.5,) * 6 + (float("nan"),)), "above 0"),
    ],
)
def test_a_request_that_no_client_of_libfranka_can_make_is_refused(
    make_box: Callable, request_: Any, reason: str
) -> None:
    arm = make_box()
    assert arm.box.move(request_) is RequestOutcome.INVALID_ARGUMENT
    assert reason in arm.reports[-1]
