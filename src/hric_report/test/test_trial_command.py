"""`hric trial`: files of a laboratory become a folder with angles, model and page, complete or not at all."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import ezc3d
import laboratory_files
import numpy as np
import opensim
import pytest

from hric_assessment.verdict.assess import assess
from hric_assessment.verdict.inputs import opened
from hric_core.command import perform
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.trial.opensim_text import read_storage
from hric_human.body import Subject, describe
from hric_motion.measured import MeasuredMotion
from hric_motion.moments import joint_moments
from hric_motion.postures import BodyPostures, MarkerPostures
from hric_report.trial import page, summary

RATE, FRAMES = 50.0, 40
BODY = describe(Subject(code="S07", mass=78.2, height=1.759, sex="male", parts="whole_body"))
NAMES = tuple(name for name in BODY.markers if name not in ("LFHD", "RFHD", "LBHD", "RBHD"))  # the neck is not known
FILES = {
    *("angles.csv", "angles.mot", "human.osim", "moments.csv", "inverse_dynamics.mot", "inverse_dynamics.xml"),
    *("trial.html", "trial.json"),
}


def positions() -> FloatArray:
    """Return the markers of a person who stands and bends both elbows, shape (n, m, 3) [m]."""
    t, joints = np.arange(FRAMES) / RATE, list(BODY.joints)
    q = np.zeros((FRAMES, len(joints)))
    for side in ("right", "left"):
        q[:, joints.index(f"{side}_el_flex")] = 0.8 + 0.5 * np.sin(3.0 * t)
    still = BodyPostures(np.tile(np.eye(3), (FRAMES, 1, 1)), np.tile([0.4, 0.1, 0.95], (FRAMES, 1)), q)
    return MarkerPostures(BODY, NAMES).positions(still) + 1e-3 * np.random.default_rng(0).normal(size=(FRAMES, 35, 3))


def write(path: Path, labels: list[str], p: FloatArray) -> Path:
    """Write markers as a c3d file that states z up; p: shape (n, m, 3) [m]."""
    path.parent.mkdir(parents=True, exist_ok=True)
    file = ezc3d.c3d()
    file["data"]["points"] = np.vstack([1e3 * p.transpose(2, 1, 0), np.ones((1, len(labels), len(p)))])
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["LABELS"]["value"] = labels
    file.add_parameter("POINT", "UNITS", ["mm"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    file.write(str(path))
    return path


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("motion") / "bend.c3d", list(NAMES), positions())


@pytest.fixture(scope="module")
def folder(motion: Path) -> Path:
    assert perform(["trial", str(motion), "--mass", "78.2", "--height", "1.759"]) == 0
    return motion.parent / "bend_trial"


def test_all_files_are_in_one_folder(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} == FILES
    assert {path.name for path in folder.parent.iterdir()} == {"bend.c3d", "bend_trial"}


def test_cells_of_unknown_joints_are_empty(folder: Path) -> None:
    rows = list(csv.DictReader((folder / "angles.csv").open()))
    assert len(rows) == FRAMES
    assert {row["neck_rot [deg]"] + row["neck_rot deviation [deg]"] for row in rows} == {""}
    error = [float(row["right_el_flex [deg]"]) for row in rows] - np.degrees(
        0.8 + 0.5 * np.sin(3.0 * np.arange(40) / 50)
    )
    assert np.abs(error).max() < 3.0


def test_moments_of_legs_without_a_plate_are_empty(folder: Path) -> None:
    rows = list(csv.DictReader((folder / "moments.csv").open()))
    assert {row["left_knee_flex [N m]"] for row in rows} == {""}
    elbow = np.array([float(row["right_el_flex [N m]"]) for row in rows[15:-15]])
    assert 1.0 < elbow.mean() < 5.0  # forearm and hand of 1.7 kg, bent by about 45 deg
    half = np.array([float(row["right_el_flex half-width [N m]"]) for row in rows[15:-15]])
    assert (half / elbow > 0.05).all() and (half / elbow < 0.3).all()  # 5.5 % by mass and length alone
    joint = json.loads((folder / "trial.json").read_text())["moments"]["joints"]["right_el_flex"]
    assert joint["low_end"] < joint["low"] < joint["high"] < joint["high_end"]
    assert "N m at the worse end (95 %)" in (folder / "trial.html").read_text()


def test_unknown_joints_have_their_reason(folder: Path) -> None:
    values = json.loads((folder / "trial.json").read_text())
    assert {"neck_flex", "neck_bend", "neck_rot"} <= set(values["unknown"])
    assert values["joints"]["neck_rot"]["reason"].startswith("no markers on its segment and beyond: +- 46 deg in 100 %")


def test_model_and_motion_place_the_elbow(folder: Path) -> None:
    model = opensim.Model(str(folder / "human.osim"))
    state, motion = model.initSystem(), read_storage(folder / "angles.mot").columns
    for name, values in motion.items():
        model.getCoordinateSet().get(name).setValue(state, float(np.nan_to_num(values[7])), False)
    model.realizePosition(state)
    x, up, right = (model.getBodySet().get("r_elbow").getPositionInGround(state).get(k) for k in range(3))
    marker = positions()[7, NAMES.index("RELB")]
    radius = BODY.segments["right_upper_arm"].radius
    assert np.linalg.norm(marker - [x, -right, up]) == pytest.approx(radius, abs=0.01)


def test_without_a_head_the_lumbar_load_is_not_known(folder: Path) -> None:
    assert json.loads((folder / "trial.json").read_text())["lumbar"] is None
    assert "L5/S1 compression is not known; it needs the moment of trunk_flex" in (folder / "trial.html").read_text()


def test_the_lumbar_load_is_judged_by_its_worse_end() -> None:
    q = np.zeros((100, len(BODY.joints)))
    q[:, list(BODY.joints).index("trunk_flex")] = np.radians(80.0)
    root, none = np.tile([0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0], (100, 1)), np.zeros((100, 1))
    heavy = describe(replace(BODY.subject, mass=115.0))
    bent = MeasuredMotion(heavy, (), q, 0.0 * q, root, none, none[0], 0.001)
    values = summary.lumbar_values(joint_moments(bent, RATE))
    assert values is not None and values["compression"] < 3400.0 < values["high"]
    assert "), at the worse end above the NIOSH action limit of 3.4 kN; known in" in summary.lumbar_line(
        {"lumbar": values, "moments": {"hands": ""}}
    )


def test_a_lifted_load_is_in_moments_and_texts(
    motion: Path, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--load", "5", "--hand", "right", "--from", "0.1", "--mass", "78.2", "--height", "1.759"]
    assert perform(["trial", str(motion), "-o", str(tmp_path), *words]) == 0
    assert "load on the hands: 5 kg in the right hand from 0.1 s" in capsys.readouterr().out
    made = json.loads((tmp_path / "bend_trial" / "trial.json").read_text())["moments"]
    alone = json.loads((folder / "trial.json").read_text())["moments"]["joints"]["right_el_flex"]
    assert made["hands"] == "5 kg in the right hand from 0.1 s"
    assert made["joints"]["right_el_flex"]["high"] > alone["high"] + 5.0 * 9.81 * 0.15
    assert "load_1_force_y" in (tmp_path / "bend_trial" / "loads.sto").read_text()


def test_the_page_loads_nothing(folder: Path) -> None:
    text = (folder / "trial.html").read_text()
    assert "neck_rot" in text and not re.search(r"<script|https?://", text)


def test_results_of_the_same_file_are_replaced(motion: Path, folder: Path) -> None:
    before = (folder / "trial.json").stat().st_ino
    assert perform(["trial", str(motion)]) == 0
    assert (folder / "trial.json").stat().st_ino != before
    assert [path.name for path in motion.parent.glob("*_trial*")] == ["bend_trial"]


def test_results_of_another_file_are_kept(motion: Path, folder: Path) -> None:
    other = write(motion.parent / "other" / "bend.c3d", list(NAMES), positions()[:30])
    assert perform(["trial", str(other), "-o", str(folder.parent)]) == 0
    assert {path.name for path in folder.parent.glob("bend_trial*")} == {"bend_trial", "bend_trial_2"}


def test_nothing_is_left_of_an_interrupted_trial(motion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(page, "build", interrupted)
    with pytest.raises(KeyboardInterrupt):
        perform(["trial", str(motion), "-o", str(tmp_path)])
    assert not list(tmp_path.iterdir())


def test_people_of_a_file_stand_side_by_side(motion: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    p = positions()
    labels = [f"{who}:{name}" for who in ("Ann", "Bo") for name in NAMES]
    two = write(tmp_path / "two.c3d", labels, np.concatenate([p, p + 1.0], axis=1))
    bad = write(tmp_path / "bad.c3d", ["A", "B"], p[:, :2])
    assert perform(["trial", str(two), "--prefix", "all"]) == 0
    table = list(csv.DictReader((tmp_path / "trials.csv").open()))
    assert [row["trial"] for row in table] == ["two_Ann_trial", "two_Bo_trial"]
    assert perform(["trial", str(motion), str(bad), "-o", str(tmp_path)]) == 3
    assert "failed: bad.c3d has no known marker set" in capsys.readouterr().err


def test_a_missing_mapping_is_written(motion: Path, tmp_path: Path) -> None:
    with pytest.raises(HricError, match="was written with the 35 labels"):
        perform(["trial", str(motion), "--labels", str(tmp_path / "map.yaml")])
    assert '"LASI": LASI' in (tmp_path / "map.yaml").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--subject", "s.yaml", "--mass", "70"], "--subject and --mass contradict"),
        (["--labels", "map.yaml", "--prefix", "A"], "--labels and --prefix contradict"),
        (["--load", "5"], "the load on the hands is not clear; valid: --hand"),
        (["--handle", "1", "--hand", "left"], "bend.c3d has no force plate 1; valid: none"),
        (["--load", "5", "--hand", "left", "--from", "60"], "lifted from 60 s to inf s; the motion is known"),
        (["--mass", "0"], "subject: mass is 0.0; valid: a finite number from 30 to 200"),
        (["--mass", "7"], "subject: mass is 7.0; valid: a finite number from 30 to 200"),
        (["--prefix", "Ann"], "no markers with the prefix 'Ann'; valid: '' "),
    ],
)
def test_mistakes_in_the_options_are_refused(words: list[str], message: str, motion: Path) -> None:
    with pytest.raises(HricError, match=message):
        perform(["trial", str(motion), *words])


@pytest.fixture(scope="module")
def handover(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a handover in which both people hold the object for 0.1 s."""
    rows = np.arange(laboratory_files.FRAMES)
    grips = {"giver": np.where(rows < 40, 20.0, 0.0), "taker": np.where(rows < 28, 0.0, 30.0)}
    return laboratory_files.write_handover(tmp_path_factory.mktemp("people") / "pass", grips)


