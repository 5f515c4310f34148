"""Verdicts on a tracked person: from a c3d file, and from the bag of a run without a simulated human."""

import math
import shutil
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pytest
import yaml

from hric_assessment.findings import Finding, Outcome
from hric_assessment.verdict import Verdict, assess, opened
from hric_assessment.verdict.person import people_of
from hric_core.command import main
from hric_report import headless as runner
from hric_run.definition import experiment


def headless(folder: Path, name: str, content: dict[str, Any]) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(content))
    words = ["simulator:=mujoco", "duration:=3"]
    return runner.run(experiment.load(str(path), words), words, root=folder, progress=False, figures=False).folder.path


def guided() -> dict[str, Any]:
    content = yaml.safe_load((experiment.config_path("experiments") / "guided_collection.yaml").read_text())
    content.pop("sync")
    content["human"]["parts"] = "upper_body"
    return dict(content)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def run(folder: Path) -> Path:
    """Return a run with a simulated human in front of cameras."""
    return headless(folder, "guided", guided())


@pytest.fixture(scope="module")
def c3d(folder: Path, run: Path) -> Path:
    """Return a c3d file with the markers of the person."""
    assert main(["export", str(run), "--format", "c3d", "--quiet"]) == 0
    (path,) = (run / "export").rglob("*.c3d")
    return Path(shutil.copy(path, folder / "trial.c3d"))


@pytest.fixture(scope="module")
def replayed(folder: Path, c3d: Path) -> Path:
    """Return a run with the same markers, EMG and plate, with a moving robot and without a simulated human."""
    content = guided()
    content.pop("human")
    content["controllers"] = ["joint_state_controller", "franka_state_controller", "joint_pd_controller"]
    content["parameters"] = {"joint_pd_controller": {"profile": {"velocity": 1.0, "acceleration": 5.0}}}
    there = [0.5, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8]
    content["setpoints"] = [{"time": 0.5, "controller": "joint_pd_controller", "positions": there}]
    labels = ezc3d.c3d(str(c3d))["parameters"]["POINT"]["LABELS"]["value"]
    worn = [label for label in labels if label.startswith("body_")]
    content["mocap"]["human"] = {"program": "c3d", "path": c3d.name, "name": "hand", "bodies": {"body": worn}}
    names = {label.removeprefix("body_"): f"Marker{k}" for k, label in enumerate(worn, 1)}
    content["person"] = {"asset": "body", "labels": names}
    content["emg"] = {"channels": ["biceps"], "emulated": {"activation": {"program": "bursts"}}}
    content["force_plate"]["emulated"] = {"load": {"program": "c3d", "path": c3d.name}}
    return headless(folder, "replayed", content)


@pytest.fixture(scope="module")
def verdict(replayed: Path) -> Verdict:
    return assess(opened(str(replayed)))


def findings(verdict: Verdict, group: str) -> dict[str, Finding]:
    return {one.subject: one for one in verdict.findings if one.group == group}


def test_the_joints_of_a_person_by_their_markers_are_those_that_moved_them(run: Path, c3d: Path) -> None:
    truth, found = people_of(opened(str(run)))[0], people_of(opened(str(c3d)))[0]
    inside = (found.time > 0.2) & (found.time < 2.8)
    for name in ("right_sh_flex", "right_el_flex", "trunk_flex", "neck_flex"):
        expected = np.interp(found.time, truth.time, truth.q[:, truth.names.index(name)])
        assert found.q[inside, found.names.index(name)] == pytest.approx(expected[inside], abs=math.radians(2.0))


def test_a_c3d_file_has_the_posture_scores_of_the_run_that_it_came_from(run: Path, c3d: Path) -> None:
    of_run, of_file = (findings(assess(opened(str(path))), "posture") for path in (run, c3d))
    assert set(of_file) == set(of_run)
    for subject, one in of_file.items():
        assert one.values["mean score"] == pytest.approx(of_run[subject].values["mean score"], abs=0.5)


def test_a_run_without_a_simulated_human_is_assessed_as_far_as_its_signals_allow(verdict: Verdict) -> None:
    assert verdict.person is not None and verdict.person.what == "tracked person"
    assert set(findings(verdict, "posture")) == {
        f"{name} of the {side} arm" for name in ("RULA", "REBA") for side in ("right", "left")
    }
    (apart,) = findings(verdict, "separation").values()
    assert apart.outcome == Outcome.ABOVE and "while the arm moves" in apart.reason
    assert apart.values["Z_d [m]"] == pytest.approx(0.0, abs=2e-3) and apart.values["Z_d [m]"] != 0.0
    (contacts,) = findings(verdict, "contact").values()
    assert contacts.outcome == Outcome.NOT_ASSESSABLE and "contacts are not recorded" in contacts.reason


def test_each_signal_that_it_lacks_is_listed_with_what_it_would_give(verdict: Verdict) -> None:
    found = {one.signal.partition(" (")[0]: one.gives for one in verdict.missing}
    assert set(found) == {
        "contacts of a person by region",
        "joint torques of a person",
        "activation of the muscles",
        "joint contact forces of a person",
        "objects in the hands, and the grip forces",
        "the maximum voluntary contraction of each EMG channel",
        "joints of the legs",
    }
    assert "F_ext, filtered at 20 Hz" in found["contacts of a person by region"]
    assert any("was not fitted to the person" in line for line in verdict.assumptions)


def test_their_root_is_where_the_simulated_one_was(run: Path, replayed: Path) -> None:
    truth, found = people_of(opened(str(run)))[0], people_of(opened(str(replayed)))[0]
    assert truth is not None and truth.root is not None and found is not None and found.root is not None
    expected = np.tile(truth.root.pose[0, :3], (len(found.root.pose), 1))
    assert found.root.pose[:, :3] == pytest.approx(expected, abs=5e-3)
