"""Bring-ups from start to end: end of an experiment, Ctrl-C, wrong arguments, and files that remain."""

import json
import os
import shutil
import statistics
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml
from bags import control_log, gaps_and_repeats, topics
from live_system import ROOT, LiveSystem, wait_for

pytestmark = pytest.mark.alone

Start = Callable[..., LiveSystem]
Figure = Callable[[str, float, str], None]
ANY = 30.0
"""Longest duration of a shutdown on any machine; LiveSystem waits for the same time [s]."""


def test_pd_step_leaves_a_readable_run(pd_step: Any) -> None:
    system = pd_step.system
    assert system.wait(timeout=0.0) == 0, system.output
    assert system.processes() == {}
    folder = system.run_folder
    metrics = json.loads((folder / "metrics.json").read_text())
    for joint in range(1, 8):
        assert f"panda_joint{joint}" in system.output
    assert "final error" in system.output and "settled" in system.output
    assert metrics["setpoints"][0]["final_error_max"] < 1e-3
    assert yaml.safe_load((folder / "run.yaml").read_text())["status"] == "completed"
    bag = next(folder.glob("*.bag"))
    info = system.run("rosbag", "info", str(bag))
    assert info.returncode == 0 and "hric_msgs/ControlLog" in info.stdout
    assert {"/joint_states", "/control_log", "/joint_pd_controller/command", "/clock"} <= topics(bag)
    cycles, times = control_log(bag)
    assert gaps_and_repeats(cycles) == (0, 0)
    assert len(cycles) >= 6000
    assert times[-1] - times[0] == pytest.approx(0.001 * (len(times) - 1), abs=1e-6)


@dataclass(frozen=True)
class Interrupted:
    """Default bring-up, monitored for some seconds and then ended by Ctrl-C.

    Attributes:
        listened: duration of the monitoring [s of wall time].
        pace: robot time per wall time during this.
        ending: duration of the shutdown [s of wall time].
    """

    system: LiveSystem
    listened: float
    pace: float
    ending: float


def listened_to_and_interrupted(system: LiveSystem, seconds: float) -> Interrupted:
    system.wait_running("joint_pd_controller")
    system.wait_output("recording into")
    pace = real_time_factor(system, seconds)
    return Interrupted(system, seconds, pace, system.interrupt())


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Interrupted]:
    system = LiveSystem(tmp_path_factory.mktemp("interrupted"), "env:=sim", "rviz:=false", "record:=true")
    try:
        yield listened_to_and_interrupted(system, 3.0)
    finally:
        system.close()


def check_bag(system: LiveSystem) -> None:
    """Check that the recorder closed its bag, and that no process was killed."""
    bag = next(system.run_folder.glob("*.bag"))
    assert not list(system.run_folder.glob("*.active"))
    assert system.run("rosbag", "info", str(bag)).returncode == 0
    assert "killed" not in system.output and "SIG" not in system.output, system.output


def test_ctrl_c_closes_the_bag(interrupted: Interrupted) -> None:
    system = interrupted.system
    assert system.process.returncode == 0, system.output
    assert system.processes() == {}
    assert "Traceback" not in system.output
    check_bag(system)


def test_one_block_explains_a_ready_robot(
    interrupted: Interrupted,
) -> None:
    output = interrupted.system.output
    block = output[output.index("  ready ") :].partition("\n\n")[0].splitlines()
    assert [line.split()[0] for line in block] == ["ready", "terminal", "move", "record", "end"]
    assert "simulated Panda (pybullet, real time)" in block[0] and "joint_pd_controller" in block[0]
    assert f"source {ROOT}/scripts/env" in block[1] and interrupted.system.uri in block[1]
    assert "/joint_pd_controller/command" in block[2] and str(interrupted.system.run_folder) in block[3]


@pytest.mark.live
def test_ctrl_c_ends_everything_in_three_seconds(interrupted: Interrupted, figure: Figure) -> None:
    figure("bring-up: end after Ctrl-C", interrupted.ending, "s")
    assert interrupted.ending < 3.0


