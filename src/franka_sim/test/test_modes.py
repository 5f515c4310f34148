import logging

import numpy as np
import pytest

from franka_hw_interface.modes import HOLD, ArmMode, Kind
from franka_hw_interface.robot_state import RobotMode
from hric_control.controller import Controller
from hric_control.hardware_interface import EffortJointInterface, PositionJointInterface, VelocityJointInterface
from hric_control.manager.controller_manager import ControllerManager
from hric_core.errors import HricError, ResourceConflictError


class Law(Controller):
    """Controller that claims the resources in its parameters and writes a constant command."""

    def init(self, robot_hw, root_node, controller_node) -> None:
        interface = {
            cls.__name__: cls for cls in (EffortJointInterface, VelocityJointInterface, PositionJointInterface)
        }
        self.joints = robot_hw.get(interface[controller_node.param("interface")]).group(
            controller_node.param("joints", None)
        )
        self.command = controller_node.param("command", None)
        self.fail_at = controller_node.param("fail_at", 1e9)
        self.starts = 0

    def starting(self, time) -> None:
        self.starts += 1

    def update(self, time, period) -> None:
        if time >= self.fail_at:
            raise HricError("this law cannot go on")
        if self.command is not None:
            self.joints.set_command(self.command)


@pytest.fixture
def managed(make_arm):
    """managed(controllers, **arm) -> (arm, manager): controllers by name with their parameters, loaded."""

    def make(controllers, parameters=None, **arm_arguments):
        configured = {name: {"type": "test/Law", **values} for name, values in controllers.items()}
        arm = make_arm(parameters={**configured, **(parameters or {})}, **arm_arguments)
        manager = ControllerManager(arm.hw, arm.node, {"test/Law": Law})
        manager.loop_running = False
        for name in controllers:
            manager.load(name)

        def run(duration):
            end = arm.hw.loop.time + duration

            def on_cycle(time, period, reset):
                manager.update(time, period, reset)
                if time + 1.5 * period > end:
                    arm.hw.stop()
                return True

            arm.hw.run(on_cycle)

        arm.run = run
        return arm, manager

    return make


TORQUE = ArmMode(torque=True)
EFFORT, VELOCITY, POSITION = (
    {"interface": cls.__name__} for cls in (EffortJointInterface, VelocityJointInterface, PositionJointInterface)
)
PARTIAL = {**EFFORT, "joints": ["panda_joint1", "panda_joint2"]}


def test_a_second_commander_is_refused_with_both_names(managed) -> None:
    arm, manager = managed({"a": EFFORT, "b": EFFORT, "c": POSITION})
    manager.switch(["a"], [])
    for other in ("b", "c"):
        with pytest.raises(ResourceConflictError, match=rf"panda_joint1 is claimed by both a and {other}"):
            manager.switch([other], [])
    arm.run(0.002)
    assert arm.hw.mode == TORQUE
    manager.switch(["c"], ["a"])
    arm.run(0.002)
    assert arm.hw.mode == ArmMode(generator=Kind.POSITION)


def test_a_claim_of_some_joints_only_is_refused_with_the_missing_ones(managed) -> None:
    arm, manager = managed({"part": PARTIAL})
    with pytest.raises(
        HricError, match=r"part claims 2 of the arm's 7 joints; .*missing panda_joint3, panda_joint4, .*panda_joint7"
    ):
        manager.switch(["part"], [])
    arm.run(0.002)
    assert arm.hw.mode is HOLD


def test_one_controller_with_two_motion_generators_is_refused(make_arm, claim) -> None:
    hw = make_arm().hw
    both = claim(VelocityJointInterface)
    both.claims.update(claim(PositionJointInterface).claims)
    with pytest.raises(
        HricError, match="law claims position and velocity; the arm takes one motion generator at a time"
    ):
        hw.prepare_switch([both], [])


def test_controllers_that_claim_nothing_leave_the_mode_alone(make_arm, claim) -> None:
    from hric_control.robot_hw import ControllerInfo

    arm, reader = make_arm(), ControllerInfo("reader", "test/Reader", {})
    hw = arm.hw
    hw.do_switch([claim()], [])
    hw.do_switch([reader], [])
    hw.do_switch([], [reader])
    arm.run(0.002)
    assert hw.mode == TORQUE


