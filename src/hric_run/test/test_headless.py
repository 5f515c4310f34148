"""The headless runner end to end, with the real robot, plant and controllers."""

import dataclasses
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hric_bags import reader as bag_reader
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_core.errors import HricError
from hric_msgs.msg import JointLimitCounts
from hric_report import headless
from hric_report.run import analyse
from hric_run.definition import experiment

NODES = Path(__file__).parents[2] / "hric_experiments" / "nodes"
"""Folder of the nodes of hric_experiments; rosrun would take longer to find them than they take to start."""
JOINTS = [f"panda_joint{i}" for i in range(1, 8)]


def run(folder: Path, name: str, *overrides: str) -> headless.HeadlessResult:
    definition = experiment.load(name, overrides)
    return headless.run(definition, overrides, root=folder, progress=False, figures=False)


def started(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, str(NODES / "run"), *arguments, "--runs", str(folder), "--quiet", "--no-figures"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ)


@pytest.mark.parametrize(("kp", "kd"), [(200, 100), (50, 10), (20, 10)])
def test_pd_step_ends_within_a_milliradian_and_touches_no_limit(tmp_path: Path, kp: int, kd: int) -> None:
    result = run(tmp_path, "pd_step", f"kp:={kp}", f"kd:={kd}")
    metrics = result.metrics
    (move,) = metrics["setpoints"]
    assert move["final_error_max"] < 1e-3
    assert move["settling_time_max"]["0.001"] < 6.0
    assert metrics["limits_touched"] == {"position": 0, "velocity": 0, "effort": 0, "effort_rate": 0}
    assert metrics["control_log"]["limited_cycles"] == 0
    assert max(joint["velocity_ratio"] for joint in metrics["joints"].values()) < 0.5
    assert (metrics["control_log"]["cycles"], metrics["control_log"]["gaps"], metrics["control_log"]["repeats"]) == (
        6000,
        [],
        [],
    )
    assert not result.interrupted and result.folder.read()["status"] == "completed"


def _plain(record: bag_reader.RunRecord) -> dict[str, Any]:
    """A record as plain values: counts in memory and counts from a bag are messages of different classes."""
    counts = {name: getattr(record.limit_counts, name, None) for name in JointLimitCounts.__slots__ if name != "header"}
    return {**dataclasses.asdict(dataclasses.replace(record, limit_counts=None)), "limit_counts": counts}


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("pd_step", ("duration:=0.8", "parameters.joint_pd_controller.profile.velocity:=5.0", "kp:=200", "kd:=5")),
        ("marker_tracking", ("duration:=0.3", "mocap.human.begin:=0.1")),
    ],
)
def test_what_a_run_still_has_in_memory_is_what_its_bag_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, overrides: tuple[str, ...]
) -> None:
    taken: list[bag_reader.RunMessages] = []

    def tell(folder: RunFolder, *, known: bag_reader.RunMessages, **options: Any) -> dict[str, Any]:
        taken.append(known)
        return analyse(folder, known=known, **options)

    monkeypatch.setattr(headless, "analyse", tell)
    result = run(tmp_path, name, *overrides)
    bag = result.folder.bag_path
    kept, read = bag_reader.read(bag, taken[0]), bag_reader.read(bag)
    assert kept.reflexes == read.reflexes and bool(read.reflexes) == (name == "pd_step")
    kept.robot_time = read.robot_time
    np.testing.assert_equal(_plain(kept), _plain(read))
    assert analyse(result.folder, figures=False) == result.metrics


def test_run_yaml_has_what_ran(tmp_path: Path) -> None:
    result = run(tmp_path, "pd_step", "duration:=0.05", "kp:=20")
    data = result.folder.read()
    assert data["arguments"] == ["duration:=0.05", "kp:=20"] and data["seed"] == 0 and data["mode"] == "headless"
    assert data["parameters"]["joint_pd_controller"]["kp"] == 20
    assert data["parameters"]["joint_pd_controller"]["joints"] == JOINTS
    assert data["limits"]["panda_joint4"]["upper"] == pytest.approx(-0.0698)
    assert data["limits"]["panda_joint1"]["effort_rate"] == 1000.0
    assert data["state_sha256"] == result.metrics["state_sha256"]
    assert {"robot_description", "roslaunch"}.isdisjoint(data["parameters"])
    text = (result.folder.path / "run.yaml").read_text()
    assert str(Path(__file__).parents[3]) not in text
    assert os.uname().nodename not in text


