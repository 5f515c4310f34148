"""Recorded motions as references: angles, and markers by inverse kinematics."""

import math
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import opensim
import pytest
from bodies import Posed, body
from numpy.testing import assert_allclose

from hric_core.errors import ParameterError
from hric_human.body import Body
from hric_human.control import HumanControl
from hric_human.control.recorded import MarkerSolver

RATE = 100.0
TURNED = {"xyz": [0.4, -0.2, 0.9], "xyzw": [0.0, 0.0, math.sin(0.5), math.cos(0.5)]}
"""Pose of the root link in the laboratory."""


def swings(one: Body, frames: int, seed: int = 1) -> np.ndarray:
    """Joint angles of a smooth motion inside the ranges, away from the shoulder's singularity, shape (frames, n)."""
    random = np.random.default_rng(seed)
    low, high = np.array([joint.range for joint in one.joints.values()]).T
    high = np.minimum(high, np.radians(75))
    phases, speed = random.uniform(0, 2 * np.pi, len(low)), random.uniform(0.5, 1.5, len(low))
    time = np.arange(frames)[:, None] / RATE
    return np.asarray(0.5 * (low + high) + 0.4 * (high - low) * np.sin(speed * time + phases))


def markers_of(one: Body, q: np.ndarray, T: bool = False) -> dict[str, np.ndarray]:
    """Return the body's marker positions computed by pinocchio, shape (frames, 3) each [m].

    T: pose of the root link in the laboratory.
    """
    R = np.array([[math.cos(1), -math.sin(1), 0], [math.sin(1), math.cos(1), 0], [0, 0, 1]]) if T else np.eye(3)
    offset = np.array(TURNED["xyz"]) if T else np.zeros(3)
    found: dict[str, list[np.ndarray]] = {name: [] for name in one.markers}
    for row in q:
        posed = Posed(one, **dict(zip(one.joints, np.degrees(row), strict=True)))
        for name, marker in one.markers.items():
            found[name].append(R @ posed.point(marker.link, marker.p_link_marker) + offset)
    return {name: np.array(rows) for name, rows in found.items()}


def control(one: Body, **reference: Any) -> Any:
    return HumanControl(one, {"parameters": {"reference": reference}}, 0)._controller._reference  # type: ignore[attr-defined]


@pytest.mark.parametrize("parts", ["right_arm", "whole_body"])
def test_markers_of_a_motion_give_back_where_the_segments_were(parts: str) -> None:
    one = body(parts=parts)
    q, names = swings(one, 40), list(one.markers)
    true = markers_of(one, q)
    rows, distances = MarkerSolver(HumanControl(one, {}, 0).person, names).solve(
        np.stack([true[name] for name in names], axis=1)
    )
    assert distances.max() < 1e-6
    again = markers_of(one, np.array(rows))
    assert max(np.abs(again[name] - true[name]).max() for name in names) < 1e-6


def test_a_reference_of_markers_goes_through_the_motion_and_rests_at_its_ends() -> None:
    one = body(parts="right_arm")
    q = swings(one, 80)
    markers = {name: rows.tolist() for name, rows in markers_of(one, q, T=True).items()}
    reference = control(
        one, program="markers", rate=RATE, markers=markers | {"LASI": [[0, 0, 0]] * 80}, root_in_lab=TURNED
    )
    reference.start(1.0)
    assert_allclose(reference.at(1.0 + 0.4)[0][:4], q[40][:4], atol=1e-5)  # a hand's one marker leaves its joints free
    assert_allclose(reference.at(1.0 + 0.405)[0][:4], 0.5 * (q[40] + q[41])[:4], atol=1e-4)
    assert_allclose(reference.at(1.0 + 0.4)[1][:4], (q[41] - q[39])[:4] * RATE / 2, atol=1e-3)
    assert reference.at(0.5) == (reference.at(0.9)[0], [0.0] * 7)
    assert reference.at(9.0)[1] == [0.0] * 7


def test_noise_and_hidden_markers_move_the_joints_little() -> None:
    one = body(parts="right_arm")
    person, names, q = HumanControl(one, {}, 0).person, list(one.markers), swings(one, 60)
    true = markers_of(one, q)
    seen = np.stack([true[name] for name in names], axis=1)
    seen = seen + np.random.default_rng(2).normal(0.0, 1e-4, seen.shape)
    seen[20:25, names.index("RELB")] = np.nan
    seen[40:42] = np.nan
    rows, distances = MarkerSolver(person, names).solve(seen)
    assert np.abs(np.array(rows)[:, :4] - q[:, :4])[5:40].max() < 0.02
    assert rows[41] == rows[40] == rows[39]
    assert 1e-5 < distances[5:40].mean() < 2e-4