def test_the_arm_holds_where_its_controller_stopped(managed) -> None:
    arm, manager = managed({"push": {**EFFORT, "command": [3.0, 0, 0, 0, 0, 0, 0.5]}})
    hw = arm.hw
    manager.switch(["push"], [])
    arm.run(0.4)
    assert hw.robot_state.robot_mode is RobotMode.MOVE
    speed = hw.states.velocity[0]
    assert speed > 0.05
    manager.switch([], ["push"])
    at_stop = np.array(hw.states.position)
    arm.run(1.5)
    assert hw.robot_state.robot_mode is RobotMode.IDLE and hw.error == ""
    # It brakes at the limits of acceleration, so it rests a little further on, and stays there.
    assert 0.0 < hw.states.position[0] - at_stop[0] < 1.1 * speed**2 / (2 * 15.0) + 0.01
    assert np.abs(hw.states.velocity).max() < 1e-6


def test_the_arm_holds_when_its_controller_fails(managed) -> None:
    arm, manager = managed({"push": {**EFFORT, "command": [2.0] * 7, "fail_at": 0.1}})
    manager.switch(["push"], [])
    arm.run(1.5)
    assert arm.hw.mode is HOLD
    assert np.abs(arm.hw.states.velocity).max() < 1e-6
    assert [status.state for status in manager.list()] == ["aborted"]


def test_a_velocity_step_is_smoothed_to_the_limits_of_acceleration_and_jerk(managed) -> None:
    arm, manager = managed({"turn": {**VELOCITY, "command": [1.0, 0, 0, 0, 0, 0, 0]}})
    manager.switch(["turn"], [])
    speeds: list[float] = []
    for _ in range(120):
        arm.run(0.001)
        speeds.append(arm.hw.robot_state.dq_d[0])
    acceleration = np.diff([0.0, *speeds]) / 0.001
    assert arm.hw.error == "" and speeds[-1] == pytest.approx(1.0, abs=1e-6)
    assert acceleration.max() <= 15.0 and np.abs(np.diff([0.0, *acceleration])).max() / 0.001 <= 7500.0


def test_a_velocity_step_that_nothing_smooths_is_a_reflex_by_name(managed, caplog) -> None:
    arm, manager = managed({"turn": {**VELOCITY, "command": [1.0, 0, 0, 0, 0, 0, 0]}}, {"rate_limiting": False})
    manager.switch(["turn"], [])
    with caplog.at_level(logging.ERROR, "hric"):
        arm.run(0.01)
    assert "joint_motion_generator_acceleration_discontinuity" in arm.hw.error
    assert [record.getMessage() for record in caplog.records if "error state" in record.getMessage()]
    assert arm.hw.robot_state.robot_mode is RobotMode.REFLEX


def test_a_position_command_stays_within_its_tracking_error_on_a_smooth_path(make_arm, claim) -> None:
    arm = make_arm()
    hw = arm.hw
    hw.do_switch([claim(PositionJointInterface)], [])
    group, worst = hw.get(PositionJointInterface).group(), [0.0]

    def law(time: float) -> None:
        worst[0] = max(worst[0], *(abs(a - b) for a, b in zip(hw.states.position, hw.robot_state.q_d, strict=True)))
        group.set_command([q + 0.2 * (1.0 - np.cos(2.0 * time)) for q in hw.q_start])

    arm.run(3.0, law)
    assert 1e-6 < worst[0] < 2e-3


def test_a_velocity_command_moves_the_arm_by_its_integral(managed) -> None:
    arm, manager = managed({"turn": {**VELOCITY, "command": [0.3, 0, 0, 0.1, 0, 0, -0.2]}})
    before = np.array(arm.hw.states.position)
    manager.switch(["turn"], [])
    arm.run(1.0)
    manager.switch([], ["turn"])
    arm.run(1.0)
    assert np.abs(np.array(arm.hw.states.position) - before - [0.3, 0, 0, 0.1, 0, 0, -0.2]).max() < 2e-3


