"""Bring-up included in another launch file inside `<group ns="lab">`: all names are below /lab.

ROS tools work there with ROS's own namespace options.
"""

import json
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
import rosgraph
import yaml
from bags import control_log, topics
from live_system import ROOT, LiveSystem, wait_for

pytestmark = pytest.mark.alone


def own_launch(folder: Path, **arguments: str) -> str:
    """Write another launch file into a folder, and return its path."""
    given = "".join(f'<arg name="{name}" value="{value}"/>' for name, value in arguments.items())
    path = folder / "own.launch"
    path.write_text(
        '<launch><group ns="lab"><include file="$(find hric_bringup)/launch/bringup.launch">'
        f'<arg name="rviz" value="false"/><arg name="mocap_server" value="127.0.7.16"/>{given}'
        "</include></group></launch>"
    )
    return str(path)


OF_ROS = {"/clock", "/rosout", "/rosout_agg", "/diagnostics"}
"""Names that are absolute in ROS itself: one clock and one log per master, and diagnostics by REP 107."""
TOOLS = re.compile(r"/rosout$|(/lab)?/(rostopic|rosservice)_")
"""Pattern of the nodes of the master's log, and of the tools that this file starts."""
PUBLISHED = {
    "/lab/joint_states",
    "/lab/tf",
    "/lab/tf_static",
    "/lab/hric/clock",
    "/lab/hric/perception/mocap",
    "/lab/mocap/marker",
    "/lab/mocap/markers",
    "/lab/mocap/trail",
    "/lab/hric/view/limits",
}
PARAMETERS_OF_ROS = ("/use_sim_time", "/rosdistro", "/rosversion", "/run_id", "/roslaunch/")


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveSystem]:
    folder = tmp_path_factory.mktemp("lab")
    system = LiveSystem(
        folder, own_launch(folder, mocap="emulated", view="true", real_time_factor="0.25"), program="roslaunch"
    )
    try:
        system.wait_running("joint_pd_controller", namespace="/lab")
        wait_for(lambda: set(graph(system)[0]) >= PUBLISHED, 60.0, f"all of {PUBLISHED} are published")
        wait_for(lambda: len(system.controllers("/lab")) > 5, 60.0, "all controllers are loaded")
        yield system
    finally:
        system.close()


def master(system: LiveSystem, method: str) -> Any:
    with mock.patch.dict(os.environ, ROS_MASTER_URI=system.uri):
        return getattr(rosgraph.Master("/looks_on"), method)()


def graph(system: LiveSystem) -> list[dict[str, set[str]]]:
    """Return publishers, subscribers and services (name -> nodes) of the system, without TOOLS."""
    return [
        {name: own for name, nodes in side if (own := {node for node in nodes if not TOOLS.match(node)})}
        for side in master(system, "getSystemState")
    ]


def in_lab(system: LiveSystem, *command: str, timeout: float = 60.0) -> str:
    """Return the output of a command in a terminal with ROS_NAMESPACE=lab."""
    done = system.run("env", "ROS_NAMESPACE=lab", *command, timeout=timeout)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def outside(names: Any) -> set[str]:
    return {name for name in names if not name.startswith("/lab/")}


def test_every_node_topic_and_service_is_below_the_namespace_of_the_group(lab: LiveSystem) -> None:
    publishers, subscribers, services = sides = graph(lab)
    assert outside(publishers) | outside(subscribers) <= OF_ROS
    assert outside(services) == set()
    assert outside(node for side in sides for nodes in side.values() for node in nodes) == set()
    assert "/lab/robot" in subscribers["/lab/hric/perception/mocap"], "controllers that follow a marker are loaded"


def test_every_parameter_is_below_it_too(lab: LiveSystem) -> None:
    found = lab.run("rosparam", "list").stdout.split()
    assert "/lab/robot_description" in found and "/lab/natnet_client/server" in found
    assert {name for name in outside(found) if not name.startswith(PARAMETERS_OF_ROS)} == set()


