"""Motion generators and internal impedances joined with the box on the real plant."""

import math

import numpy as np
import pytest

from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import NO_ERRORS, RobotMode
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest, RequestOutcome

JOINT, CARTESIAN, EXTERNAL = ControllerMode.JOINT_IMPEDANCE, ControllerMode.CARTESIAN_IMPEDANCE, ControllerMode.EXTERNAL
LENGTH = 2.0
"""Of a test's motion [s]."""


def share(t: float) -> float:
    """Way from 0 to 1 in LENGTH that begins and ends without velocity, acceleration and jerk."""
    s = min(t / LENGTH, 1.0)
    return s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)


def speed(t: float) -> float:
    s = min(t / LENGTH, 1.0)
    return 140.0 * s**3 * (1.0 - s) ** 3 / LENGTH


class Client:
    """Commands of a motion: joints by 0.2 rad each, or the end effector by (0.05, -0.1, 0.05) m."""

    way, path = 0.2, np.array([0.05, -0.1, 0.05])

    def __init__(self, arm, kind: GeneratorMode) -> None:
        self.kind, self.q, self.T = kind, arm.state.q_d[:], arm.state.O_T_EE_c[:]
        self.goal = [q + self.way for q in self.q]
        self.end = np.array(self.T[12:15]) + self.path

    def at(self, t: float, finished: bool = False) -> MotionCommand:
        q, dq, T, twist = self.q[:], [0.0] * 7, self.T[:], [0.0] * 6
        if self.kind is GeneratorMode.JOINT_POSITION:
            q = [x + self.way * share(t) for x in q]
        elif self.kind is GeneratorMode.JOINT_VELOCITY:
            dq = [self.way * speed(t)] * 7
        elif self.kind is GeneratorMode.CARTESIAN_POSITION:
            T[12:15] = (np.array(T[12:15]) + self.path * share(t)).tolist()
        else:
            twist[:3] = (self.path * speed(t)).tolist()
        return MotionCommand(q, dq, T, twist, None, [0.0] * 7, finished)


KINDS = [
    GeneratorMode.JOINT_POSITION,
    GeneratorMode.JOINT_VELOCITY,
    GeneratorMode.CARTESIAN_POSITION,
    GeneratorMode.CARTESIAN_VELOCITY,
]


def run(arm, controller: ControllerMode, kind: GeneratorMode, lose: int = 0) -> Client:
    arm.start(controller, kind)
    client = Client(arm, kind)
    for k in range(1, round(LENGTH * 1000) + 1):
        arm.cycle(None if lose and k % lose == 0 else client.at(k * 1e-3))
        assert arm.state.current_errors == NO_ERRORS, (k, arm.state.current_errors)
    return client


def arrived(arm, client: Client) -> None:
    state = arm.state
    if client.kind in (GeneratorMode.JOINT_POSITION, GeneratorMode.JOINT_VELOCITY):
        assert state.q == pytest.approx(client.goal, abs=2e-3)
    else:
        assert np.array(state.O_T_EE[12:15]) == pytest.approx(client.end, abs=2e-3)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name.lower())
@pytest.mark.parametrize("controller", [JOINT, CARTESIAN], ids=["joint impedance", "Cartesian impedance"])
def test_a_motion_with_an_internal_impedance_arrives_finishes_and_the_arm_stays(make_box, controller, kind) -> None:
    arm = make_box()
    client = run(arm, controller, kind)
    for k in range(300):
        arm.cycle(client.at(LENGTH + k * 1e-3))
    arrived(arm, client)
    assert arm.state.control_command_success_rate == 1.0
    arm.cycle(client.at(LENGTH + 1.0, finished=True))
    assert (arm.box.mode, arm.box.take_finished()) == (RobotMode.IDLE, RequestOutcome.SUCCESS)
    for _ in range(300):
        arm.cycle()
    arrived(arm, client)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name.lower())
def test_what_is_echoed_stays_between_the_cycles(make_box, kind) -> None:
    arm = make_box()
    arm.start(JOINT, kind)
    client = Client(arm, kind)
    for k in range(1, 500):
        arm.cycle(client.at(k * 1e-3))
    command, state = client.at(0.499), arm.state
    if kind is GeneratorMode.JOINT_POSITION:
        assert state.q_d == pytest.approx(command.q, abs=1e-12)
    elif kind is GeneratorMode.JOINT_VELOCITY:
        assert state.dq_d == pytest.approx(command.dq, abs=1e-12)
    elif kind is GeneratorMode.CARTESIAN_POSITION:
        assert state.O_T_EE_c == pytest.approx(command.O_T_EE, abs=1e-12)
    else:
        assert state.O_dP_EE_c == pytest.approx(command.O_dP_EE, abs=1e-12)
    assert np.array(state.O_T_EE_d) == pytest.approx(
        arm.box.model.pose(FrankaFrame.END_EFFECTOR, state.q_d).T.ravel(), abs=1e-6
    )
    assert state.elbow_d == pytest.approx([state.q_d[2], -1.0])
    assert (state.controller_mode, state.generator_mode) == (JOINT, kind)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name.lower())
