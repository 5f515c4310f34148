"""Metrics of a synthetic run with known values, and the content of its bag."""

import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import String
from synthetic import TARGET, TIME_CONSTANT, write_run

from hric_analysis import metrics
from hric_bags import reader as bag_reader
from hric_report.run import analyse
from hric_run.bag_writer import BagWriter


def test_settling_overshoot_and_final_error_are_those_of_an_exponential_move(tmp_path: Path) -> None:
    folder = write_run(tmp_path)
    result = analyse(folder, figures=False)
    (move,) = result["setpoints"]
    joint = move["joints"]["j1"]
    assert joint["settling_time"]["0.01"] == pytest.approx(TIME_CONSTANT * math.log(1.0 / 0.01), abs=2e-3)
    assert joint["settling_time"]["0.001"] == pytest.approx(TIME_CONSTANT * math.log(1.0 / 0.001), abs=2e-3)
    assert joint["final_error"] == pytest.approx(math.exp(-(1.999 - 0.1) / TIME_CONSTANT), rel=1e-6)
    assert joint["overshoot"] == 0.0
    assert move["joints"]["j2"]["settling_time"] == {"0.01": 0.0, "0.001": 0.0}
    assert move["settling_time_max"]["0.01"] == joint["settling_time"]["0.01"]
    assert move["final_error_max"] == joint["final_error"]


def diagnostics(name: str, missed: int) -> DiagnosticArray:
    values = [KeyValue("missed deadlines", str(missed)), KeyValue("cycles", "9")]
    return DiagnosticArray(status=[DiagnosticStatus(name=name, values=values)])


def test_missed_deadlines_are_the_last_that_each_loop_counted_and_stand_in_the_report(tmp_path: Path) -> None:
    said = [("/left: control loop", 3), ("/right: control loop", 2), ("/left: control loop", 17)]
    extra = [("/diagnostics", diagnostics(*one), 0.5 + 0.1 * k) for k, one in enumerate(said)]
    result = analyse(write_run(tmp_path / "live", extra=extra), figures=False)
    assert result["missed_deadlines"] == 19 and "19 deadlines missed" in result["report"]
    silent = analyse(write_run(tmp_path / "headless"), figures=False)
    assert silent["missed_deadlines"] is None and "deadlines" not in silent["report"]


def test_peaks_ratios_and_counts_stand_in_the_metrics(tmp_path: Path) -> None:
    joints = analyse(write_run(tmp_path), figures=False)["joints"]
    assert joints["j1"]["effort_peak"] == pytest.approx(10.0, abs=1e-6)
    assert joints["j1"]["effort_raw_peak"] == pytest.approx(20.0, abs=1e-6)
    assert joints["j1"]["rotatum_peak"] == pytest.approx(10.0 / TIME_CONSTANT, rel=1e-2)
    assert joints["j1"]["velocity_ratio"] == pytest.approx(joints["j1"]["velocity_peak"] / 20.0)
    assert joints["j2"]["limited_cycles"] == {"position": 0, "velocity": 7, "effort": 0, "effort_rate": 0}
    assert joints["j3"]["started_outside"] and joints["j3"]["position_excess_max"] == 0.03


