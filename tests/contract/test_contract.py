"""Behaviour of the RobotHW of an arm on which controllers rely, tested on every backend."""

import threading

import numpy as np
import pytest
from driven_robot import JOINTS, READY, Broadcaster

from franka_hw_interface.interfaces import FrankaModelInterface, FrankaStateInterface
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import RobotMode
from franka_msgs.msg import ErrorRecoveryGoal
from franka_msgs.srv import SetLoadRequest
from hric_control.hardware_interface import (
    EffortJointInterface,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_core.errors import HricError, ResourceConflictError

ZERO = [0.0] * 7


def distance(a: list[float], b: list[float]) -> float:
    return max(abs(x - y) for x, y in zip(a, b, strict=True))


# -- interfaces --------------------------------------------------------------------------------------------------------


def test_it_offers_every_interface(robot) -> None:
    for interface in (JointStateInterface, EffortJointInterface, VelocityJointInterface, PositionJointInterface):
        assert robot.hw.get(interface).names == JOINTS
    assert robot.hw.get(FrankaStateInterface).names == ("panda_robot",)
    assert robot.hw.get(FrankaModelInterface).names == ("panda_model",)
    assert robot.hw.compensates_gravity


def test_state_joints_and_model_agree(robot) -> None:
    robot.run(0.05)
    state = robot.hw.get(FrankaStateInterface).handle("panda_robot").robot_state
    model = robot.hw.get(FrankaModelInterface).handle("panda_model")
    assert state.q == robot.positions
    assert state.robot_mode is RobotMode.IDLE
    assert np.allclose(np.array(state.O_T_EE).reshape(4, 4).T, model.pose(FrankaFrame.END_EFFECTOR), atol=1e-5)
    assert np.allclose(state.tau_J, model.gravity(), atol=0.2)
    assert state.m_ee == pytest.approx(0.73, abs=0.05)


# -- time --------------------------------------------------------------------------------------------------------------


def test_robot_time_never_goes_back(robot) -> None:
    robot.load("push", interface="effort", command=ZERO)
    robot.load("hold", interface="position", command="stay")
    robot.run(0.02)
    for start, stop in ((["push"], []), (["hold"], ["push"]), ([], ["hold"])):
        robot.switch(start, stop)
        robot.run(0.02)
    steps = np.diff(robot.times)
    assert robot.times[0] == 0.0
    assert steps.min() > 0.0
    assert np.median(steps) == pytest.approx(1e-3)


def test_a_motion_skips_no_millisecond(robot) -> None:
    robot.load("push", interface="effort", command=ZERO)
    robot.switch(["push"], [])
    robot.run(0.5)
    begin = robot.manager._loaded["push"].controller.calls[-1][1]
    during = [time for time in robot.times if time >= begin]
    assert np.diff(during) == pytest.approx(1e-3, abs=1e-9)


# -- life cycle --------------------------------------------------------------------------------------------------------


def test_a_controller_is_updated_each_cycle(robot) -> None:
    law = robot.load("law", interface="effort", command=ZERO)
    robot.switch(["law"], [])
    robot.run(0.1)
    assert law.updates >= 98
    robot.switch([], ["law"])
    updates = law.updates
    robot.run(0.05)
    assert law.updates == updates
    robot.manager.unload("law")
    names = [name for name, _ in law.calls]
    assert names[0] == "init" and names[-2:] == ["stopping", "shutdown"]
    assert names.count("starting") == names.count("stopping")


def test_a_claimless_controller_is_always_updated(robot) -> None:
    robot.node.set_param("ears", {"type": "test/Broadcaster"})
    robot.manager.load("ears")
    ears: Broadcaster = robot.manager._loaded["ears"].controller
    robot.load("law", interface="effort", command=ZERO)
    robot.switch(["ears"], [])
    robot.run(0.05)
    robot.switch(["law"], [])
    robot.run(0.05)
    robot.switch([], ["law"])
    robot.run(0.05)
    assert ears.times == robot.times


def test_an_early_stop_ends_one_run(robot) -> None:
    robot.hw.stop()
    robot.run(0.05)
    assert robot.times == []
    robot.run(0.05)
    first = len(robot.times)
    robot.run(0.05)
    assert first <= 51 and robot.times[first - 1] - robot.times[0] >= 0.045  # states may be lost at rest
    assert robot.times[first] > robot.times[first - 1]


# -- holding -----------------------------------------------------------------------------------------------------------


def test_nobody_commanding_the_arm_holds(robot) -> None:
    robot.run(0.01)
    before = robot.positions
    robot.run(0.5)
    assert distance(robot.positions, before) < 1e-5


@pytest.mark.parametrize(
    ("interface", "command"), [("effort", ZERO), ("velocity", ZERO), ("position", "stay"), ("position", None)]
)
def test_a_command_of_nothing_moves_nothing(robot, interface, command) -> None:
    robot.run(0.01)
    before = robot.positions
    robot.load("law", interface=interface, command=command)
    robot.switch(["law"], [])
    robot.run(0.5)
    assert robot.hw.robot_state.robot_mode is RobotMode.MOVE or robot.hw.robot_state.robot_mode is RobotMode.IDLE
    assert distance(robot.positions, before) < 1e-4


def test_a_failed_controller_leaves_the_arm_holding(robot) -> None:
    robot.node.set_param("ears", {"type": "test/Broadcaster"})
    robot.manager.load("ears")
    robot.load("law", interface="velocity", command=[0.05] + [0.0] * 6, fail_at=0.1)
    robot.switch(["law", "ears"], [])
    robot.run(0.5)
    assert {status.name: status.state for status in robot.manager.list()} == {"law": "aborted", "ears": "running"}
    before = robot.positions
    robot.run(0.3)
    assert distance(robot.positions, before) < 1e-4
    assert robot.manager._loaded["ears"].controller.times == robot.times


# -- switching ---------------------------------------------------------------------------------------------------------


def test_all_kinds_of_controllers_switch(robot) -> None:
    robot.load("push", interface="effort", command=ZERO)
    robot.load("turn", interface="velocity", command=ZERO)
    robot.load("hold", interface="position", command="stay")
    failures: list[BaseException] = []

    def switches() -> None:
        try:
            for start, stop in (("push", []), ("turn", ["push"]), ("hold", ["turn"]), ("push", ["hold"])):
                robot.manager.switch([start], stop)
            robot.manager.switch([], ["push"])
        except BaseException as error:
            failures.append(error)
        finally:
            robot.hw.stop()

    thread = threading.Thread(target=switches)
    thread.start()
    robot.run(60.0)
    thread.join(10.0)
    assert not failures
    states = {name: robot.manager._loaded[name].controller.calls for name in ("push", "turn", "hold")}
    assert all(calls[-1][0] == "stopping" for calls in states.values())
    assert np.diff(robot.times).min() > 0.0


def test_a_velocity_moves_its_joint_only(robot) -> None:
    robot.run(0.01)
    before = robot.positions
    steps = 400

    def command(time: float) -> None:
        wanted = 0.2 * 0.5 * (1.0 - np.cos(2.0 * np.pi * min(len(robot.times) - first, steps) / steps))
        law.command = [0.0] * 6 + [float(wanted)]

    law = robot.load("turn", interface="velocity", command=ZERO)
    robot.switch(["turn"], [])
    first = len(robot.times) + 50
    robot.run(0.7, lambda time: command(time) if len(robot.times) >= first else None)
    assert robot.positions[6] - before[6] == pytest.approx(0.2 * 0.5 * steps * 1e-3, abs=2e-3)
    assert distance(robot.positions[:6], before[:6]) < 1e-3


def test_a_second_commander_is_refused(robot) -> None:
    law = robot.load("a", interface="effort", command=ZERO)
    for name, interface in (("b", "effort"), ("c", "position")):
        robot.load(name, interface=interface, command=None)
    robot.switch(["a"], [])
    for other in ("b", "c"):
        with pytest.raises(ResourceConflictError, match=rf"both a and {other}"):
            robot.manager.switch([other], [])
    robot.run(0.05)
    assert law.updates > 40


def test_a_partial_claim_is_refused(robot) -> None:
    robot.load("part", interface="effort", joints=list(JOINTS[:2]))
    with pytest.raises(HricError, match=r"part claims 2 of the arm's 7 joints; .*missing panda_joint3"):
        robot.manager.switch(["part"], [])


# -- moving ------------------------------------------------------------------------------------------------------------


def test_a_pd_move_ends_at_its_setpoint(robot) -> None:
    goal = [value + 0.1 for value in READY]
    gains = {
        "kp": 100.0,
        "kd": 20.0,
        "profile": {"enabled": True, "velocity": 0.5, "acceleration": 1.0},
        "gain_ramp": 0.0,
    }
    robot.load(
        "pd", **{"type": "hric_controllers/JointPDController", "joints": list(JOINTS), "setpoint": goal, **gains}
    )
    robot.switch(["pd"], [])
    robot.run(3.0)
    assert robot.hw.robot_state.robot_mode is not RobotMode.REFLEX
    assert distance(robot.positions, goal) < 1e-3
    robot.switch([], ["pd"])
    robot.run(0.2)
    assert distance(robot.positions, goal) < 1e-3


def test_the_log_has_requested_and_sent_commands(robot) -> None:
    robot.run(0.005)
    kinds, raw, sent = robot.hw.log_row()
    assert (list(kinds), list(raw), list(sent)) == (["none"] * 7, ZERO, ZERO)
    robot.load("push", interface="effort", command=[0.0] * 6 + [3.5])
    robot.switch(["push"], [])
    rows: dict[float, tuple[float, float]] = {}
    robot.run(0.02, lambda time: rows.update({time: (robot.hw.log_row()[1][6], robot.hw.log_row()[2][6])}))
    asked = [sent for raw, sent in rows.values() if raw == 3.5]
    assert asked[:4] == pytest.approx([1.0, 2.0, 3.0, 3.5])
    assert robot.hw.log_row()[0] == ["effort"] * 7
    assert robot.hw.limiter_counts().effort_rate[6] == 3


# -- commands to the arm -----------------------------------------------------------------------------------------------


def test_a_set_load_reaches_state_and_model(robot) -> None:
    model = robot.hw.get(FrankaModelInterface).handle("panda_model")
    robot.run(0.01)
    before = model.gravity()[3]
    inertia = [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01]
    for mass in (1.5, 0.0):
        response = robot.node.call(
            "franka_control/set_load", SetLoadRequest(mass, [0.0, 0.0, 0.1], [value * mass for value in inertia])
        )
        assert (response.success, response.error) == (True, "")
        robot.run(0.02)
        assert robot.hw.robot_state.m_load == mass
        assert abs(model.gravity()[3] - before) == pytest.approx(mass * 9.81 * 0.5, rel=0.5, abs=0.05)
    refused = robot.node.call("franka_control/set_load", SetLoadRequest(-1.0, ZERO[:3], ZERO + ZERO[:2]))
    assert not refused.success and "must not be negative" in refused.error


def test_a_recovery_with_nothing_to_recover_from_succeeds(robot) -> None:
    robot.run(0.01)
    goal = robot.node.send_goal("franka_control/error_recovery", ErrorRecoveryGoal())
    assert (goal.status, goal.text) == ("SUCCEEDED", "")


def test_after_shutdown_nothing_of_it_is_offered(connect) -> None:
    robot = connect()
    services = robot.node.services()
    assert {
        f"/franka_control/set_{name}"
        for name in ("load", "EE_frame", "K_frame", "joint_impedance", "cartesian_impedance")
    } <= set(services)
    robot.close()
    assert not [name for name in robot.node.services() if "franka_control" in name]
    assert not [name for name in robot.node.topics() if "error_recovery" in name]
    robot.close = lambda: None