def test_a_lost_packet_here_and_there_does_not_end_a_motion(make_box, kind) -> None:
    arm = make_box()
    run(arm, JOINT, kind, lose=50)
    assert arm.state.control_command_success_rate == pytest.approx(0.98)


def jump(arm, kind: GeneratorMode) -> MotionCommand:
    command = Client(arm, kind).at(0.0)
    if kind is GeneratorMode.JOINT_POSITION:
        command.q[3] += 0.05
    elif kind is GeneratorMode.JOINT_VELOCITY:
        command.dq[3] += 0.5
    elif kind is GeneratorMode.CARTESIAN_POSITION:
        command.O_T_EE[12] += 0.05
    else:
        command.O_dP_EE[0] += 0.5
    return command


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name.lower())
@pytest.mark.parametrize(
    "controller", [JOINT, CARTESIAN, EXTERNAL], ids=["joint impedance", "Cartesian impedance", "torques"]
)
def test_a_jump_is_a_discontinuity_or_a_violated_limit_by_name(make_box, controller, kind) -> None:
    arm = make_box()
    q = arm.state.q[:]
    arm.start(controller, kind)
    client = Client(arm, kind)
    for _ in range(5):
        arm.cycle(client.at(0.0))
    assert arm.box.mode is RobotMode.MOVE
    arm.cycle(jump(arm, kind))
    prefix = "cartesian_motion_generator" if "CARTESIAN" in kind.name else "joint_motion_generator"
    assert arm.state.last_motion_errors
    assert all(
        name.startswith(prefix) and name.endswith(("discontinuity", "limits_violation"))
        for name in arm.state.last_motion_errors
    )
    assert (arm.box.mode, arm.box.take_finished()) == (RobotMode.REFLEX, RequestOutcome.REFLEX_ABORTED)
    for _ in range(200):
        arm.cycle()
    assert arm.state.q == pytest.approx(q, abs=1e-3)
    assert arm.box.recover() is RequestOutcome.SUCCESS
    run(arm, JOINT, kind)


def test_an_arm_that_brakes_recovers_when_it_rests(make_box) -> None:
    arm, kind = make_box(), GeneratorMode.JOINT_VELOCITY
    arm.start(JOINT, kind)
    client = Client(arm, kind)
    for cycle in range(1000):
        arm.cycle(client.at(1e-3 * cycle))
    arm.cycle(jump(arm, kind))
    arm.cycle()
    assert arm.box.recover() is RequestOutcome.SUCCESS
    assert arm.box.mode is RobotMode.AUTOMATIC_ERROR_RECOVERY and max(map(abs, arm.state.dq)) > 0.1
    assert arm.box.move(MoveRequest(JOINT, kind)) is RequestOutcome.NOT_POSSIBLE
    for _ in range(200):
        arm.cycle()
    assert arm.box.mode is RobotMode.IDLE and arm.state.current_errors == NO_ERRORS
    run(arm, JOINT, kind)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name.lower())
def test_a_command_that_is_no_number_never_reaches_the_arm(make_box, kind) -> None:
    arm = make_box()
    arm.start(JOINT, kind)
    nan = [math.nan]
    arm.cycle(MotionCommand(nan * 7, nan * 7, nan * 16, nan * 6, None, nan * 7))
    assert arm.box.mode is RobotMode.REFLEX
    assert arm.state.last_motion_errors
    for _ in range(100):
        arm.cycle()
    assert all(map(math.isfinite, arm.state.q + arm.state.tau_J))
    assert max(map(abs, arm.state.dq)) < 1e-3


def test_torques_beside_a_generator_are_applied_and_its_motion_is_checked_and_echoed(make_box) -> None:
    arm = make_box()
    arm.start(EXTERNAL, GeneratorMode.JOINT_POSITION)
    client = Client(arm, GeneratorMode.JOINT_POSITION)
    for k in range(1, 2001):
        command = client.at(k * 1e-3)
        s = arm.state
        wanted = [200.0 * (a - q) - 20.0 * v for a, q, v in zip(command.q, s.q, s.dq, strict=True)]
        command.tau[:] = [min(max(t, b - 0.999), b + 0.999) for t, b in zip(wanted, s.tau_J_d, strict=True)]
        arm.cycle(command)
        assert s.tau_J_d == command.tau
    assert arm.state.q_d == pytest.approx(client.goal, abs=1e-9)
    assert arm.state.q == pytest.approx(client.goal, abs=0.05)