@pytest.mark.parametrize("limit", [ANY, pytest.param(3.0, marks=pytest.mark.live)])
def test_ctrl_c_gives_the_interrupt_code(start: Start, limit: float) -> None:
    system = start("env:=sim", "rviz:=false", "experiment:=pd_step")
    system.wait_output("setpoints")
    assert system.interrupt() < limit
    assert system.process.returncode == 130
    assert yaml.safe_load((system.run_folder / "run.yaml").read_text())["status"] == "interrupted"
    check_bag(system)


def test_ctrl_c_while_reading_leaves_nothing(start: Start) -> None:
    system = start("env:=sim", "rviz:=false")
    wait_for(lambda: any("/describe " in command for command in system.processes().values()), 30.0, "describe")
    system.interrupt()
    # describe got Ctrl-C, too, and ends some hundredths of a second after roslaunch, which does not wait for it.
    wait_for(lambda: system.processes() == {}, 5.0, "the end of all processes")
    assert "Traceback" not in system.output


@pytest.mark.parametrize("limit", [ANY, pytest.param(4.0, marks=pytest.mark.live)])
def test_ctrl_c_while_starting_leaves_nothing(start: Start, limit: float) -> None:
    system = start("env:=sim", "rviz:=false")
    system.wait_output("started core service")
    assert system.interrupt() < limit
    assert system.processes() == {}
    assert "Traceback" not in system.output


def test_a_second_robot_in_a_namespace_is_refused(start: Start) -> None:
    system = start(
        "env:=sim",
        "rviz:=false",
        "record:=false",
        "ns:=left",
        "arm_id:=left_arm",
        "controller:=effort_joint_trajectory_controller",
        "hand:=false",
    )
    system.wait_running("effort_joint_trajectory_controller", namespace="/left")
    topics = system.run("rostopic", "list").stdout.split()
    assert {"/left/joint_states", "/left/control_log", "/left/effort_joint_trajectory_controller/command"} <= set(
        topics
    )
    outside = {topic for topic in topics if not topic.startswith("/left/")}
    assert "/left/tf" in topics and outside <= {"/clock", "/rosout", "/rosout_agg", "/diagnostics"}  # of all of ROS
    joints = system.run("rostopic", "echo", "-n1", "/left/joint_states/name", timeout=60.0)
    assert "left_arm_joint1" in joints.stdout
    again = system.run("scripts/bringup", "ns:=left")
    assert again.returncode == 1
    assert "is already running on the master" in again.stderr and "/left/robot" in again.stderr
    assert not (system.runs / "latest").exists()


def test_an_unusable_world_ends_the_run(start: Start, tmp_path: Path) -> None:
    world = tmp_path / "bad.yaml"
    world.write_text("objects: [{name: box, shape: pyramid}]\n")
    system = start("env:=sim", "rviz:=false", f"world:={world}")
    assert system.wait(timeout=60.0) == 2
    assert "bad.yaml" in system.output and "Traceback" not in system.output
    assert system.processes() == {}


def test_a_diverged_simulation_leaves_a_whole_bag(start: Start, tmp_path: Path) -> None:
    raw: dict[str, Any] = yaml.safe_load(
        (ROOT / "src/hric_experiments/config/experiments/thesis_step.yaml").read_text()
    )
    raw["robot"]["parameters"] = {"enforce_limits": False}
    raw["robot"]["plant"]["rotor_inertia"] = 0.0
    raw["parameters"]["joint_pd_controller"] |= {"kp": 200.0, "kd": 100.0, "rotatum_limit": 0.0}
    (tmp_path / "unstable.yaml").write_text(yaml.safe_dump(raw))
    system = start("env:=sim", "rviz:=false", f"experiment:={tmp_path / 'unstable.yaml'}")
    assert system.wait(60.0) == 1, system.output
    told = [line for line in system.output.splitlines() if "the simulation diverged at" in line]
    assert len(told) == 1 and "speed of panda_joint" in told[0] and "Traceback" not in system.output, system.output
    run = yaml.safe_load((system.run_folder / "run.yaml").read_text())
    assert run["status"] == "failed" and run["error"].startswith("DivergedError: the simulation diverged at"), run
    (bag,) = system.run_folder.glob("*.bag*")
    assert bag.suffix == ".bag" and len(control_log(bag)[0]) > 0


