"""The arm through libfranka, on an emulated control box in another process: what the contract suite cannot ask of a
robot in process."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pinocchio
import pytest
from driven_robot import JOINTS, QUIET, Law, Robot
from fci_peer import control_box

import panda_description
from franka_hw_interface.interfaces import (
    FrankaModelInterface,
    FrankaPoseCartesianInterface,
    FrankaVelocityCartesianInterface,
)
from franka_hw_interface.modes import HOLD
from franka_hw_interface.robot_state import RobotMode
from franka_msgs.msg import ErrorRecoveryGoal
from franka_msgs.srv import SetEEFrameRequest, SetJointImpedanceRequest, SetKFrameRequest, SetLoadRequest
from franka_real.franka_hw import FrankaHW
from hric_control.hardware_interface import EffortJointInterface, PositionJointInterface
from hric_control.robot_hw import ControllerInfo
from hric_core import plugins
from hric_core.errors import HricError

ROBOTS = ("panda", "fr3")
UNLIMITED = {"rate_limiting": False, "cutoff_frequency": 1000.0, "enforce_limits": False}
JUMP = [0.0] * 6 + [8.0]
YAW = np.array([[0.0, -1, 0, 0.01], [1, 0, 0, 0.02], [0, 0, 1, 0.03], [0, 0, 0, 1]])


@pytest.fixture(scope="module")
def boxes() -> Iterator[dict[str, tuple[str, Any]]]:
    with ExitStack() as stack:
        words = ("--no-collision", "--real-time-factor", "0", "--console")
        yield {robot: stack.enter_context(control_box("--robot", robot, *words)) for robot in ROBOTS}


@pytest.fixture(params=ROBOTS)
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def connect(kind: str, boxes: dict[str, tuple[str, Any]]) -> Iterator[Callable[..., Robot]]:
    """Provide connect(**parameters), which returns a connected arm without errors."""
    with ExitStack() as stack:

        def make(**parameters: Any) -> Robot:
            robot = Robot(FrankaHW(), {"robot": {"robot_ip": boxes[kind][0], "robot": kind, **QUIET, **parameters}})
            stack.callback(robot.close)
            assert recover(robot).status == "SUCCEEDED"
            robot.run(0.01)
            return robot

        yield make


def recover(robot: Robot) -> Any:
    return robot.node.send_goal("franka_control/error_recovery", ErrorRecoveryGoal())


def order(boxes: dict[str, tuple[str, Any]], kind: str, text: str) -> None:
    """Write a command to the console of the control box."""
    process = boxes[kind][1]
    process.stdin.write(text + "\n")
    process.stdin.flush()


def test_it_is_found_by_its_plugin_name() -> None:
    assert plugins.find(plugins.ROBOT_HW, "franka_real/FrankaHW") is FrankaHW


# -- errors ------------------------------------------------------------------------------------------------------------


def test_a_reflex_is_named_refuses_motion_and_after_the_recovery_the_controller_starts_anew(connect, caplog) -> None:
    robot = connect(**UNLIMITED)
    law = robot.load("jump", interface="effort", command=JUMP)
    robot.switch(["jump"], [])
    robot.run(0.1)
    hw = robot.hw
    assert "controller_torque_discontinuity" in hw.error
    assert "controller_torque_discontinuity" in caplog.text
    assert hw.robot_state.robot_mode is RobotMode.REFLEX
    assert "controller_torque_discontinuity" in hw.robot_state.current_errors | hw.robot_state.last_motion_errors
    assert hw.log_row()[0] == ["none"] * 7
    updates = law.updates
    robot.run(0.05)
    assert law.updates > updates
    robot.switch([], ["jump"])
    with pytest.raises(HricError, match=r"error state.*error_recovery.*controller_torque_discontinuity"):
        robot.manager.switch(["jump"], [])
    assert recover(robot).status == "SUCCEEDED"
    assert hw.error == ""
    law.command = [0.0] * 7
    starts = [name for name, _ in law.calls].count("starting")
    robot.switch(["jump"], [])
    robot.run(0.1)
    assert hw.robot_state.robot_mode is RobotMode.MOVE and hw.robot_state.current_errors == frozenset()
    assert [name for name, _ in law.calls].count("starting") > starts


def test_a_controller_that_stays_started_moves_the_arm_again_after_the_recovery(connect) -> None:
    robot = connect(**UNLIMITED)
    law = robot.load("jump", interface="effort", command=JUMP)
    robot.switch(["jump"], [])
    robot.run(0.05)
    starts, law.command = [name for name, _ in law.calls].count("starting"), [0.0] * 7
    assert recover(robot).status == "SUCCEEDED"
    robot.run(0.1)
    assert robot.hw.robot_state.robot_mode is RobotMode.MOVE
    assert [name for name, _ in law.calls].count("starting") == starts + 1


def test_a_user_stop_ends_the_motion_and_recovery_waits_for_its_release(connect, kind, boxes) -> None:
    robot = connect()
    robot.load("push", interface="effort", command=[0.0] * 7)
    robot.switch(["push"], [])
    order(boxes, kind, "user_stop on")
    robot.run(30.0, lambda time: robot.hw.stop() if robot.hw.error else None)
    assert robot.hw.error
    robot.run(0.05)
    assert robot.hw.robot_state.robot_mode is RobotMode.USER_STOPPED
    refused = recover(robot)
    assert refused.status == "ABORTED" and "mode" in refused.text
    order(boxes, kind, "user_stop off")
    robot.run(
        30.0, lambda time: robot.hw.stop() if robot.hw.robot_state.robot_mode is not RobotMode.USER_STOPPED else None
    )
    assert recover(robot).status == "SUCCEEDED"
    robot.run(0.05)
    assert robot.hw.robot_state.robot_mode is RobotMode.MOVE


# -- modes -------------------------------------------------------------------------------------------------------------


def test_a_cartesian_velocity_moves_the_end_effector_by_its_integral(connect) -> None:
    robot = connect()
    hw, node = robot.hw, robot.node
    handle = hw.get(FrankaVelocityCartesianInterface).handle("panda_robot")
    before, n = list(hw.robot_state.O_T_EE[12:15]), [0]

    def law(time: float) -> None:
        n[0] += hw.mode.commanded
        handle.set_command([0.0, 0.0, 0.05 * (1.0 - np.cos(2.0 * np.pi * min(n[0], 600) / 600)), 0.0, 0.0, 0.0])

    claim_arm(robot, FrankaVelocityCartesianInterface)
    robot.run(0.8, law)
    assert hw.error == ""
    assert hw.robot_state.O_T_EE[14] - before[2] == pytest.approx(0.05 * 0.6, abs=3e-3)
    assert np.allclose(hw.robot_state.O_T_EE[12:14], before[:2], atol=3e-3)
    assert node.namespace == "/" and hw.log_row()[0] == ["none"] * 7


def test_a_cartesian_pose_begins_where_the_arm_is_and_leads_it(connect) -> None:
    robot = connect()
    hw = robot.hw
    handle, start, n = hw.get(FrankaPoseCartesianInterface).handle("panda_robot"), [], [0]

    def law(time: float) -> None:
        if hw.mode.commanded:
            if not start:
                start[:] = handle.command[0]
            n[0] += 1
            pose = start[:]
            pose[13] += 0.02 * (1.0 - np.cos(np.pi * min(n[0], 800) / 800)) / 2.0
            handle.set_command(pose)

    before = list(hw.robot_state.O_T_EE[12:15])
    claim_arm(robot, FrankaPoseCartesianInterface)
    robot.run(1.0, law)
    assert hw.error == ""
    assert hw.robot_state.O_T_EE[13] - before[1] == pytest.approx(0.02, abs=2e-3)


def claim_arm(robot: Robot, interface: Any) -> None:
    """Have a controller claim the arm by a Cartesian interface."""

    class Claims(Law):
        def init(self, robot_hw: Any, root_node: Any, controller_node: Any) -> None:
            robot_hw.get(interface).handle("panda_robot")
            self.command, self.fail_at, self.calls = None, 1e9, []

    robot.manager._classes["test/Claims"] = Claims
    robot.node.set_param("claims", {"type": "test/Claims"})
    robot.manager.load("claims")
    robot.switch(["claims"], [])


def test_torque_together_with_a_motion_generator_runs_where_libfranka_has_it(connect, kind) -> None:
    class Both(Law):
        def init(self, robot_hw: Any, root_node: Any, controller_node: Any) -> None:
            self.joints, self.positions = (
                robot_hw.get(EffortJointInterface).group(),
                robot_hw.get(PositionJointInterface).group(),
            )
            self.command, self.fail_at, self.calls = [0.0] * 7, 1e9, []

    robot = connect()
    robot.manager._classes["test/Both"] = Both
    robot.node.set_param("both", {"type": "test/Both"})
    robot.manager.load("both")
    if kind == "fr3":
        with pytest.raises(HricError, match=r"the FR3 cannot be commanded by joint torque \+ position"):
            robot.switch(["both"], [])
        return
    robot.switch(["both"], [])
    robot.run(0.2)
    assert robot.hw.error == "" and robot.hw.log_row()[0] == ["effort"] * 7
    assert robot.manager._loaded["both"].controller.updates > 150


def test_two_motion_generators_at_once_are_refused(connect) -> None:
    claims = {f"hardware_interface::{name}JointInterface": frozenset(JOINTS) for name in ("Position", "Velocity")}
    with pytest.raises(HricError, match="one motion generator at a time"):
        connect().hw.prepare_switch([ControllerInfo("both", "test/Both", claims)], [])


# -- settings of the arm ----------------------------------------------------------------------------------------------


def test_frames_that_are_set_are_in_the_state_and_in_the_model(connect) -> None:
    robot = connect()
    hw, values = robot.hw, YAW.T.ravel().tolist()
    F_T_NE = np.array(hw.robot_state.F_T_NE).reshape(4, 4).T
    assert robot.node.call("franka_control/set_EE_frame", SetEEFrameRequest(values)).success
    assert robot.node.call("franka_control/set_K_frame", SetKFrameRequest(values)).success
    robot.run(0.02)
    state = hw.robot_state
    assert np.allclose(state.NE_T_EE, values, atol=1e-6) and np.allclose(state.EE_T_K, values, atol=1e-6)
    assert np.allclose(np.array(state.F_T_NE).reshape(4, 4).T, F_T_NE, atol=1e-6)
    assert np.allclose(np.array(state.F_T_EE).reshape(4, 4).T, hw.model.F_T_EE, atol=1e-6)
    for name, request in (("EE", SetEEFrameRequest), ("K", SetKFrameRequest)):
        assert robot.node.call(f"franka_control/set_{name}_frame", request(np.eye(4).ravel().tolist())).success


def test_a_setting_that_the_arm_refuses_while_it_moves_fails_with_libfrankas_words(connect) -> None:
    robot = connect()
    robot.load("push", interface="effort", command=[0.0] * 7)
    robot.switch(["push"], [])
    answers: list[Any] = []

    def ask(time: float) -> None:
        if robot.hw.mode != HOLD and not answers:
            answers.append(
                robot.node.call("franka_control/set_joint_impedance", SetJointImpedanceRequest([1000.0] * 7))
            )

    robot.run(0.1, ask)
    assert not answers[0].success and "current mode" in answers[0].error and "libfranka" not in answers[0].error
    assert robot.hw.error == ""
    robot.switch([], ["push"])
    robot.run(0.02)
    assert robot.node.call("franka_control/set_joint_impedance", SetJointImpedanceRequest([1000.0] * 7)).success


@pytest.mark.parametrize("model", ["kdl", "libfranka"])
def test_controllers_get_the_requested_model_with_the_load_that_is_set(connect, model) -> None:
    robot = connect(model=model)
    handle = robot.hw.get(FrankaModelInterface).handle("panda_model")
    assert (type(robot.hw.get(FrankaModelInterface).model).__name__ == "LibfrankaModel") == (model == "libfranka")
    before = handle.gravity().copy()
    assert np.allclose(before, robot.hw.model.gravity(robot.positions), atol=1e-3)
    assert robot.node.call(
        "franka_control/set_load", SetLoadRequest(1.0, [0.0, 0.0, 0.1], [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01])
    ).success
    robot.run(0.002)
    assert np.abs(handle.gravity() - before).max() > 1.0
    assert robot.node.call("franka_control/set_load", SetLoadRequest(0.0, [0.0] * 3, [0.0] * 9)).success


def test_a_base_that_is_mounted_at_an_angle_turns_the_gravity_of_the_pandas_own_model_too(boxes) -> None:
    tilted = panda_description.load(meshes=False, collision=False, rpy="0 0.5 0")
    own = {"robot_ip": boxes["panda"][0], "robot": "panda", "model": "libfranka", **QUIET}
    robot = Robot(FrankaHW(), {"robot_description": tilted, "robot": own})
    try:
        model, q = robot.hw.get(FrankaModelInterface).model, robot.positions
        assert type(model).__name__ == "LibfrankaModel"
        assert model.gravity_base == pytest.approx([9.81 * np.sin(0.5), 0.0, -9.81 * np.cos(0.5)], abs=1e-9)
        pin = pinocchio.buildModelFromXML(tilted)
        expected = pinocchio.computeGeneralizedGravity(pin, pin.createData(), np.array(q))
        assert np.allclose(model.gravity(q), expected, atol=1e-4)
        assert np.abs(model.gravity(q, [0.0, 0.0, -9.81]) - expected).max() > 1.0
    finally:
        robot.close()


def test_an_error_of_the_loop_itself_reaches_the_caller_and_the_arm_can_be_used_again(connect) -> None:
    robot = connect()
    robot.load("push", interface="effort", command=[0.0] * 7)
    robot.switch(["push"], [])

    def fail(time: float) -> None:
        if robot.hw.mode.commanded:
            raise ZeroDivisionError("a bug")

    with pytest.raises(ZeroDivisionError, match="a bug"):
        robot.run(0.1, fail)
    assert recover(robot).status == "SUCCEEDED"
    robot.run(0.1)
    assert robot.hw.robot_state.robot_mode is RobotMode.MOVE
