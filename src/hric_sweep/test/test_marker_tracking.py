"""The experiment marker_tracking headless: codec, client, controller and arm as in the laboratory, without sockets."""

import json
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from hric_bags import reader as bag_reader
from hric_bags.run_folder import RunFolder
from hric_report import headless
from hric_run.definition import experiment
from hric_sweep.study import definition as study
from hric_sweep.study import running as study_run

SHORT = ("mocap.human.begin:=0.2", "mocap.human.cycles:=0.5", "duration:=3.7")
"""Overrides for half a period of motion, with the hand at rest at the end."""


def run(folder: Path, *overrides: str, seed: int = 0, figures: bool = False) -> tuple[RunFolder, dict[str, Any]]:
    result = headless.run(
        experiment.load("marker_tracking", overrides),
        overrides,
        seed=seed,
        root=folder,
        progress=False,
        figures=figures,
    )
    return result.folder, result.metrics


def check_as_expected(metrics: dict[str, Any]) -> None:
    """Check the accuracy required of the default mode: 0.1 m at 0.25 Hz, frames at 240 Hz with 0.1 mm of noise."""
    found = metrics["tracking"]
    assert found["marker"] == "truth" and found["first_marker"] < 0.01
    assert 0.02 < found["lag"] <= 0.15
    assert found["rms_error"] <= 2e-3
    assert 0.9 < found["acceleration"]["ratio"] <= 1.5
    assert metrics["reflexes"] == [] and found["losses"] == 0 and found["refused"] == {}


@pytest.fixture(scope="module")
def half_a_swing(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunFolder, dict[str, Any]]:
    return run(tmp_path_factory.mktemp("runs"), *SHORT, figures=True)


def test_the_arm_follows_the_marker_within_lag_error_and_acceleration(
    half_a_swing: tuple[RunFolder, dict[str, Any]],
) -> None:
    folder, metrics = half_a_swing
    check_as_expected(metrics)
    assert metrics["tracking"]["frames"]["lost"] == 0 and metrics["tracking"]["frames"]["rate"] == pytest.approx(240.0)
    assert [phase["phase"] for phase in metrics["tracking"]["phases"]] == ["rest", "moving", "done"]
    assert abs(metrics["tracking"]["stamp_error"]["mean"]) < 5 * metrics["tracking"]["stamp_error"]["uncertainty"]
    assert json.loads(folder.metrics_path.read_text())["tracking"] == metrics["tracking"]
    assert re.search(r"lag \d+\.\d ms; after compensation of the lag: RMS error \d\.\d\d mm", metrics["report"])
    assert all(
        (folder.path / "figures" / name).stat().st_size > 10_000 for name in ("tracking.png", "tracking_path.png")
    )


def test_the_bag_has_what_the_laboratory_has_and_the_truth(half_a_swing: tuple[RunFolder, dict[str, Any]]) -> None:
    folder, _ = half_a_swing
    topics = bag_reader.read(folder.bag_of(folder.read())).topics
    assert topics["/hric/perception/mocap"] == topics["/mocap/marker"] == topics["/mocap/hand/pose"] > 880
    assert topics["/hric/human/hand"] in (369, 370) and topics["/hric/human/phase"] == 3
    assert topics["/cartesian_pose_controller/state"] > 360
    assert folder.read()["parameters"]["natnet_client"]["body"] == "hand"


def test_in_an_occlusion_the_marker_is_lost_and_the_run_says_so(tmp_path: Path) -> None:
    _, metrics = run(tmp_path, *SHORT, "mocap.stream.occlusions:=[[1.2, 0.5]]")
    found = metrics["tracking"]
    assert found["losses"] == 1 and found["frames"]["untracked"] == 120 and metrics["reflexes"] == []
    assert found["lag"] <= 0.15 and found["rms_error"] <= 2e-3
    assert "120 without the body" in metrics["report"] and "marker lost 1 times" in metrics["report"]


def test_axes_and_place_of_the_mocap_frame_do_not_change_the_motion(tmp_path: Path) -> None:
    base = "mocap.base_from_mocap:={xyz: [1.0, -0.5, 0.2], xyzw: [0, 0, 0.6, 0.8]}"
    short = ("noise:=0", "mocap.human.begin:=0.1", "duration:=0.8")
    paths = [
        bag_reader.read(folder.bag_of(folder.read())).log.position
        for folder, _ in (run(tmp_path, *short, *more) for more in ([], [base], [base, "mocap.stream.up_axis:=z"]))
    ]
    assert abs(paths[0][-1] - paths[0][0]).max() > 1e-2
    assert max(abs(path - paths[0]).max() for path in paths[1:]) < 2e-6  # float32 on the wire


def test_two_processes_with_one_seed_are_bit_identical(tmp_path: Path) -> None:
    short = ["mocap.human.begin:=0.1", "duration:=0.5", "--quiet", "--no-figures"]
    commands = [
        [
            str(Path(__file__).parents[2] / "hric_experiments" / "nodes" / "run"),
            "marker_tracking",
            *short,
            "--seed",
            seed,
            "--runs",
            str(tmp_path / str(i)),
        ]
        for i, seed in enumerate("77")
    ]
    children = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ) for command in commands]
    hashes = [re.findall(r"state_sha256: ([0-9a-f]{64})", child.communicate(timeout=100)[0])[0] for child in children]
    assert hashes[0] == hashes[1]


def test_a_network_is_not_emulated_where_there_is_none(tmp_path: Path) -> None:
    with pytest.raises(Exception, match=r"jitter is .*; valid in a headless run, which has no network: 0"):
        run(tmp_path, "mocap.stream.jitter:=0.001")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_whole_experiment_and_the_thesiss_mode_stand_side_by_side(tmp_path: Path) -> None:
    wanted = study.load("marker_tracking_modes")
    result = study_run.run(wanted, wanted.chosen([]), (), seed=0, root=tmp_path, progress=False, figures=True)
    runs = result.metrics["forms"]["modes"]["runs"]
    for name, values in runs.items():
        metrics = json.loads((tmp_path / values["run"] / "metrics.json").read_text())
        assert metrics["reflexes"] == [] and metrics["control_log"]["cycles"] == 14000
        if name == "retarget":
            check_as_expected(metrics)
    assert runs["thesis"]["tracking"]["ignored"] > 2000 and runs["thesis"]["tracking"]["acceleration_ratio"] > 5
    assert (result.folder / "modes" / "tracking.png").is_file()
    assert re.search(r"marker tracking +lag \[ms\]", result.metrics["report"])