def test_a_copied_template_needs_no_build(start: Start, tmp_path: Path) -> None:
    packages = f"{tmp_path / 'own'}:{os.environ['ROS_PACKAGE_PATH']}"
    system = start("env:=sim", "rviz:=false", "controller:=none", ROS_PACKAGE_PATH=packages)
    system.wait_running("joint_state_controller")
    shutil.copytree(ROOT / "src/hric_controllers/templates/my_controller", tmp_path / "own/my_controller")
    with system.started("roslaunch", "my_controller", "my_controller.launch"):
        system.wait_running("my_controller")
    system.interrupt()
    assert "nothing yet; start it with: rosservice call /hric/experiment/start_recording" in system.output
    assert not system.runs.exists()
    again = start("env:=sim", "rviz:=false", "record:=false", "controller:=my_controller", ROS_PACKAGE_PATH=packages)
    again.wait_running("my_controller")


def real_time_factor(system: LiveSystem, seconds: float) -> float:
    """Return the robot time per wall time over some seconds, as measured by another process on /clock."""
    done = system.run("python3", str(ROOT / "tests/integration/clock_rate.py"), str(seconds), timeout=seconds + 30.0)
    assert done.returncode == 0, done.stderr
    return float(done.stdout)


def test_every_cycle_is_logged_once(interrupted: Interrupted) -> None:
    cycles, _ = control_log(next(interrupted.system.run_folder.glob("*.bag")))
    assert len(cycles) > 0.9e3 * interrupted.pace * interrupted.listened
    assert gaps_and_repeats(cycles) == (0, 0)


@pytest.mark.live
def test_a_real_time_minute_is_paced_and_logged(start: Start, figure: Figure) -> None:
    ended = listened_to_and_interrupted(start("env:=sim", "rviz:=false", "record:=true"), 60.0)
    figure("bring-up at real time for a minute: robot time per wall time", ended.pace, "1")
    assert ended.pace == pytest.approx(1.0, abs=0.01)
    cycles, _ = control_log(next(ended.system.run_folder.glob("*.bag")))
    assert len(cycles) >= 990 * ended.listened
    assert gaps_and_repeats(cycles) == (0, 0)


HOLD = f"experiment:={ROOT / 'tests/benchmarks/hold.yaml'}"
ROUNDS = 5
"""Number of repetitions, of which the median is tested."""


@pytest.mark.live
@pytest.mark.parametrize(
    ("what", "least", "arguments"),
    [
        ("RobotHWSim", 8.0, [HOLD]),
        ("RobotHWSim on MuJoCo", 12.0, [HOLD, "simulator:=mujoco"]),
        ("the arm behind its control box and with a hand", 3.0, []),  # 3.8 to 4.2 were measured
    ],
    ids=["RobotHWSim", "MuJoCo", "control box"],
)
def test_an_unpaced_run_beats_real_time(
    start: Start, what: str, least: float, arguments: list[str], figure: Figure
) -> None:
    system = start("env:=sim", "rviz:=false", "record:=true", "real_time_factor:=0", *arguments)
    system.wait_output("recording into")
    system.wait_running("joint_pd_controller")
    factor = statistics.median(real_time_factor(system, 3.0) for _ in range(ROUNDS))
    figure(f"unpaced with ROS and recording, {what}: robot time per wall time", factor, "1")
    system.interrupt()
    assert gaps_and_repeats(control_log(next(system.run_folder.glob("*.bag")))[0]) == (0, 0)
    assert factor >= least
