"""`hric validate human`: angles and moments of trials beside those of other programs."""

import csv
from pathlib import Path

import ezc3d
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from standing_person import BODY, JOINTS, RATE, standing

from hric_core.command import perform
from hric_motion.postures import BodyPostures, MarkerPostures
from hric_report.trial.opensim_check import DYNAMICS, KINEMATICS, VENDOR

NAMES = tuple(BODY.markers)
Rows = dict[tuple[str, str], dict[str, str]]


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a c3d file of a person who moves, with an angle of the laboratory's software that is 5 degrees off."""
    motion = standing()
    postures = BodyPostures(Rotation.from_quat(motion.root[:, 3:]).as_matrix(), motion.root[:, :3], motion.q)
    p = MarkerPostures(BODY, NAMES).positions(postures)[:100]
    p[:50, -1] = np.nan
    angle = np.zeros((len(p), 1, 3))
    angle[:, 0, 0] = np.degrees(motion.q[:100, JOINTS.index("right_el_flex")]) + 5.0
    file = ezc3d.c3d()
    points = np.concatenate([1e3 * p, angle], axis=1).transpose(2, 1, 0)
    file["data"]["points"] = np.vstack([points, np.ones((1, *points.shape[1:]))])
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["LABELS"]["value"] = [*NAMES, "RElbowAngles"]
    file.add_parameter("POINT", "UNITS", ["mm"])
    file.add_parameter("POINT", "ANGLES", ["RElbowAngles"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    path = tmp_path_factory.mktemp("validation") / "stand.c3d"
    file.write(str(path))
    return path


@pytest.fixture(scope="module")
def rows(trial: Path) -> Rows:
    subject = BODY.subject
    assert perform(["validate", "human", str(trial), "--mass", f"{subject.mass}", "--height", f"{subject.height}"]) == 0
    with (trial.parent / "validation.csv").open() as file:
        return {(row["program"], row["joint"]): row for row in csv.DictReader(file)}


def test_opensim_finds_the_same_angles(rows: Rows) -> None:
    errors = {joint: float(row["RMS"]) for (program, joint), row in rows.items() if program == KINEMATICS}
    assert {"right_el_flex", "left_knee_flex", "trunk_flex"} <= set(errors)
    assert max(errors.values()) < 1.0, errors


def test_opensim_finds_the_same_moments(rows: Rows) -> None:
    shares = {
        joint: float(row["RMS"]) / max(float(row["largest value"]), 1.0)
        for (program, joint), row in rows.items()
        if program == DYNAMICS
    }
    assert "right_el_flex" in shares and max(shares.values()) < 0.02, shares


def test_a_constant_difference_of_the_laboratory_is_shown(rows: Rows) -> None:
    row = rows[VENDOR, "right_el_flex"]
    assert float(row["RMS"]) == pytest.approx(5.0, abs=1.5)
    assert float(row["RMS without mean"]) < 1.0


def test_the_page_has_a_bar_for_each_joint(trial: Path, rows: Rows) -> None:
    text = (trial.parent / "validation.html").read_text()
    assert text.count(" class=varying") + text.count(' class="varying"') == len(rows)
    assert "<script" not in text
