"""Controller manager used through its services and command-line tools, like by existing tools of ros_control."""

import contextlib
import os
import signal
from pathlib import Path

import pytest
import rospy
from live_system import LiveSystem, wait_for
from sensor_msgs.msg import JointState

from controller_manager_msgs.srv import (
    ListControllers,
    ListControllerTypes,
    LoadController,
    SwitchController,
    SwitchControllerRequest,
    UnloadController,
)
from hric_core import processes

pytestmark = pytest.mark.alone

STRICT = SwitchControllerRequest.STRICT
EFFORT, POSITION, PD = (
    "effort_joint_trajectory_controller",
    "position_joint_trajectory_controller",
    "joint_pd_controller",
)


def states() -> dict[str, str]:
    return {
        item.name: item.state
        for item in rospy.ServiceProxy("/controller_manager/list_controllers", ListControllers)().controller
    }


def switch(start: list[str], stop: list[str]) -> bool:
    proxy = rospy.ServiceProxy("/controller_manager/switch_controller", SwitchController)
    return bool(
        proxy(start_controllers=start, stop_controllers=stop, strictness=STRICT, start_asap=False, timeout=0.0).ok
    )


def position() -> tuple[float, ...]:
    for _ in range(50):  # the fingers come in messages of their own
        message = rospy.wait_for_message("/joint_states", JointState, timeout=10.0)
        if "panda_joint1" in message.name:
            return tuple(message.position[:7])
    raise AssertionError("no message with the arm's joints")


@pytest.fixture(autouse=True)
def pd_runs_afterwards(live: LiveSystem):
    yield
    running = [name for name, state in states().items() if state == "running" and name in (EFFORT, POSITION)]
    if states()[PD] != "running" or running:
        assert switch([PD] if states()[PD] != "running" else [], running)


def test_rosservice_lists_the_controllers_with_their_claims(live: LiveSystem) -> None:
    listed = live.run("rosservice", "call", "/controller_manager/list_controllers").stdout
    assert (
        "joint_pd_controller" in listed
        and "hardware_interface::EffortJointInterface" in listed
        and "panda_joint7" in listed
    )
    assert states()[EFFORT] in ("initialized", "stopped") and states()[POSITION] in ("initialized", "stopped")


def test_rosservice_lists_the_types_under_their_own_and_their_usual_names(live: LiveSystem) -> None:
    types = rospy.ServiceProxy("/controller_manager/list_controller_types", ListControllerTypes)().types
    assert {
        "hric_controllers/JointPDController",
        "effort_controllers/JointTrajectoryController",
        "joint_state_controller/JointStateController",
    } <= set(types)


def test_a_switch_by_rosservice_changes_the_running_controller_and_the_arm_stays(live: LiveSystem) -> None:
    before = position()
    request = (
        f"{{start_controllers: [{EFFORT}], stop_controllers: [{PD}], strictness: 2, start_asap: false, timeout: 0.0}}"
    )
    assert "ok: True" in live.run("rosservice", "call", "/controller_manager/switch_controller", request).stdout
    assert (states()[EFFORT], states()[PD]) == ("running", "stopped")
    rospy.sleep(1.0)
    assert position() == pytest.approx(before, abs=2e-3)


def test_a_switch_that_claims_a_joint_twice_is_refused_with_both_names(live: LiveSystem) -> None:
    before = position()
    assert not switch([EFFORT], [])
    assert (states()[PD], states()[EFFORT] == "running") == ("running", False)
    wait_for(
        lambda: any(PD in line and EFFORT in line and "panda_joint1" in line for line in live.output.splitlines()),
        5.0,
        "both names in the log",
    )
    assert position() == pytest.approx(before, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "parameters", "texts"),
    [
        ("no_such_controller", {}, ("no_such_controller", "type")),
        (
            "wrong_type",
            {"type": "hric_controllers/JointPdController"},
            ("hric_controllers/JointPdController", "hric_controllers/JointPDController"),
        ),
        (
            "wrong_joints",
            {"type": "hric_controllers/JointPDController", "joints": ["panda_joint1", "elbow"], "kp": 1.0, "kd": 1.0},
            ("elbow", "panda_joint2"),
        ),
        (
            "bad_gain",
            {"type": "hric_controllers/JointPDController", "joints": ["panda_joint1"], "kp": -1.0, "kd": 1.0},
            ("bad_gain/kp", "-1"),
        ),
    ],
)
def test_a_controller_that_cannot_be_loaded_gives_one_clear_error(
    live: LiveSystem, name: str, parameters: dict[str, object], texts: tuple[str, ...]
) -> None:
    before, printed = position(), len(live.output)
    for key, value in parameters.items():
        rospy.set_param(f"/{name}/{key}", value)
    assert not rospy.ServiceProxy("/controller_manager/load_controller", LoadController)(name).ok
    wait_for(
        lambda: all(text in live.output[printed:] for text in texts),
        5.0,
        f"{texts} in the log:\n{live.output[printed:]}",
    )
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


def test_unspawner_keeps_a_controller_stopped_and_starts_it_again_at_its_end(live: LiveSystem) -> None:
    with live.started("rosrun", "controller_manager", "unspawner", PD) as tool:
        wait_for(lambda: states()[PD] == "stopped", 20.0, "stopped by the unspawner")
        tool.send_signal(signal.SIGINT)
        tool.wait(timeout=10.0)
    assert states()[PD] == "running"


def test_spawner_loads_a_controller_from_a_yaml_file_and_unloads_it_at_its_end(
    live: LiveSystem, tmp_path: Path
) -> None:
    (tmp_path / "more.yaml").write_text(
        "more_states: {type: joint_state_controller/JointStateController, publish_rate: 20}\n"
    )
    with live.started("rosrun", "controller_manager", "spawner", str(tmp_path / "more.yaml")) as tool:
        wait_for(lambda: states().get("more_states") == "running", 20.0, "started by the spawner")
        tool.send_signal(signal.SIGINT)
        tool.wait(timeout=10.0)
    assert "more_states" not in states()


def test_spawner_says_that_there_is_no_such_controller(live: LiveSystem) -> None:
    refused = live.run("rosrun", "controller_manager", "spawner", "no_such_controller")
    assert refused.returncode == 1
    assert "no_such_controller" in refused.stderr and "Traceback" not in refused.stdout + refused.stderr


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may prefer a thread without being given leave")
def test_the_control_loop_goes_before_the_rest_of_its_process(live: LiveSystem) -> None:
    (robot,) = (pid for pid, command in live.processes().items() if "/hric_control/robot " in command)
    preferred = []
    for entry in Path(f"/proc/{robot}/task").iterdir():
        with contextlib.suppress(ProcessLookupError):  # one that answered a call and has ended since
            if os.getpriority(os.PRIO_PROCESS, int(entry.name)) == processes.NICE:
                preferred.append(int(entry.name))
    assert preferred == [robot]