def test_the_arms_and_the_motion_captures_frames_are_on_the_tf_of_the_group(lab: LiveSystem) -> None:
    echoed = in_lab(lab, "rostopic", "echo", "-n", "60", "tf/transforms", timeout=120.0)
    frames = set(re.findall(r'child_frame_id: "?([^"\s]+)', echoed))
    assert "panda_link7" in frames and len(frames - {f"panda_link{n}" for n in range(9)}) > 0, frames


def test_the_tools_of_ros_control_list_and_switch_in_it(lab: LiveSystem) -> None:
    listed = in_lab(lab, "rosrun", "controller_manager", "controller_manager", "list")
    assert re.search(r"joint_pd_controller.*running", listed), listed
    assert lab.run("rosrun", "controller_manager", "controller_manager", "list", "__ns:=/lab").stdout == listed
    for stopped, started in (
        ("joint_pd_controller", "effort_joint_trajectory_controller"),
        ("effort_joint_trajectory_controller", "joint_pd_controller"),
    ):
        in_lab(lab, "rosrun", "controller_manager", "controller_manager", "stop", stopped)
        in_lab(lab, "rosrun", "controller_manager", "controller_manager", "start", started)
        assert lab.controllers("/lab")[started] == "running"


def test_a_setpoint_moves_the_arm_and_the_bag_of_it_holds_topics_of_the_group(lab: LiveSystem) -> None:
    begun = in_lab(lab, "rosservice", "call", "hric/experiment/start_recording")
    assert "success: True" in begun, begun
    target = [0.2, -0.6, 0.1, -2.2, 0.1, 1.6, 0.6]
    with (
        lab.published("/lab/joint_pd_controller/command", "std_msgs/Float64MultiArray", f"data: {target}"),
        lab.following("/lab/franka_state_controller/joint_states/position") as positions,
    ):
        wait_for(lambda: positions() == pytest.approx(target, abs=0.02), 60.0, f"the arm at {target}")
    ended = in_lab(lab, "rosservice", "call", "hric/experiment/stop_recording")
    (bag,) = lab.run_folder.glob("*.bag")
    assert str(bag) in ended
    recorded = topics(bag)
    assert outside(recorded) <= OF_ROS
    assert {"/lab/control_log", "/lab/joint_pd_controller/command", "/lab/mocap/marker", "/lab/tf"} <= recorded
    assert len(control_log(bag, "/lab/control_log")[0]) > 100


def test_the_calibration_listens_in_it(lab: LiveSystem) -> None:
    with lab.started("rosrun", "mocap_natnet", "calibrate", "__ns:=/lab"):
        wanted = {"/lab/hric/perception/mocap", "/lab/franka_state_controller/franka_states"}

        def listening() -> bool:
            heard = {name for name, nodes in graph(lab)[1].items() if "/lab/calibrate_mocap" in nodes}
            return heard - {"/clock"} == wanted

        wait_for(listening, 60.0, f"calibrate subscribes to {wanted}")


def test_ctrl_c_ends_all_of_it(lab: LiveSystem) -> None:
    lab.interrupt()
    assert lab.process.returncode == 0 and lab.processes() == {}
    assert "Traceback" not in lab.output and "escalating" not in lab.output, lab.output


@pytest.mark.slow
def test_an_experiment_with_a_motion_capture_follows_reports_and_ends_there(
    start: Callable[..., LiveSystem], tmp_path: Path
) -> None:
    raw = yaml.safe_load((ROOT / "src/hric_experiments/config/experiments/marker_tracking.yaml").read_text())
    raw["mocap"]["human"] |= {"cycles": 1, "frequency": 0.5}
    path = tmp_path / "short_tracking.yaml"
    path.write_text(yaml.safe_dump(raw | {"duration": 5.0}))
    system = start(own_launch(tmp_path, experiment=str(path)), program="roslaunch")
    system.wait(180.0)
    run = yaml.safe_load((system.run_folder / "run.yaml").read_text())
    assert run["status"] == "completed", system.output
    tracking = json.loads((system.run_folder / "metrics.json").read_text())["tracking"]
    assert tracking is not None and tracking["marker"] == "truth"
    assert outside(topics(next(system.run_folder.glob("*.bag")))) <= OF_ROS
    assert system.output.count("report, step ") == 5 and system.processes() == {}, system.output
