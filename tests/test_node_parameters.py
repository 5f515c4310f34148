"""A node with a parameter that it does not read ends with an error before it contacts the ROS master."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
WRONG = {
    "hric_perception/emg": ("_ratee:=3", "lsl"),
    "hric_perception/emulated_emg": ("_ratee:=3", "rate"),
    "hric_perception/emulated_human": ("_sed:=3", "seed"),
    "hric_perception/emulated_plate": ("_ratee:=3", "rate"),
    "hric_perception/force_plate": ("_natnet/servr:=a", "server"),
    "hric_perception/live_plot": ("_rate:=3", "none"),
    "hric_perception/live_view": ("_ratee:=3", "rate"),
    "hric_view/window": ("_ratee:=3", "rate"),
    "hric_perception/person": ("_subjekt:=a", "subject"),
    "hric_controllers/equilibrium_marker": ("_controler:=a", "controller"),
    "hric_perception/synchronizer": ("_plann:={}", "plan"),
    "hric_perception/synchronizer_cpp": ("_plann:={}", "queue"),
    "hric_supervisor/supervisor": ("_moode:=a", "mode"),
    "hric_experiments/experiment": ("_recrod:=true", "record"),
    "hric_experiments/recorder": ("_subjekt:=P7", "subject"),
    "hric_experiments/spawn": ("_overides:=a", "overrides"),
    "mocap_natnet/natnet_client": ("_servr:=a", "server"),
    "mocap_natnet/calibrate": ("_bodi:=a", "body"),
    "mocap_natnet/emulated_motive": ("_rate:=3", "none"),
    "mujoco_ros_control/camera": ("_ratee:=3", "rate"),
    "franka_real/franka_gripper": ("_robot_ipp:=a", "robot_ip"),
    "franka_sim/franka_gripper": ("_object_widht:=1", "object_width"),
    "franka_sim/emulated_arm": ("_realsm:=ideal", "realism"),
}
"""Invalid parameter of each node, and a name that the error must contain, by package and node."""
# Processes from which the nodes are forked: starting each node anew would load the same libraries for half a second.
START = """
import os, runpy, sys
import rospy, numpy, hric_core.ros, hric_control.robot_app
for argument in sys.argv[1:]:
    path, word = argument.split("|")
    if pid := os.fork():
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        print("code", code, path, file=sys.stderr, flush=True)
        continue
    sys.argv = [path, word, "__name:=node"]
    runpy.run_path(path, run_name="__main__")
    os._exit(0)
"""


@pytest.fixture(scope="module")
def told() -> dict[str, str]:
    """Outputs and exit codes of the nodes by name."""
    words = [f"{ROOT}/src/{node.replace('/', '/nodes/')}|{wrong}" for node, (wrong, _) in WRONG.items()]
    ended = subprocess.run(
        [sys.executable, "-c", START, *words], capture_output=True, text=True, timeout=120.0, check=True
    )
    lines: dict[str, str] = {}
    said: list[str] = []
    for line in ended.stderr.splitlines():
        said.append(line)
        if line.startswith("code "):
            path = Path(line.split()[2])
            lines[f"{path.parents[1].name}/{path.name}"] = "\n".join(said)
            said = []
    return lines


@pytest.mark.parametrize("node", WRONG)
def test_a_parameter_that_is_not_read_ends_the_node_with_2_and_the_valid_names(node: str, told: dict[str, str]) -> None:
    wrong, valid = WRONG[node]
    said = told[node].splitlines()
    key = wrong[1:].partition(":=")[0].rpartition("/")[2]
    assert len(said) == 2 and said[1].startswith("code 2 "), said
    assert f"no parameter '{key}'" in said[0] and valid in said[0].partition("valid: ")[2], said


def test_every_node_with_parameters_is_in_the_table() -> None:
    readers = {
        f"{path.parents[1].name}/{path.name}"
        for path in ROOT.glob("src/*/nodes/*")
        if "Usage: " in (text := path.read_text(errors="replace")) or "live import" in text
    }
    assert readers - {"hric_control/robot"} <= set(WRONG)  # the robot node also checks the parameters of its RobotHW