def test_a_c3d_file_is_a_reference_too(tmp_path: Path) -> None:
    one = body(parts="right_arm")
    q = swings(one, 50)
    markers = markers_of(one, q, T=True)
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(markers)
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = 1e3 * np.stack(list(markers.values())).transpose(2, 0, 1)
    file["data"]["points"] = np.concatenate([points, np.ones((1, *points.shape[1:]))])
    file.write(str(tmp_path / "trial.c3d"))
    reference = control(one, program="c3d", path=str(tmp_path / "trial.c3d"), root_in_lab=TURNED)
    reference.start(0.0)
    assert_allclose(reference.at(0.3)[0][:4], q[30][:4], atol=1e-4)  # single precision in the file


def test_a_trc_file_with_y_up_and_the_name_of_an_asset_before_its_markers_is_a_reference_too(tmp_path: Path) -> None:
    one = body(parts="right_arm")
    q = swings(one, 50)
    y_up = {f"body_{name}": rows[:, [0, 2, 1]] * [1.0, 1.0, -1.0] for name, rows in markers_of(one, q, T=True).items()}
    table = opensim.TimeSeriesTableVec3()
    table.setColumnLabels(list(y_up))
    for k in range(len(q)):
        row = [opensim.Vec3(*(1e3 * rows[k]).tolist()) for rows in y_up.values()]
        table.appendRow(k / RATE, opensim.RowVectorVec3(row))
    table.addTableMetaDataString("DataRate", str(RATE))
    table.addTableMetaDataString("Units", "mm")
    opensim.TRCFileAdapter.write(table, str(tmp_path / "trial.trc"))
    reference = control(one, program="trc", path=str(tmp_path / "trial.trc"), root_in_lab=TURNED)
    reference.start(0.0)
    assert_allclose(reference.at(0.3)[0][:4], q[30][:4], atol=1e-4)


@pytest.mark.parametrize("degrees", ["yes", "no"])
def test_a_mot_file_is_a_reference_too_and_columns_of_other_joints_are_left_out(tmp_path: Path, degrees: str) -> None:
    one, scale = body(parts="right_arm"), 180.0 / math.pi if degrees == "yes" else 1.0
    table = opensim.TimeSeriesTable()
    table.setColumnLabels(["/jointset/elbow/right_el_flex/value", "right_sh_rot", "knee_angle_r"])
    for k in range(101):
        table.appendRow(k / RATE, opensim.RowVector([scale * (0.5 + 0.01 * k), scale * 0.1, 5.0]))
    table.addTableMetaDataString("inDegrees", degrees)
    opensim.STOFileAdapter.write(table, str(tmp_path / "trial.mot"))
    reference = control(one, program="mot", path=str(tmp_path / "trial.mot"))
    reference.start(0.0)
    q, dq = reference.at(0.5)
    assert (q[3], q[2], dq[3]) == pytest.approx((1.0, 0.1, 1.0), abs=1e-6)
    assert q[4:] == [0.0] * 3


def test_recorded_angles_are_followed_and_other_joints_rest() -> None:
    one = body(parts="right_arm")
    angles = {"right_el_flex": np.linspace(0.5, 1.5, 101), "right_sh_rot": [0.1] * 101}
    reference = control(one, program="angles", rate=RATE, angles=angles)
    reference.start(0.0)
    q, dq = reference.at(0.5)
    assert (q[3], q[2], dq[3]) == pytest.approx((1.0, 0.1, 1.0))
    assert q[4:] == [0.0] * 3


BAD = {
    "angles must have one joint or more, all with the same number of values": {
        "angles": {"right_el_flex": [1, 1], "right_sh_rot": [0]}
    },
    "no joint 'right_knee' in human.control.parameters.reference.angles; valid: right_el_flex, ": {
        "angles": {"right_knee": [1]}
    },
    r"angles.right_el_flex\[1\] is 3.0; valid: 0.000 to 2.618 \[rad\]": {"angles": {"right_el_flex": [1, 3.0]}},
    "angles.right_el_flex is 'x'; valid: a list of numbers": {"angles": {"right_el_flex": "x"}},
    "reference has no marker of the body; valid: markers of one body, some of RSHO, RUPA": {
        "markers": {"LASI": [[0, 0, 0]]}
    },
    "markers must have the same number of rows x, y, z for each marker": {
        "markers": {"RELB": [[0, 0, 0]], "RWRA": [[0, 0]]}
    },
    "path: c3d file .*none.c3d: No such file": {"path": "none.c3d"},
    "path: .*none.mot: No such file": {"path": "none.mot"},
    "path: .*none.trc: No such file": {"path": "none.trc"},
}


@pytest.mark.parametrize("message", BAD)
def test_what_cannot_be_a_recorded_motion_is_refused(message: str) -> None:
    (kind,) = BAD[message]
    file = BAD[message].get("path")
    program = kind if file is None else file.rpartition(".")[2]
    with pytest.raises(ParameterError, match=message):
        control(body(parts="right_arm"), program=program, **BAD[message], **({"rate": RATE} if file is None else {}))
