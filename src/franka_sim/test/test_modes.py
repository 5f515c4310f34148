from __future__ import annotations

import numpy as np
import pytest

from franka_hw_interface.robot_state import RobotMode
from franka_sim.modes import Mode
from hric_control.controller import Controller
from hric_control.controller_manager import ControllerManager
from hric_control.errors import HricError, ResourceConflictError
from hric_control.hardware_interface import EffortJointInterface, PositionJointInterface, VelocityJointInterface


class Law(Controller):
    """Claims what its parameters say, writes a constant command."""

    def init(self, robot_hw, root_node, controller_node) -> None:
        interface = {cls.__name__: cls for cls in (EffortJointInterface, VelocityJointInterface, PositionJointInterface)}
        self.joints = robot_hw.get(interface[controller_node.param("interface")]).group(controller_node.param("joints", None))
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


EFFORT, VELOCITY, POSITION = ({"interface": cls.__name__} for cls in (EffortJointInterface, VelocityJointInterface, PositionJointInterface))
PARTIAL = {**EFFORT, "joints": ["panda_joint1", "panda_joint2"]}


def test_a_second_commander_is_refused_with_both_names(managed) -> None:
    arm, manager = managed({"a": EFFORT, "b": EFFORT, "c": POSITION})
    manager.switch(["a"], [])
    for other in ("b", "c"):
        with pytest.raises(ResourceConflictError, match=rf"panda_joint1 is claimed by both a and {other}"):
            manager.switch([other], [])
    assert arm.hw.mode is Mode.EFFORT
    manager.switch(["c"], ["a"])
    assert arm.hw.mode is Mode.POSITION


def test_a_claim_of_some_joints_only_is_refused_with_the_missing_ones(managed) -> None:
    arm, manager = managed({"part": PARTIAL})
    with pytest.raises(HricError, match=r"part claims 2 of the arm's 7 joints; .*missing panda_joint3, panda_joint4, .*panda_joint7"):
        manager.switch(["part"], [])
    assert arm.hw.mode is Mode.HOLD


def test_one_controller_with_two_kinds_of_command_is_refused(make_arm, claim) -> None:
    hw = make_arm().hw
    both = claim()
    both.claims.update(claim(PositionJointInterface).claims)
    with pytest.raises(HricError, match=r"law claims joints through .*EffortJointInterface and .*PositionJointInterface"):
        hw.prepare_switch([both], [])


def test_controllers_that_claim_nothing_leave_the_mode_alone(make_arm, claim) -> None:
    from hric_control.robot_hw import ControllerInfo

    hw, reader = make_arm().hw, ControllerInfo("reader", "test/Reader", {})
    hw.do_switch([claim()], [])
    hw.do_switch([reader], [])
    hw.do_switch([], [reader])
    assert hw.mode is Mode.EFFORT


def test_the_arm_holds_where_its_controller_stopped(managed) -> None:
    arm, manager = managed({"push": {**EFFORT, "command": [3.0, 0, 0, 0, 0, 0, 0.5]}})
    hw = arm.hw
    manager.switch(["push"], [])
    assert hw.robot_state.robot_mode is RobotMode.MOVE
    arm.run(0.4)
    speed = hw.states.velocity[0]
    assert speed > 0.05
    manager.switch([], ["push"])
    stopped = hw.states.position[:]
    arm.run(1.5)
    assert hw.robot_state.robot_mode is RobotMode.IDLE
    assert np.abs(np.array(hw.states.position) - stopped).max() < 1e-6
    assert np.abs(hw.states.velocity).max() < 1e-6


def test_the_arm_holds_when_its_controller_fails(managed) -> None:
    arm, manager = managed({"push": {**EFFORT, "command": [2.0] * 7, "fail_at": 0.1}})
    manager.switch(["push"], [])
    arm.run(1.5)
    assert arm.hw.mode is Mode.HOLD
    assert np.abs(arm.hw.states.velocity).max() < 1e-6
    assert [status.state for status in manager.list()] == ["aborted"]


def test_a_position_command_is_reached_at_the_velocity_limit_and_held(managed) -> None:
    start = [0.0, -0.7, 0.0, -2.2, 0.0, 1.6, 0.7]
    goal = [0.4, -0.5, -0.3, -2.0, 0.2, 1.4, 1.0]
    arm, manager = managed({"move": {**POSITION, "command": goal}}, {"q_start": start})
    manager.switch(["move"], [])
    arm.run(0.05)
    assert arm.hw.robot_state.dq_d[:3] == pytest.approx([2.175, 2.175, -2.175])
    arm.run(2.0)
    assert np.abs(np.array(arm.hw.states.position) - goal).max() < 1e-6
    assert sum(arm.hw.limiter_counts().velocity) > 0


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


def test_a_velocity_command_that_a_wrench_stops_does_not_wind_up(make_arm, claim) -> None:
    arm = make_arm()
    hw = arm.hw
    hw.do_switch([claim(VelocityJointInterface)], [])
    group = hw.get(VelocityJointInterface).group()
    hw.plant.set_brakes([True] * 7)
    arm.run(1.0, lambda time: group.set_command([0.5] * 7))
    assert np.abs(np.array(hw.robot_state.q_d) - hw.states.position).max() < 0.1


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


def test_without_limits_the_command_goes_through(managed) -> None:
    arm, manager = managed({"push": {**EFFORT, "command": [20.0, 0, 0, 0, 0, 0, 0]}}, {"enforce_limits": False})
    manager.switch(["push"], [])
    arm.run(0.001)
    assert arm.hw.log_row()[2][0] == 20.0


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
    assert arm.hw.log_row()[2][0] == 3.0
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
    arm, manager = managed({"fast": {**VELOCITY, "command": [5.0, 0, 0, 0, 0, 0, 0]}, "push": {**EFFORT, "command": [200.0] + [0.0] * 6}})
    manager.switch(["fast"], [])
    arm.run(0.01)
    manager.switch(["push"], ["fast"])
    arm.run(0.01)
    counts = arm.hw.limiter_counts()
    assert counts.velocity[0] >= 9
    assert counts.effort_rate[0] >= 9
    assert counts.cycles == 20
