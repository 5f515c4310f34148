"""Comparison of two runs, as thesis ch. 4.4 compares the simulated and the real arm."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import JOINTS, write_run

from hric_analysis import comparison
from hric_analysis.comparison import ComparisonError, SettingDifference
from hric_bags import reader as bag_reader
from hric_bags.files import FileError
from hric_bags.reader import ControlRecord, RunRecord, SentSetpoint
from hric_bags.run_folder import RunFolder
from hric_core.errors import UnknownNameError
from hric_report.run import analyse

NODES = Path(__file__).parents[2] / "hric_experiments" / "nodes"
"""Of this package: rosrun looks for them longer than they take to start."""
PANDA = [f"panda_joint{i}" for i in range(1, 8)]


def ran(tool: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(NODES / tool), *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=os.environ,
    )


def run_pd_step(root: Path, *overrides: str) -> RunFolder:
    done = ran("run", "pd_step", *overrides, "--runs", str(root), "--quiet", "--no-figures")
    assert done.returncode == 0, done.stderr
    return RunFolder.open("latest", root)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def simulated(root: Path) -> RunFolder:
    return run_pd_step(root, "duration:=3.5")


@pytest.fixture(scope="module")
def other(root: Path) -> RunFolder:
    """Return a run with the same motion, dry friction and heavier rotors, half a second later."""
    return run_pd_step(root, "duration:=4", "friction:=coulomb", "rotor_inertia:=0.2", "setpoints.0.time:=0.5")


def log_of(folder: RunFolder) -> ControlRecord:
    return bag_reader.read(folder.bag_path).log


def test_peak_and_steady_differences_of_two_runs_are_those_of_their_logs(
    root: Path, simulated: RunFolder, other: RunFolder
) -> None:
    done = ran(
        "compare",
        simulated.path.name,
        other.path.name,
        "--runs",
        str(root),
        "--labels",
        "simulated",
        "real",
        "--no-figures",
    )
    assert done.returncode == 0, done.stderr
    folder = root / f"{simulated.path.name}_vs_{other.path.name}"
    (move,) = json.loads((folder / "metrics.json").read_text())["setpoints"]
    a, b = log_of(simulated), log_of(other)
    n = a.cycles - 1  # the setpoint goes out in the second cycle of A, half a second later in B
    late = round((move["time_b"] - b.time[0]) * 1000)
    assert (move["time_a"], move["time_b"]) == (pytest.approx(0.001), pytest.approx(0.5)) and move[
        "duration"
    ] == pytest.approx((n - 1) * 1e-3)
    apart = a.position[1 : 1 + n] - b.position[late : late + n]
    torque = a.command[1 : 1 + n] - b.command[late : late + n]
    for j, name in enumerate(PANDA):
        joint, peak = move["joints"][name], np.abs(apart[:, j]).argmax()
        assert joint["peak_difference"] == pytest.approx(apart[peak, j], abs=1e-9)
        assert joint["peak_time"] == pytest.approx(peak * 1e-3, abs=1e-6)
        assert joint["steady_difference"] == pytest.approx(apart[-100:, j].mean(), abs=1e-6)
        assert joint["rms_difference"] == pytest.approx(np.sqrt((apart[:, j] ** 2).mean()), abs=1e-9)
        assert joint["effort_peak_difference"] == pytest.approx(torque[np.abs(torque[:, j]).argmax(), j], abs=1e-6)
    # Dry friction holds the arm up on its way and keeps it short of the setpoint.
    assert move["peak_difference_max"] > 5e-3 and 1e-3 < move["steady_difference_max"] < move["peak_difference_max"]


def test_figures_table_and_what_was_set_differently_are_there(
    root: Path, simulated: RunFolder, other: RunFolder
) -> None:
    folder = root / "elsewhere" / "deep"
    done = ran(
        "compare",
        str(simulated.path),
        str(other.path),
        "--runs",
        str(root),
        "--output",
        str(folder),
        "--joint",
        "panda_joint4",
    )
    assert done.returncode == 0, done.stderr
    assert {path.name for path in folder.iterdir()} == {
        "metrics.json",
        "summary.txt",
        "figures",
    }
    assert {path.name for path in (folder / "figures").glob("*.png")} == {
        "joint_states.png",
        "positions.png",
        "differences.png",
    }
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in (folder / "figures").glob("*.png"))
    report = (folder / "summary.txt").read_text()
    assert report in done.stdout and f"comparison: {folder}" in done.stdout
    assert all(name in report for name in PANDA) and "- robot.plant.rotor_inertia: not set; 0.2" in report
    told = json.loads((folder / "metrics.json").read_text())
    assert told["runs"]["a"]["label"] == simulated.path.name and told["runs"]["b"]["hw"] == "franka_sim/FrankaHWSim"
    assert {item["key"] for item in told["settings"]} >= {
        "robot.plant.rotor_inertia",
        "robot.description.friction",
        "duration",
    }
    assert analyse(other, figures=False)["setpoints"], "the comparison must leave the runs as they are"


def test_a_run_compared_with_itself_differs_by_nothing(root: Path, simulated: RunFolder) -> None:
    done = ran(
        "compare",
        simulated.path.name,
        simulated.path.name,
        "--runs",
        str(root),
        "--no-figures",
        "--output",
        str(root / "same"),
    )
    assert done.returncode == 0, done.stderr
    told = json.loads((root / "same" / "metrics.json").read_text())
    assert told["settings"] == [] and told["setpoints"][0]["peak_difference_max"] == 0.0
    assert {
        value
        for joint in told["setpoints"][0]["joints"].values()
        for key, value in joint.items()
        if "difference" in key
    } == {0.0}


@pytest.fixture
def record(tmp_path: Path) -> RunRecord:
    return bag_reader.read(write_run(tmp_path).bag_path)


def relabelled(record: RunRecord, names: tuple[str, ...], order: list[int]) -> RunRecord:
    """Return the same run with other names and another order of the joints."""
    log = record.log
    arrays = {name: getattr(log, name)[:, order] for name in bag_reader.ARRAYS}
    setpoints = [SentSetpoint(point.time, point.controller, point.positions[order]) for point in record.setpoints]
    return RunRecord(replace(log, joint_names=names, **arrays), setpoints)


def delayed(record: RunRecord, delay: float) -> RunRecord:
    """Return the same run with a setpoint that is recorded earlier than it was received."""
    return RunRecord(
        record.log, [SentSetpoint(point.time - delay, point.controller, point.positions) for point in record.setpoints]
    )


def worst(compared: comparison.Comparison) -> float:
    return max(move.peak_difference_max for move in comparison.difference_metrics(compared))


def test_joints_belong_together_by_name_whatever_their_order(record: RunRecord) -> None:
    turned = relabelled(record, (JOINTS[2], JOINTS[0], JOINTS[1]), [2, 0, 1])
    assert worst(comparison.overlay(record, turned, {}, {})) == 0.0


def test_a_panda_is_compared_with_an_fr3_joint_by_joint(record: RunRecord) -> None:
    panda = relabelled(record, ("panda_j1", "panda_j2", "panda_j3"), [0, 1, 2])
    fr3 = relabelled(record, ("fr3_j3", "fr3_j2", "fr3_j1"), [2, 1, 0])
    compared = comparison.overlay(panda, fr3, {}, {})
    assert compared.joint_names == ("panda_j1", "panda_j2", "panda_j3") and worst(compared) == 0.0
    with pytest.raises(ComparisonError, match="different joints: j1, j2, j3; and a, b, c"):
        comparison.overlay(record, relabelled(record, ("a", "b", "c"), [0, 1, 2]), {}, {})


def test_a_delay_of_the_recorder_shows_and_can_be_fitted_away(record: RunRecord) -> None:
    late = delayed(record, 0.007)
    assert worst(comparison.overlay(record, late, {}, {})) > 0.05
    fitted = comparison.overlay(record, late, {}, {}, fit=True)
    assert fitted.shift == pytest.approx(0.007) and worst(fitted) < 1e-9
    assert comparison.overlay(late, record, {}, {}, fit=True).shift == pytest.approx(-0.007)
    assert comparison.overlay(record, record, {}, {}, fit=True).shift == 0.0


def test_lost_cycles_are_bridged(record: RunRecord) -> None:
    log = record.log
    kept = np.r_[0:400, 420 : log.cycles]
    arrays = {name: getattr(log, name)[kept] for name in ("time", *bag_reader.ARRAYS)}
    compared = comparison.overlay(RunRecord(replace(log, **arrays), record.setpoints), record, {}, {})
    assert len(compared.overlays[0].time) == log.cycles - 20 - 100
    assert worst(compared) == 0.0
    assert worst(comparison.overlay(record, RunRecord(replace(log, **arrays), record.setpoints), {}, {})) < 1e-3


def test_other_setpoints_are_refused_and_none_at_all_compares_from_the_first_cycle(record: RunRecord) -> None:
    (point,) = record.setpoints
    moved = RunRecord(record.log, [SentSetpoint(point.time, point.controller, point.positions + np.array([0, 0.1, 0]))])
    with pytest.raises(ComparisonError, match=r"number 1 differs by 0\.1 rad"):
        comparison.overlay(record, moved, {}, {})
    bare = RunRecord(record.log, [])
    with pytest.raises(ComparisonError, match="different numbers of setpoints: 1 and 0"):
        comparison.overlay(record, bare, {}, {})
    (laid,) = comparison.overlay(bare, bare, {}, {}).overlays
    assert laid.target is None and len(laid.time) == record.log.cycles


def test_each_of_several_setpoints_is_compared_by_itself(record: RunRecord) -> None:
    (point,) = record.setpoints
    two = RunRecord(record.log, [point, SentSetpoint(1.0, point.controller, point.positions)])
    moves = comparison.difference_metrics(comparison.overlay(two, two, {}, {}))
    assert [move.time_a for move in moves] == [pytest.approx(point.time), 1.0]
    assert moves[0].duration == pytest.approx(0.9, abs=2e-3)


def test_an_output_that_cannot_be_written_and_a_joint_that_is_not_there_are_refused(tmp_path: Path) -> None:
    from hric_report.compare import compare

    folder = write_run(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot write"):
        compare(folder, folder, tmp_path / "file" / "x", figures=False)
    with pytest.raises(UnknownNameError, match="no joint 'j9' in the runs; valid: j1, j2, j3"):
        compare(folder, folder, tmp_path / "x", joint="j9", figures=False)


def test_settings_are_compared_key_by_key() -> None:
    a, b = {"robot": {"hw": "sim", "plant": {"x": 1}}, "same": [1]}, {"robot": {"hw": "real"}, "same": [1]}
    assert comparison.settings(a, b) == [
        SettingDifference("robot.hw", "sim", "real"),
        SettingDifference("robot.plant.x", 1, None),
    ]