def test_both_people_of_a_handover_get_a_folder(handover: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert perform(["trial", str(handover), "--prefix", "all", "--mass", "70", "--height", "1.72"]) == 0
    values = json.loads((handover.parent / "pass_taker_trial" / "trial.json").read_text())
    assert (handover.parent / "pass_giver_trial" / "trial.html").is_file()
    assert values["handover"]["overlap"] == pytest.approx(0.1) and values["handover"]["force_max"] is None
    assert "both hold the object for 0.1 s" in capsys.readouterr().out


def test_postures_of_both_people_are_assessed(handover: Path) -> None:
    verdict = assess(opened(str(handover)))
    assert {"pass/giver", "pass/taker"} <= {finding.person for finding in verdict.findings}


def test_a_folder_of_opencap_gives_its_trials(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("walk", "squat"):
        laboratory_files.write_trc(tmp_path / "MarkerData" / f"{name}.trc", laboratory_files.points("opencap"))
    (tmp_path / "sessionMetadata.yaml").write_text("mass_kg: 70.0\nheight_m: 1.72\n")
    assert perform(["trial", str(tmp_path), "-o", str(tmp_path / "out")]) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"squat_trial", "walk_trial", "trials.csv"}
    assert "Subject: 70 kg (walk.trc), 1.72 m (walk.trc)" in capsys.readouterr().out