def test_a_measured_arm_runs_alike_for_the_same_seed_only_and_sags_as_its_body_is_not_the_one_that_it_believes_in(
    tmp_path: Path,
) -> None:
    definition = experiment.load("pd_step", ("realism:=measured", "duration:=4"))
    results = [
        headless.run(definition, seed=seed, root=tmp_path / str(i), progress=False, figures=False)
        for i, seed in enumerate((1, 1, 2))
    ]
    one, same, other = (result.metrics["state_sha256"] for result in results)
    assert one == same != other
    assert 1e-3 < results[0].metrics["setpoints"][0]["final_error_max"] < 5e-2
    assert "arm_error" not in results[0].folder.read()


def test_friction_acts_in_the_plant_and_only_what_the_arm_does_not_compensate_leaves_an_error(tmp_path: Path) -> None:
    for friction, least, most in (("identified", 0.0, 2e-4), ("coulomb", 1e-3, 5e-2)):
        result = run(tmp_path, "pd_step", f"friction:={friction}", "duration:=5")
        assert result.folder.read()["parameters"]["robot"]["plant"]["friction"] == friction
        assert least < result.metrics["setpoints"][0]["final_error_max"] < most


def test_a_reflex_stands_in_the_report_with_its_time_and_names(tmp_path: Path) -> None:
    result = run(
        tmp_path, "pd_step", "duration:=1.5", "parameters.joint_pd_controller.profile.velocity:=5.0", "kp:=200", "kd:=5"
    )
    (reflex,) = result.metrics["reflexes"]
    assert reflex["errors"] == ["joint_velocity_violation"] and 0.0 < reflex["time"] < 1.5
    assert (
        f"THE ARM PROTECTED ITSELF at {reflex['time']:.3f} s: joint_velocity_violation"
        in (result.folder.path / "summary.txt").read_text()
    )


XACRO = """<robot name="one" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="m" value="1.0"/>
<link name="base"/>
<link name="arm"><inertial>
<origin xyz="0.1 0 0"/><mass value="${m}"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="30" velocity="20"/></joint>
<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="j">
<hardwareInterface>EffortJointInterface</hardwareInterface>
</joint><actuator name="a"><mechanicalReduction>1</mechanicalReduction></actuator></transmission></robot>"""  # noqa: E501

OWN = """
robot: {hw: pybullet_ros_control/RobotHWSim, urdf: %s, plant: {rotor_inertia: 0}}
controllers: [pd]
parameters: {pd: {type: hric_controllers/JointPDController, joints: [j], kp: 100, kd: 3}}
setpoints: [{time: 0.1, controller: pd, positions: [1.0]}, {time: 2.0, controller: pd, positions: [-0.5]}]
duration: 4
"""


def test_a_robot_and_an_experiment_of_ones_own_run_too(tmp_path: Path) -> None:
    (tmp_path / "one.urdf.xacro").write_text(XACRO)
    path = tmp_path / "own.yaml"
    path.write_text(OWN % (tmp_path / "one.urdf.xacro"))
    result = run(tmp_path / "runs", str(path))
    assert [move["joints"]["j"]["target"] for move in result.metrics["setpoints"]] == [1.0, -0.5]
    assert all(move["final_error_max"] < 1e-3 for move in result.metrics["setpoints"])
    assert result.folder.path.name.startswith("own_")


def test_ctrl_c_leaves_a_whole_bag_and_a_run_marked_interrupted(tmp_path: Path) -> None:
    process = started(tmp_path, "pd_step", "duration:=600")
    deadline = time.monotonic() + 30.0
    while not any(bag.stat().st_size > 100_000 for bag in tmp_path.glob("*/*.bag.active")):
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    output, error = process.communicate(timeout=30)
    assert process.returncode == 130 and "Traceback" not in error, error
    folder = RunFolder.open("latest", tmp_path)
    assert folder.read()["status"] == "interrupted"
    assert folder.bag_path.is_file() and not list(folder.path.glob("*.active"))
    assert "run folder:" in output and folder.metrics_path.is_file()


UNSTABLE = ("rotor_inertia:=0", "kp:=200", "kd:=100", "limits:=false", "rotatum_limit:=0", "duration:=1")


