"""Gripper in the bring-up: its actions, and its fingers in joint_states, in simulation and through libfranka."""

import json
from collections.abc import Callable

import pytest
from actionlib_msgs.msg import GoalStatus
from fci_peer import control_box
from live_system import ROOT, LiveSystem

pytestmark = pytest.mark.alone

CLIENT = ROOT / "tests/integration/gripper_client.py"


def check(system: LiveSystem) -> None:
    """Check that all goals ended as expected."""
    done = system.run("python3", str(CLIENT), timeout=120.0)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{system.output}"
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["ended"] == {
        "homing": [GoalStatus.SUCCEEDED, True],
        "move": [GoalStatus.SUCCEEDED, True],
        "grasp of nothing": [GoalStatus.SUCCEEDED, False],
        "gripper_action": [GoalStatus.SUCCEEDED, True],
        "stop": [GoalStatus.SUCCEEDED, True],
        "stopped move": [GoalStatus.ABORTED, False],
    }
    lowest, highest, last = found["fingers"]
    assert lowest == pytest.approx(0.0, abs=2e-3) and highest == pytest.approx(0.04, abs=1e-3), (
        "homing closes and opens"
    )
    assert 0.02 < last < 0.03, "stopped on its way from 3 cm to 0.5 cm"
    assert found["frames"] == pytest.approx([last, last], abs=1e-4), "both fingers move in tf"
    assert "not found in URDF" not in system.output


def test_the_emulated_hand_of_the_simulation(live: LiveSystem) -> None:
    check(live)


def test_the_hand_of_the_control_box_through_libfranka(start: Callable[..., LiveSystem]) -> None:
    with control_box() as (ip, _):
        system = start("env:=real", f"robot_ip:={ip}", "rviz:=false", "record:=false")
        system.wait_running("joint_pd_controller")
        check(system)
        system.interrupt()
        assert "Traceback" not in system.output