def test_a_motion_against_an_obstacle_ends_in_a_collision_reflex_and_begins_anew_after_the_recovery(
    managed, claim
) -> None:
    arm, manager = managed({"turn": {**VELOCITY, "command": [0.5] + [0.0] * 6}})
    hw, law = arm.hw, manager._loaded["turn"].controller
    manager.switch(["turn"], [])
    arm.run(0.1)
    hw.plant.apply_wrench("panda_link8", (0.0, -100.0, 0.0), (0.0,) * 3, (0.0,) * 3, -1.0)
    arm.run(0.3)
    assert hw.robot_state.current_errors == frozenset(("cartesian_reflex",)) and hw.mode is HOLD
    with pytest.raises(HricError, match=r"error state; .*/error_recovery to end it. Reason: .*cartesian_reflex"):
        hw.prepare_switch([claim()], [])
    starts = law.starts
    hw.plant.clear_wrenches()
    arm.run(1.0)
    assert np.abs(hw.states.velocity).max() < 1e-3
    hw.recover()
    arm.run(0.3)
    assert hw.error == "" and law.starts == starts + 1
    assert hw.states.velocity[0] == pytest.approx(0.5, abs=0.02)


def test_without_a_command_position_and_velocity_modes_stay(managed) -> None:
    arm, manager = managed({"p": POSITION, "v": VELOCITY})
    for start, stop in (("p", []), ("v", ["p"])):
        manager.switch([start], stop)
        arm.run(0.3)
    assert np.abs(np.array(arm.hw.states.position) - arm.hw.q_start).max() < 1e-9


def test_the_first_effort_command_obeys_the_torque_rate_from_zero(managed) -> None:
    arm, manager = managed({"push": {**EFFORT, "command": [20.0, 0, 0, 0, 0, 0, 0]}})
    manager.switch(["push"], [])
    arm.run(0.003)
    kinds, raw, sent = arm.hw.log_row()
    assert kinds == ["effort"] * 7
    assert raw[0] == 20.0
    assert sent[0] == pytest.approx(3.0)
    assert arm.hw.robot_state.tau_J_d[0] == pytest.approx(3.0)
    assert arm.hw.limiter_counts().effort_rate[0] == 3


def test_a_torque_step_that_nothing_limits_is_a_reflex_by_name(managed) -> None:
    arm, manager = managed({"push": {**EFFORT, "command": [20.0, 0, 0, 0, 0, 0, 0]}}, {"enforce_limits": False})
    manager.switch(["push"], [])
    arm.run(0.005)
    assert arm.hw.robot_state.current_errors == frozenset(("controller_torque_discontinuity",))


def test_without_reflexes_the_arm_limits_what_it_can(managed) -> None:
    arm, manager = managed(
        {"push": {**EFFORT, "command": [20.0, 0, 0, 0, 0, 0, 0]}}, {"enforce_limits": False, "reflexes": False}
    )
    manager.switch(["push"], [])
    arm.run(0.003)
    assert arm.hw.log_row()[2][0] == 20.0
    assert arm.hw.robot_state.tau_J_d[0] == pytest.approx(3.0, rel=2e-3)


def test_the_log_says_none_while_the_arm_holds(make_arm) -> None:
    arm = make_arm()
    arm.run(0.002)
    assert arm.hw.log_row() == (["none"] * 7, [0.0] * 7, [0.0] * 7)


def test_reset_goes_back_to_the_start_and_restarts_controllers_while_time_goes_on(managed) -> None:
    arm, manager = managed({"push": {**EFFORT, "command": [3.0] * 7}})
    law = manager._loaded["push"].controller
    manager.switch(["push"], [])
    arm.run(0.2)
    assert abs(arm.hw.states.position[0]) > 1e-4
    arm.hw.reset()
    assert np.abs(np.array(arm.hw.states.position) - arm.hw.q_start).max() < 1e-12
    arm.run(0.001)
    assert law.starts == 2
    assert arm.hw.loop.time == pytest.approx(0.201)
    assert arm.hw.log_row()[2][0] == pytest.approx(1.0)


def test_set_configuration_moves_the_hold_with_it(make_arm) -> None:
    arm = make_arm()
    pose = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
    arm.hw.set_configuration(pose)
    arm.run(0.5)
    assert np.abs(np.array(arm.hw.states.position) - pose).max() < 1e-9


def test_limits_count_over_all_interfaces(managed) -> None:
    arm, manager = managed(
        {"fast": {**VELOCITY, "command": [5.0, 0, 0, 0, 0, 0, 0]}, "push": {**EFFORT, "command": [200.0] + [0.0] * 6}}
    )
    manager.switch(["push"], [])
    arm.run(0.01)
    manager.switch(["fast"], ["push"])
    arm.run(0.01)
    counts = arm.hw.limiter_counts()
    assert counts.velocity[0] >= 8
    assert counts.effort_rate[0] >= 9
    assert counts.cycles == 20
