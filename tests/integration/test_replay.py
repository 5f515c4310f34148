"""Replay of runs by scripts/replay: current stamps, refused inputs, and no remaining processes."""

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from hric_core.command import main

pytestmark = pytest.mark.alone

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts/lib"))
from bringup_master import call, free_port  # noqa: E402
from replay_run import Run, blocked  # noqa: E402

HEARD = """
import sys, rospy
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
rospy.init_node("listener", disable_signals=True)
joints = rospy.wait_for_message("/joint_states", JointState, 30)
frames = set()
rospy.Subscriber("/tf", TFMessage, lambda message: frames.update(t.child_frame_id for t in message.transforms))
while "panda_link7" not in frames:
    rospy.rostime.wallsleep(0.05)
print(joints.name[0], rospy.get_param("/use_sim_time"), "<robot" in rospy.get_param("/robot_description"))
print(*sorted(frames), rospy.get_time() < 100.0)
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a short headless run."""
    folder = tmp_path_factory.mktemp("runs")
    assert main(["run", "pd_step", "duration:=3", "--runs", str(folder), "--quiet", "--no-figures"]) == 0
    return folder


@contextlib.contextmanager
def replaying(runs: Path, *given: str) -> Iterator[tuple[subprocess.Popen[str], dict[str, str]]]:
    environment = os.environ | {
        "ROS_MASTER_URI": f"http://localhost:{free_port()}",
        "HRIC_RUNS": str(runs),
        "ROS_LOG_DIR": str(runs / "log"),
    }
    environment.pop("DISPLAY", None)
    command = [str(ROOT / "scripts/replay"), *given]
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    try:
        yield process, environment
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGTERM)
        process.communicate(timeout=20)


def children(pid: int) -> list[int]:
    found = subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True, check=False).stdout.split()
    return [int(child) for child in found] + [deeper for child in found for deeper in children(int(child))]


def test_a_run_is_played_with_its_clock_its_robot_and_its_transforms_and_ends_with_ctrl_c(runs: Path) -> None:
    with replaying(runs, "latest", "--rate", "0.2", "--no-rviz") as (process, environment):
        heard = subprocess.run(
            [sys.executable, "-c", _waiting()], env=environment, capture_output=True, text=True, timeout=90, check=False
        )
        assert heard.returncode == 0, heard.stderr
        joints, frames = heard.stdout.splitlines()
        assert joints == "panda_joint1 True True"
        assert "panda_link7" in frames and frames.endswith("True")
        started = children(process.pid)
        assert len(started) >= 3
        os.kill(process.pid, signal.SIGINT)
        output, _ = process.communicate(timeout=20)
        assert process.returncode == 130 and "Traceback" not in output, output
        assert [pid for pid in started if Path(f"/proc/{pid}").exists()] == []
        assert call(environment["ROS_MASTER_URI"], "getPid") is None


def _waiting() -> str:
    return f"import rosgraph, time\nwhile not rosgraph.is_master_online(): time.sleep(0.1)\n{HEARD}"


def test_a_replay_ends_by_itself_with_the_bag(runs: Path) -> None:
    with replaying(runs, "latest", "--rate", "20", "--no-rviz") as (process, environment):
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 0, output
        assert "playing pd_step" in output and "Traceback" not in output
        assert "invalid time" not in output  # the player loads no message of time 0
        assert call(environment["ROS_MASTER_URI"], "getPid") is None


@pytest.mark.parametrize(
    ("given", "text", "code"),
    [
        (("pd_stepp",), "no run folder 'pd_stepp'", 2),
        (("latest", "--rate", "0"), "a number above 0", 2),
        (("unfinished",), "--salvage", 2),
    ],
)
def test_what_cannot_be_played_is_told_in_one_error_before_anything_starts(
    runs: Path, given: tuple[str, ...], text: str, code: int
) -> None:
    folder = runs / "unfinished"
    folder.mkdir(exist_ok=True)
    (folder / "run.yaml").write_text("bag: unfinished.bag\n")
    (folder / "unfinished.bag.active").touch()
    with replaying(runs, *given) as (process, environment):
        output, _ = process.communicate(timeout=30)
        assert process.returncode == code and text in output and "Traceback" not in output, output
        assert call(environment["ROS_MASTER_URI"], "getPid") is None


def test_a_robot_that_runs_is_not_sent_the_commands_of_then() -> None:
    run = Run("a", [], "", "", ["/joint_states"], False, 1.0)
    quiet: tuple[int, str, object] = (1, "", [[["/rosout_agg", ["/rosout"]]], [], []])
    assert blocked(quiet, run) == ""
    robot = (1, "", [[], [], [["/left/controller_manager/switch_controller", ["/left/robot"]]]])
    assert blocked(robot, run) == "a robot runs (/left/robot)"
    assert blocked((1, "", [[["/joint_states", ["/other"]]], [], []]), run) == "/other publishes /joint_states"
