"""Studies: comparison of physics engines as in thesis ch. 5.4, and mistakes in a study file."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest

from hric_core.command import perform
from hric_core.errors import HricError
from hric_sweep.study import definition as study
from hric_sweep.study import results
from hric_sweep.study import running as study_run

PAIR = {"runs": ["a", "b"], "at_most": 1e-3}
FORM: dict[str, Any] = {"experiment": "pd_step", "runs": {"a": ["kp:=50"], "b": ["kp:=60"]}, "compared": [PAIR]}


def study_of(**form: Any) -> study.Study:
    return study.parse("trial", {"description": "two gains", "forms": {"one": {**FORM, **form}}})


def run(wanted: study.Study, root: Path, *given: str, figures: bool = False) -> study_run.StudyResult:
    return study_run.run(wanted, wanted.chosen([]), given, seed=0, root=root, progress=False, figures=figures)


@pytest.fixture(scope="module")
def engines(tmp_path_factory: pytest.TempPathFactory) -> tuple[subprocess.CompletedProcess[str], dict[str, Any], Path]:
    """Run the study `engines` as a user does."""
    root = tmp_path_factory.mktemp("runs")
    command = ["rosrun", "hric_experiments", "run", "engines", "--quiet", "--runs", str(root)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, env=os.environ)
    folder = (root / "latest").resolve()
    return done, json.loads((folder / "metrics.json").read_text()), folder


def peak(metrics: dict[str, Any], form: str, *runs: str) -> float:
    (pair,) = [pair for pair in metrics["forms"][form]["compared"] if pair["runs"] == list(runs)]
    return float(pair["peak_difference_max"])


@pytest.mark.slow  # a minute for the study
def test_the_engines_move_alike_in_both_forms(engines: tuple[Any, dict[str, Any], Path]) -> None:
    done, metrics, _ = engines
    assert done.returncode == 0, done.stdout + done.stderr
    assert peak(metrics, "reduced", "opensim", "pybullet") <= 1e-4
    assert peak(metrics, "reduced", "opensim_semi_implicit", "pybullet_semi_implicit") <= 1e-9
    assert peak(metrics, "full", "opensim", "pybullet") <= 1e-5
    assert peak(metrics, "full", "opensim", "mujoco") <= 1e-7


@pytest.mark.slow  # a minute for the study
def test_the_law_sees_time_rise_in_every_call(engines: tuple[Any, dict[str, Any], Path]) -> None:
    for form, calls in (("reduced", 4000), ("full", 6000)):
        for values in engines[1]["forms"][form]["runs"].values():
            assert values["law_times"]["calls"] == calls
            assert values["law_times"]["strictly_rising"] and values["law_times"]["backward_steps"] == 0


@pytest.mark.slow  # a minute for the study
def test_all_engines_put_the_links_at_the_same_place_before_the_start(
    engines: tuple[Any, dict[str, Any], Path],
) -> None:
    for form in engines[1]["forms"].values():
        assert form["start_pose_difference_max"] < 1e-6


@pytest.mark.slow  # a minute for the study
def test_all_engines_are_in_one_figure_and_figures_17_18_and_19_of_the_thesis_are_drawn(
    engines: tuple[Any, dict[str, Any], Path],
) -> None:
    folder = engines[2]
    for form in ("reduced", "full"):
        for name in (
            "distances",
            "positions",
            "law_times",
            "initial_poses",
            *(f"opensim_pybullet/figures/{figure}" for figure in ("positions", "differences")),
        ):
            assert (folder / form / f"{name}.png").stat().st_size > 10_000


def test_time_that_goes_back_is_counted() -> None:
    told = results.law_times(np.array([0.0, 1e-3, 0.5e-3, 2e-3]))
    assert told["backward_steps"] == 1 and not told["strictly_rising"] and told["step_min"] == pytest.approx(-0.5e-3)


def test_a_difference_above_its_bound_falls_short_and_one_below_holds(tmp_path: Path) -> None:
    short = run(study_of(), tmp_path, "duration:=0.5")
    assert not short.passed and "OUT OF BOUNDS" in short.metrics["report"]
    assert run(study_of(compared=[PAIR | {"at_most": 1.0}]), tmp_path, "duration:=0.5").passed


def test_joints_and_grip_force_of_a_human_have_bounds_too(tmp_path: Path) -> None:
    stiffness = "parameters.cartesian_impedance_controller.translational_stiffness"
    runs = {"soft": [f"{stiffness}:=100"], "stiff": [f"{stiffness}:=300"]}
    pair = {"runs": ["soft", "stiff"], "at_most": 3.0, "force_bound": 1e-3}
    study = study_of(
        experiment="hand_guidance",
        changes=["simulator:=mujoco"],
        runs=runs,
        compared=[pair, {"runs": ["soft", "stiff"]}],
    )
    result = run(study, tmp_path, "duration:=1.5")
    bounded, reported = result.metrics["forms"]["one"]["compared"]
    assert not bounded["passed"] and reported["passed"] is None
    assert bounded["human_force_difference_max"] > 0.1 and 0.0 < bounded["human_joint_difference_max"] < 0.1
    (line,) = [line for line in result.metrics["report"].splitlines() if "OUT OF BOUNDS" in line]
    assert f"{bounded['human_force_difference_max']:.2e}" in line and "1.0e-03" in line


def test_options_of_an_engine_are_refused_for_a_study(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").touch()
    with pytest.raises(
        HricError, match="is a study, which executes one run after the other; valid: without --jobs and --dask"
    ):
        perform(["sweep", "--resume", str(tmp_path), "--jobs", "2"])


def test_a_study_that_was_cut_off_goes_on_with_the_runs_it_lacks(tmp_path: Path) -> None:
    whole = run(study_of(), tmp_path, "duration:=0.2")
    journal = whole.folder / "one" / "runs.jsonl"
    first, second = journal.read_text().splitlines(keepends=True)
    journal.write_text(first + second[:30])  # the machine went off within a line
    assert perform(["sweep", "--resume", str(whole.folder), "--quiet"]) == (0 if whole.passed else 3)
    again = json.loads((whole.folder / "metrics.json").read_text())["forms"]["one"]
    expected = whole.metrics["forms"]["one"]
    assert again["runs"]["a"] == expected["runs"]["a"] and again["runs"]["b"]["run"] != expected["runs"]["b"]["run"]
    assert again["compared"] == expected["compared"]
    rows = pyarrow.parquet.read_table(whole.folder / "one" / "runs.parquet")
    assert rows["row"].to_pylist() == ["a", "b"] and all(rows["state_sha256"].to_pylist())


def test_a_pair_without_bound_is_only_reported(tmp_path: Path) -> None:
    result = run(study_of(compared=[{"runs": ["a", "b"]}]), tmp_path, "duration:=0.2")
    assert result.passed and "reported" in result.metrics["report"]
    assert result.metrics["forms"]["one"]["compared"][0]["peak_difference_max"] > 0.0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"compared": [{"runs": ["a", "c"]}]}, ("forms.one.compared[0].runs", "a, b", "c")),
        ({"compared": [{"runs": ["a"]}]}, ("forms.one.compared[0].runs is ['a']; valid: a list of 2 names",)),
        ({"compared": []}, ("forms.one.compared is []; valid: a list",)),
        ({"compared": [PAIR | {"at_most": -1}]}, ("forms.one.compared[0].at_most", "above 0")),
        ({"runs": {"a": "kp:=50"}}, ("forms.one.runs.a is 'kp:=50'; valid: a list",)),
        ({"color": 1}, ("no parameter 'color' in forms.one", "valid: abscissa, changes, compared, experiment, runs")),
    ],
)
def test_a_mistake_in_a_study_is_named_with_its_place(change: dict[str, Any], told: tuple[str, ...]) -> None:
    with pytest.raises(HricError) as caught:
        study_of(**change)
    assert all(text in str(caught.value) for text in ("study trial", *told))


def test_a_mistake_in_an_override_is_refused_before_anything_runs(tmp_path: Path) -> None:
    with pytest.raises(HricError, match="kpp"):
        run(study_of(), tmp_path, "kpp:=3")
    assert not list(tmp_path.iterdir())


def test_a_study_may_lie_anywhere_with_its_experiment_beside_or_by_name(tmp_path: Path) -> None:
    path = tmp_path / "gains.yaml"
    path.write_text(study.EXAMPLE)
    assert study.is_study(str(path)) and study.load(str(path)).name == "gains"
    path.write_text("robot: {}\n")
    assert not study.is_study(str(path)) and not study.is_study("pd_step") and study.is_study("engines")


def test_a_study_is_found_by_the_name_it_had_before() -> None:
    assert study.load("opensim_vs_pybullet") == study.load("engines") and study.is_study("opensim_vs_pybullet")


def test_an_unknown_form_is_refused(tmp_path: Path) -> None:
    command = ["rosrun", "hric_experiments", "run", "engines", "--form", "half", "--runs", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, env=os.environ)
    assert done.returncode == 2 and "full, reduced" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(("verdict", "passed"), [("stable", True), (None, True), ("unstable", False)])
def test_a_study_with_an_unstable_run_has_not_passed(verdict: str | None, passed: bool, tmp_path: Path) -> None:
    form = {"runs": {"a": {"stability": "stable"}, "b": {"stability": verdict}}, "compared": [{"passed": True}]}
    assert study_run.StudyResult(tmp_path, {"forms": {"one": form}}, interrupted=False).passed is passed
