"""The controller manager over its services and command-line tools, as existing tools of ros_control use it."""

from __future__ import annotations

import pytest
import rospy
from controller_manager_msgs.srv import ListControllers, ListControllerTypes, LoadController, SwitchController, SwitchControllerRequest, UnloadController
from live_system import LiveSystem, wait_for
from sensor_msgs.msg import JointState

STRICT = SwitchControllerRequest.STRICT
EFFORT, POSITION, PD = "effort_joint_trajectory_controller", "position_joint_trajectory_controller", "joint_pd_controller"


def states() -> dict[str, str]:
    return {item.name: item.state for item in rospy.ServiceProxy("/controller_manager/list_controllers", ListControllers)().controller}


def switch(start: list[str], stop: list[str]) -> bool:
    proxy = rospy.ServiceProxy("/controller_manager/switch_controller", SwitchController)
    return bool(proxy(start_controllers=start, stop_controllers=stop, strictness=STRICT, start_asap=False, timeout=0.0).ok)


def position() -> tuple[float, ...]:
    return tuple(rospy.wait_for_message("/joint_states", JointState, timeout=10.0).position[:7])


@pytest.fixture(autouse=True)
def pd_runs_afterwards(live: LiveSystem):
    yield
    running = [name for name, state in states().items() if state == "running" and name in (EFFORT, POSITION)]
    if states()[PD] != "running" or running:
        assert switch([PD] if states()[PD] != "running" else [], running)


def test_rosservice_lists_the_controllers_with_their_claims(live: LiveSystem) -> None:
    listed = live.run("rosservice", "call", "/controller_manager/list_controllers").stdout
    assert "joint_pd_controller" in listed and "hardware_interface::EffortJointInterface" in listed and "panda_joint7" in listed
    assert states()[EFFORT] in ("initialized", "stopped") and states()[POSITION] in ("initialized", "stopped")


def test_rosservice_lists_the_types_under_their_own_and_their_usual_names(live: LiveSystem) -> None:
    types = rospy.ServiceProxy("/controller_manager/list_controller_types", ListControllerTypes)().types
    assert {"hric_controllers/JointPDController", "effort_controllers/JointTrajectoryController", "joint_state_controller/JointStateController"} <= set(types)


def test_a_switch_by_rosservice_changes_the_running_controller_and_the_arm_stays(live: LiveSystem) -> None:
    before = position()
    request = f"{{start_controllers: [{EFFORT}], stop_controllers: [{PD}], strictness: 2, start_asap: false, timeout: 0.0}}"
    assert "ok: True" in live.run("rosservice", "call", "/controller_manager/switch_controller", request).stdout
    assert (states()[EFFORT], states()[PD]) == ("running", "stopped")
    rospy.sleep(1.0)
    assert position() == pytest.approx(before, abs=2e-3)


def test_a_switch_that_claims_a_joint_twice_is_refused_with_both_names(live: LiveSystem) -> None:
    before = position()
    assert not switch([EFFORT], [])
    assert (states()[PD], states()[EFFORT] == "running") == ("running", False)
    wait_for(lambda: any(PD in line and EFFORT in line and "panda_joint1" in line for line in live.output.splitlines()), 5.0, "both names in the log")
    assert position() == pytest.approx(before, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "parameters", "texts"),
    [
        ("no_such_controller", {}, ("no_such_controller", "type")),
        ("wrong_type", {"type": "hric_controllers/JointPdController"}, ("hric_controllers/JointPdController", "hric_controllers/JointPDController")),
        ("wrong_joints", {"type": "hric_controllers/JointPDController", "joints": ["panda_joint1", "elbow"], "kp": 1.0, "kd": 1.0}, ("elbow", "panda_joint2")),
        ("bad_gain", {"type": "hric_controllers/JointPDController", "joints": ["panda_joint1"], "kp": -1.0, "kd": 1.0}, ("bad_gain/kp", "-1")),
    ],
)
def test_a_controller_that_cannot_be_loaded_gives_one_clear_error(live: LiveSystem, name: str, parameters: dict[str, object], texts: tuple[str, ...]) -> None:
    before, printed = position(), len(live.output)
    for key, value in parameters.items():
        rospy.set_param(f"/{name}/{key}", value)
    assert not rospy.ServiceProxy("/controller_manager/load_controller", LoadController)(name).ok
    wait_for(lambda: all(text in live.output[printed:] for text in texts), 5.0, f"{texts} in the log:\n{live.output[printed:]}")
    assert live.output[printed:].count("[ERROR]") == 1
    assert "Traceback" not in live.output[printed:]
    assert name not in states()
    assert position() == pytest.approx(before, abs=1e-4)


def test_a_running_controller_is_not_unloaded(live: LiveSystem) -> None:
    assert not rospy.ServiceProxy("/controller_manager/unload_controller", UnloadController)(PD).ok
    assert states()[PD] == "running"


def test_the_command_line_tool_lists_stops_and_starts(live: LiveSystem) -> None:
    listed = live.run("rosrun", "controller_manager", "controller_manager", "list")
    assert PD in listed.stdout and "running" in listed.stdout
    assert live.run("rosrun", "controller_manager", "controller_manager", "stop", PD).returncode == 0
    assert states()[PD] == "stopped"
    assert live.run("rosrun", "controller_manager", "controller_manager", "start", PD).returncode == 0
    assert states()[PD] == "running"


def test_unspawner_and_spawner_take_a_controller_down_and_up(live: LiveSystem) -> None:
    assert live.run("rosrun", "controller_manager", "unspawner", EFFORT).returncode == 0
    assert EFFORT not in states() or states()[EFFORT] == "stopped"
    refused = live.run("rosrun", "controller_manager", "spawner", "--timeout", "5", "no_such_controller", timeout=60.0)
    assert refused.returncode != 0
    assert "Traceback" not in refused.stdout + refused.stderr