def test_the_error_along_the_path_is_that_of_each_joint_at_the_instants_of_the_controllers_states(
    tmp_path: Path,
) -> None:
    record = bag_reader.read(write_run(tmp_path).bag_path)
    cycles, names = np.arange(3, 1990, 10), ("j3", "j1")  # in the controller's own order, and not all joints
    error = np.column_stack([np.full(len(cycles), -0.2), 0.1 * np.sin(2.0 * np.pi * np.arange(len(cycles)) / 20.0)])
    error = error[: len(error) // 20 * 20]
    cycles = cycles[: len(error)]
    desired = record.log.position[np.ix_(cycles, [2, 0])] + error
    record.profiles = {"pd": (record.log.time[cycles], desired, names)}
    found = metrics.path_metrics(record)
    assert found is not None and list(found) == ["pd"] and list(found["pd"].joints) == ["j3", "j1"]
    sine = found["pd"].joints["j1"]
    assert sine.largest_error == pytest.approx(0.1) and sine.rms_error == pytest.approx(0.1 / math.sqrt(2.0))
    assert vars(found["pd"].joints["j3"]) == pytest.approx({"largest_error": 0.2, "rms_error": 0.2})
    assert found["pd"].largest_error == found["pd"].rms_error == pytest.approx(0.2)


def test_a_joint_that_leaves_the_band_at_the_end_never_settled() -> None:
    time = np.arange(5) * 0.1
    assert metrics.settling_time(time, np.array([1.0, 0.0, 0.0, 0.0, 1.0]), 0.1) is None
    assert metrics.settling_time(time, np.array([1.0, 0.0, 1.0, 0.0, 0.0]), 0.1) == pytest.approx(0.3)


def test_overshoot_counts_past_the_target_only() -> None:
    assert metrics.overshoot(np.array([0.0, 1.2, 0.9, 1.0]), 1.0) == pytest.approx(0.2)
    assert metrics.overshoot(np.array([0.0, -1.2, -1.0]), -1.0) == pytest.approx(0.2)
    assert metrics.overshoot(np.array([0.0, -0.3, 0.5]), 1.0) == 0.0
    assert metrics.overshoot(np.array([0.5, 0.4, 0.5]), 0.5) == pytest.approx(0.1)


def test_a_setpoint_that_the_controller_had_to_refuse_is_no_move(tmp_path: Path) -> None:
    record = bag_reader.read(write_run(tmp_path).bag_path)
    good = record.setpoints[0]
    for positions in (np.array([1.0]), np.array([1.0, math.nan, 0.0])):
        record.setpoints.append(bag_reader.SentSetpoint(0.5, "pd", positions))
    assert [move.setpoint for move in metrics.moves(record, {})] == [good]


def test_the_controllers_own_joint_order_is_respected(tmp_path: Path) -> None:
    record = bag_reader.read(write_run(tmp_path).bag_path)
    (move,) = metrics.moves(record, {"pd": ["j3", "j2", "j1"]})
    assert move.target.tolist() == TARGET[::-1].tolist()


def test_every_figure_is_drawn_and_the_report_says_what_matters(tmp_path: Path) -> None:
    folder = write_run(tmp_path, lost=(50,))
    report = analyse(folder)["report"]
    drawn = {"positions", "velocities", "torques", "rotatum", "errors"}
    assert {path.stem for path in (folder.path / "figures").glob("*.png")} == drawn
    assert {path.stem for path in (folder.path / "figures").glob("*.svg")} == drawn
    assert (folder.path / "figures" / "captions.md").read_text().count("**") == 2 * len(drawn)
    assert "20 cycles MISSING in 1 gaps" in report
    assert "limits acted (cycles, summed over the joints): position 0, velocity 7" in report
    assert "started outside the position range: j3" in report
    assert not [path for path in folder.path.iterdir() if "tmp" in path.name]
    assert (folder.path / "summary.txt").read_text() == report


def test_an_error_leaves_no_bag_that_looks_whole_but_ctrl_c_does(tmp_path: Path) -> None:
    for error, whole in ((RuntimeError, False), (KeyboardInterrupt, True)):
        path = tmp_path / f"{error.__name__}.bag"
        with pytest.raises(error), BagWriter(path) as bag:
            bag.write("/text", String("x"), 1.5)
            raise error
        assert path.exists() == whole
        assert path.with_name(path.name + ".active").exists() != whole


def test_rosbag_info_reads_the_bag(tmp_path: Path) -> None:
    folder = write_run(tmp_path)
    done = subprocess.run(
        ["rosbag", "info", str(folder.bag_path)], capture_output=True, text=True, timeout=20, check=False
    )
    assert done.returncode == 0 and "/control_log" in done.stdout and "100 msgs" in done.stdout, (
        done.stdout + done.stderr
    )