def test_a_start_that_the_generator_forbids_ends_by_name_with_the_first_command(make_box, torques) -> None:
    arm = make_box(q=[0.0] * 7)  # joint 4 is beyond its limit
    arm.start(JOINT, GeneratorMode.JOINT_POSITION)
    assert arm.box.mode is RobotMode.MOVE
    arm.cycle(Client(arm, GeneratorMode.JOINT_POSITION).at(0.0))
    assert arm.state.last_motion_errors == {"joint_position_motion_generator_start_pose_invalid"}
    assert arm.box.take_finished() is RequestOutcome.REFLEX_ABORTED


def test_a_cartesian_motion_does_not_begin_in_a_singular_pose(make_box) -> None:
    arm = make_box(q=[0.0, 0.0, 0.5 * math.pi, -0.5 * math.pi, 0.0, 1.8, 0.0])
    assert arm.box.move(MoveRequest(JOINT, GeneratorMode.CARTESIAN_POSITION)) is RequestOutcome.SINGULAR_START
    assert arm.box.mode is RobotMode.IDLE


@pytest.mark.parametrize(
    ("limits", "name"),
    [
        ({"max_path_deviation": (0.01, 3.12, 6.28)}, "max_path_pose_deviation_violation"),
        ({"max_path_deviation": (10.0, 0.02, 6.28)}, "max_path_pose_deviation_violation"),
        ({"max_goal_deviation": (0.01, 3.12, 6.28)}, "max_goal_pose_deviation_violation"),
    ],
    ids=["path", "rotation", "goal"],
)
def test_an_arm_that_is_pushed_too_far_from_its_path_or_goal_stops(make_box, limits, name) -> None:
    arm = make_box()
    arm.box.set_collision_behavior(*[[1e3] * 7] * 4, *[[1e4] * 6] * 4)
    arm.box.set_cartesian_impedance([200.0] * 3 + [20.0] * 3)
    arm.start(CARTESIAN, GeneratorMode.CARTESIAN_POSITION, **limits)
    client = Client(arm, GeneratorMode.CARTESIAN_POSITION)
    for _ in range(500):
        arm.cycle(client.at(0.0))
    assert arm.box.mode is RobotMode.MOVE
    arm.plant.apply_wrench("panda_hand", (0.0, 0.0, 8.0), (0.0, 2.0, 0.0), (0.0, 0.0, 0.0), -1.0)
    errors = arm.until_reflex(lambda: client.at(0.0), 1000)
    if "goal" in name:
        assert errors == NO_ERRORS
        arm.cycle(client.at(0.0, finished=True))
    assert arm.state.current_errors == {name}


def test_frames_that_were_set_between_two_motions_hold_for_the_next_one(make_box) -> None:
    arm = make_box()
    run(arm, CARTESIAN, GeneratorMode.CARTESIAN_POSITION)
    arm.box.stop_move()
    T = [1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0, 0, 0.0, 0.0, 0.1, 1.0]
    assert arm.box.set_NE_T_EE(T) is RequestOutcome.SUCCESS
    for _ in range(200):
        arm.cycle()
    assert pytest.approx(T) == arm.state.NE_T_EE
    arrived(arm, run(arm, CARTESIAN, GeneratorMode.CARTESIAN_POSITION))


def test_a_motion_that_is_stopped_on_its_way_comes_to_rest_within_the_acceleration_limits(make_box) -> None:
    arm = make_box()
    arm.start(JOINT, GeneratorMode.JOINT_VELOCITY)
    client = Client(arm, GeneratorMode.JOINT_VELOCITY)
    for k in range(1, 1001):
        arm.cycle(client.at(k * 1e-3))
    assert min(arm.state.dq_d) > 0.1
    arm.box.stop_move()
    before = arm.state.dq_d[:]
    for _ in range(200):
        arm.cycle()
        rates = [abs(b - a) / 1e-3 for a, b in zip(before, arm.state.dq_d, strict=True)]
        assert all(r <= limit + 1e-6 for r, limit in zip(rates, arm.box.config.limits.acceleration, strict=True))
        before = arm.state.dq_d[:]
    assert arm.state.dq_d == arm.state.ddq_d == [0.0] * 7
    assert max(map(abs, arm.state.dq)) < 0.02