def test_a_diverged_run_is_one_line_a_failed_run_and_a_whole_bag_that_can_be_reported(tmp_path: Path) -> None:
    process = started(tmp_path, "thesis_step", *UNSTABLE)
    output, error = process.communicate(timeout=60)
    told = [line for line in error.splitlines() if line.startswith("hric run: ")]
    assert process.returncode == 1 and len(told) == 1 and "Traceback" not in error + output, error
    match = re.fullmatch(
        r"hric run: (the simulation diverged at (\S+) s: speed of panda_joint\d is (\S+) rad/s, beyond 1000 rad/s .*)",
        told[0],
    )
    assert match is not None and 1000.0 < abs(float(match[3])) < 1e6, told
    folder = RunFolder.open("latest", tmp_path)
    assert folder.read()["status"] == "failed" and folder.read()["error"] == f"DivergedError: {match[1]}"
    assert folder.bag_path.is_file() and not list(folder.path.glob("*.active"))
    log = bag_reader.read(folder.bag_path).log
    assert log.time[-1] == pytest.approx(float(match[2]) - 1e-3, abs=1e-6)  # every cycle until then
    report = analyse(folder, figures=False)
    assert report["stability"]["verdict"] == "unstable" and report["stability"]["reasons"][0] == match[1]
    assert f"failed (headless): DivergedError: {match[1]}" in report["report"]


def test_a_bounded_run_that_chatters_is_completed_and_called_unstable_in_report_and_metrics_also_when_quiet(
    tmp_path: Path,
) -> None:
    process = started(tmp_path, "thesis_step", *UNSTABLE, "simulator:=opensim")
    _, error = process.communicate(timeout=60)
    assert process.returncode == 0 and "unstable: panda_joint7 chatters at 500 Hz" in error
    folder = RunFolder.open("latest", tmp_path)
    assert folder.read()["status"] == "completed"
    stability = json.loads(folder.metrics_path.read_text())["stability"]
    assert stability["verdict"] == "unstable" and stability["joints"]["panda_joint7"]["share"] > 1.0
    assert f"stability: UNSTABLE\n- {stability['reasons'][0]}" in (folder.path / "summary.txt").read_text()


@pytest.mark.parametrize("name", ["pd_step", "thesis_step", "marker_tracking"])
def test_the_usual_experiments_are_called_stable(tmp_path: Path, name: str) -> None:
    result = run(tmp_path, name, "duration:=2.5")
    assert result.metrics["stability"]["verdict"] == "stable" and "stability: stable" in result.metrics["report"]


@pytest.mark.parametrize(
    "words",
    [
        ["pd_step", "--quiet", "duration:=0.05", "--seed", "3", "kp:=20"],
        ["duration:=0.05", "--seed", "3", "pd_step", "kp:=20", "--quiet"],
        ["--quiet", "--seed=3", "duration:=0.05", "kp:=20", "pd_step"],
    ],
)
def test_experiment_options_and_overrides_come_in_any_order(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", *words, "--runs", str(tmp_path), "--no-figures"]) == 0
    assert "setpoint" not in capsys.readouterr().out
    data = RunFolder.open("latest", tmp_path).read()
    assert (data["arguments"], data["seed"], data["experiment"]) == (["duration:=0.05", "kp:=20"], 3, "pd_step")


@pytest.mark.parametrize(
    ("words", "told"),
    [(["kp:=20"], "given: none; valid: "), (["pd_step", "--quiet", "thesis_step"], "given: pd_step, thesis_step")],
)
def test_not_exactly_one_experiment_is_refused(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", *words]) == 2 and told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("robot.plant.colour:=red", ("no parameter 'colour'", "rotor_inertia")),
        ("kp:=abc", ("/joint_pd_controller/kp is 'abc'; valid: a finite number",)),
    ],
)
def test_what_robot_or_controller_refuse_is_one_line_and_leaves_no_folder(
    tmp_path: Path, override: str, told: tuple[str, ...]
) -> None:
    process = started(tmp_path / "runs", "pd_step", override)
    output, error = process.communicate(timeout=30)
    assert process.returncode == 2 and "Traceback" not in error + output, error
    assert all(text in error for text in told) and error.count("\n") == 1
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("robot.description.colour:=red", "no key 'colour' in robot.description; valid: collision, damping"),
        ("inertials:=guessed", "valid: barycentric, fr3, thesis"),
        ("hw:=no/Robot", "no hric_control::RobotHW 'no/Robot'"),
        ("parameters.joint_pd_controller.type:=no/Controller", "no/Controller"),
        ("kp:=-1", "kp"),
        ("setpoints.0.positions:=[0, 0, 0]", "has 3 positions; valid: 7, for panda_joint1"),
        ("setpoints.0.positions:=[0, 0, 0, 0.5, 0, 1, 0]", "panda_joint4 0.5 rad is outside -3.0718 to -0.0698"),
        ("robot.urdf:=/nowhere.urdf", "cannot read the robot description"),
    ],
)
def test_a_mistake_is_refused_before_anything_moves(tmp_path: Path, override: str, told: str) -> None:
    with pytest.raises(HricError) as caught:
        run(tmp_path, "pd_step", override)
    assert told in str(caught.value)
    assert not list(tmp_path.glob("*/*.bag"))


