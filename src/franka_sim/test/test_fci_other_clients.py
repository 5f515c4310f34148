"""Unmodified clients of other authors take the emulated box for an arm: franka-rs, which has its own code of the
protocol (versions 5 and 10), and franky, with libfranka 0.21.2."""

import json
import subprocess
import sys

import pytest
from fci_peer import PATIENCE, control_box, run_client

pytestmark = pytest.mark.alone

ROBOTS = pytest.mark.parametrize("robot", ["panda", "fr3"])
RS = """
import json, sys, time
import franka
robot = franka.Robot(sys.argv[1], realtime="ignore")
def until(arm, there, seconds=10.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end and not there(arm.state()):
        time.sleep(0.02)
    return arm.state()
"""
RS_MOVES = (
    RS
    + """
start = robot.read_once()
result = {"version": robot.fci_version}
gravity = robot.model().gravity(start.q, start.m_total, start.F_x_Ctotal)
result["gravity"] = max(abs(a - b) for a, b in zip(gravity, start.tau_J))
for backend in ("impedance", "robot"):
    with robot.joint_targets(fraction=0.3, backend=backend) as arm:
        q = list(arm.state().q)
        arm.move_by([0, 0, 0, 0.2, 0, 0, 0])
        state = until(arm, lambda state: abs(state.q[3] - q[3] - 0.2) < 1e-3)
        result["joint targets, " + backend] = [state.q[3] - q[3], state.control_command_success_rate]
    with robot.cartesian_targets(max_velocity=0.3, backend=backend) as arm:
        p = arm.state().O_T_EE[:3, 3].copy()
        arm.move_by([0.0, 0.0, -0.05])
        state = until(arm, lambda state: abs(state.O_T_EE[2, 3] - p[2] + 0.05) < 1e-3)
        result["Cartesian targets, " + backend] = [state.O_T_EE[2, 3] - p[2], state.control_command_success_rate]
hand = robot.gripper()
result["hand"] = [hand.homing(), hand.move(0.05, 0.1), round(hand.read_once().width, 6)]
result["mode"] = robot.read_once().robot_mode
print(json.dumps(result))
"""
)
RS_REFLEX = (
    RS
    + """
robot.set_collision_behavior_simple([5.0] * 7, [10.0] * 7, [5.0] * 6, [10.0] * 6)
try:
    with robot.joint_targets() as arm:
        print("runs", flush=True)
        while arm.running:
            time.sleep(0.02)
except franka.ControlException as error:
    print(error.reason, error.errors)
print(robot.read_once().robot_mode, robot.read_once().last_motion_errors)
robot.automatic_error_recovery()
robot.read_once()
print(robot.read_once().robot_mode)
"""
)
FRANKY = """
import json, sys
from franky import Affine, CartesianMotion, Gripper, JointMotion, RealtimeConfig, ReferenceType, Robot
robot = Robot(sys.argv[1], realtime_config=RealtimeConfig.Ignore)
robot.relative_dynamics_factor = 0.2
def settled():
    for _ in range(300):
        state = robot.state
    return state
start = settled()
robot.move(JointMotion([*start.q[:3], start.q[3] + 0.2, *start.q[4:]]))
bent = settled()
robot.move(CartesianMotion(Affine([0.0, 0.0, -0.05]), ReferenceType.Relative))
raised = settled()
back = [sum(bent.O_T_EE.matrix[i][j] * (raised.O_T_EE.translation - bent.O_T_EE.translation)[i] for i in range(3)) for j in range(3)]
hand = Gripper(sys.argv[1])
print(json.dumps([list(bent.q - start.q), back, hand.homing(), hand.move(0.05, 0.1), hand.width]))
"""  # noqa: E501


@ROBOTS
def test_franka_rs_moves_joints_end_effector_and_hand_with_its_model_of_the_arm(robot: str) -> None:
    pytest.importorskip("franka")
    with control_box("--robot", robot, "--no-collision") as (ip, _):
        result = json.loads(run_client(RS_MOVES, ip))
    assert result.pop("version") == (5 if robot == "panda" else 10)
    # The FR3 sends its description; for the Panda the client has inertial parameters of its own.
    assert result.pop("gravity") < (0.1 if robot == "panda" else 1e-3)
    assert result.pop("mode") == "idle"
    assert result.pop("hand") == [True, True, 0.05]
    for name, (moved, rate) in result.items():
        assert moved == pytest.approx(0.2 if name.startswith("joint") else -0.05, abs=2e-3), name
        assert rate == 1.0, name
    assert len(result) == 4


@ROBOTS
def test_franka_rs_names_the_reflex_of_a_push_and_recovers(robot: str) -> None:
    pytest.importorskip("franka")
    with (
        control_box("--robot", robot, "--no-collision", "--console") as (ip, process),
        subprocess.Popen([sys.executable, "-c", RS_REFLEX, ip], stdout=subprocess.PIPE, text=True) as client,
    ):
        try:
            assert client.stdout is not None and client.stdout.readline() == "runs\n"
            assert process.stdin is not None
            process.stdin.write(f"push {robot}_link7 0 0 -300 1\n")
            process.stdin.flush()
            lines = client.communicate(timeout=PATIENCE)[0].splitlines()
        finally:
            client.kill()
    assert "reflex" in lines[0] and lines[1].startswith("reflex ["), lines
    assert all("joint_reflex" in line or "cartesian_reflex" in line for line in lines[:2])
    assert lines[2] == "idle"


def test_franky_moves_joints_end_effector_and_hand() -> None:
    pytest.importorskip("franky")
    with control_box("--robot", "fr3", "--no-collision") as (ip, _):
        joints, back, *hand = json.loads(run_client(FRANKY, ip))
    assert joints == pytest.approx([0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0], abs=1e-4)
    assert back == pytest.approx([0.0, 0.0, -0.05], abs=1e-4)
    assert hand == [True, True, pytest.approx(0.05)]