def test_an_experiment_without_setpoint_holds_the_arm_where_it_is(tmp_path: Path) -> None:
    result = run(tmp_path, "pd_step", "setpoints:=[]", "duration:=0.2")
    assert result.metrics["setpoints"] == [] and "no setpoint was recorded" in result.metrics["report"]
    assert max(abs(joint["velocity_peak"]) for joint in result.metrics["joints"].values()) < 1e-6


@pytest.fixture(scope="module")
def metrics(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return run(tmp_path_factory.mktemp("runs"), "thesis_step", "inertials:=thesis", "rotor_inertia:=0").metrics


class TestThesisStep:
    def test_the_start_outside_joint_4_is_said_once_and_counted(
        self, tmp_path: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        metrics = run(tmp_path, "thesis_step", "duration:=0.1").metrics
        said = [record.getMessage() for record in caplog.records if "starts at" in record.getMessage()]
        assert len(said) == 1 and said[0].startswith(
            "joint panda_joint4 starts at 0.0000 rad, outside its range [-3.0718, -0.0698]"
        )
        outside = {
            name: joint["position_excess_max"] for name, joint in metrics["joints"].items() if joint["started_outside"]
        }
        assert outside == {"panda_joint4": pytest.approx(0.0698)}

    def test_while_outside_only_inward_effort_passes_and_the_controller_leads(self, tmp_path: Path) -> None:
        folder = run(tmp_path, "thesis_step", "duration:=0.3").folder
        log = bag_reader.read(folder.bag_path).log
        position, command, raw = (values[:, 3] for values in (log.position, log.command, log.command_raw))
        outside = position > -0.0698
        assert 10 < np.count_nonzero(outside) < 250 and not outside[-1]
        assert (command[outside] <= 0.0).all()
        assert (np.abs(command[outside]) <= np.abs(raw[outside]) + 1e-9).all()

    def test_what_was_clamped_and_how_far_the_speed_overshot_stands_in_the_report(
        self, metrics: dict[str, Any]
    ) -> None:
        assert metrics["limits_touched"]["velocity"] > 100 and metrics["limits_touched"]["effort_rate"] > 0
        joint = metrics["joints"]["panda_joint4"]
        assert 1.2 < joint["velocity_ratio"] < 2.2
        assert joint["velocity_ratio_max"] == pytest.approx(joint["velocity_ratio"], rel=0.05)
        assert "limits acted (cycles, summed over the joints)" in metrics["report"]
        assert f"panda_joint4 {joint['velocity_ratio']:.2f} times" in metrics["report"]

    def test_the_rate_of_torque_holds_behind_all_other_clamps(self, metrics: dict[str, Any]) -> None:
        assert max(joint["rotatum_peak"] for joint in metrics["joints"].values()) <= 1000.0 * (1 + 1e-6)

    def test_the_thesis_set_up_reaches_its_setpoint_and_the_report_says_what_differs(
        self, metrics: dict[str, Any]
    ) -> None:
        assert metrics["setpoints"][0]["final_error_max"] < 1e-3
        told = {item["what"]: item for item in metrics["differences"]}
        assert {"physics engine", "position read-out", "inertia tensors", "limits that acted", "velocity limit"} <= set(
            told
        )
        assert {"rotor inertia [kg m^2]", "joint damping [N m s/rad]", "gains", "self-collision"}.isdisjoint(told)
        assert "not positive definite" in told["inertia tensors"]["why"]
        assert all(item["reference"] and item["here"] and item["why"] for item in metrics["differences"])

    def test_gains_beyond_what_the_loop_carries_are_reported_as_chatter(self, tmp_path: Path) -> None:
        metrics = run(
            tmp_path, "thesis_step", "kp:=200", "kd:=100", "inertials:=thesis", "rotor_inertia:=0", "duration:=1"
        ).metrics
        told = {item["what"]: item["here"] for item in metrics["differences"]}
        assert "panda_joint7" in told["torque at the end of the run"] and "gains" not in told

    def test_other_choices_are_reported_as_differences(self, tmp_path: Path) -> None:
        metrics = run(
            tmp_path,
            "thesis_step",
            "duration:=0.1",
            "kp:=10",
            "kd:=5",
            "damping:=0",
            "profile:=true",
            "q_start:=[0,0,0,-1,0,1,0]",
        ).metrics
        told = {item["what"]: item["here"] for item in metrics["differences"]}
        assert (
            told["gains"] == "Kp 10 Kd 5"
            and told["rotor inertia [kg m^2]"] == "the description's"
            and told["joint damping [N m s/rad]"] == "0"
        )
        assert (
            told["setpoint"] == "trapezoidal velocity profile"
            and "start" in told
            and "joint limits at the start" not in told
        )
