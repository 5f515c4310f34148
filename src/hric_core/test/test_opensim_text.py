"""Text files of OpenSim, written by OpenSim itself, and files that are none."""

from pathlib import Path

import numpy as np
import opensim
import pytest

from hric_core.errors import ParameterError
from hric_core.trial.opensim_text import rate_of, read_markers, read_storage

RATE, FRAMES = 120.0, 7
POSITIONS = np.random.default_rng(0).uniform(-1.0, 1.0, (FRAMES, 2, 3))


def trc(path: Path, positions: np.ndarray = POSITIONS, unit: str = "m") -> Path:
    table = opensim.TimeSeriesTableVec3()
    table.setColumnLabels(["RELB", "RWRA"])
    for k, row in enumerate(positions):
        table.appendRow(k / RATE, opensim.RowVectorVec3([opensim.Vec3(*point) for point in row]))
    table.addTableMetaDataString("DataRate", str(RATE))
    table.addTableMetaDataString("Units", unit)
    opensim.TRCFileAdapter.write(table, str(path))
    return path


def mot(path: Path, degrees: str = "no") -> Path:
    table = opensim.TimeSeriesTable()
    table.setColumnLabels(["el_flex", "pro_sup"])
    for k in range(FRAMES):
        table.appendRow(k / RATE, opensim.RowVector([0.1 * k, -0.2 * k]))
    table.addTableMetaDataString("inDegrees", degrees)
    opensim.STOFileAdapter.write(table, str(path))
    return path


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("mm", 1e-3)])
def test_markers_are_where_opensim_wrote_them_in_metres(tmp_path: Path, unit: str, metres: float) -> None:
    rows = read_markers(trc(tmp_path / "a.trc", unit=unit))
    assert list(rows.markers) == ["RELB", "RWRA"]
    np.testing.assert_allclose(np.stack(list(rows.markers.values()), axis=1), metres * POSITIONS, atol=1e-9)
    assert rate_of(tmp_path / "a.trc", rows.time) == pytest.approx(RATE, rel=1e-6)


def test_a_marker_that_was_not_seen_is_no_position(tmp_path: Path) -> None:
    hidden = POSITIONS.copy()
    hidden[2:4, 1] = np.nan
    rows = read_markers(trc(tmp_path / "a.trc", hidden))
    assert np.isnan(rows.markers["RWRA"][2:4]).all() and np.isfinite(rows.markers["RELB"]).all()


@pytest.mark.parametrize("degrees", ["yes", "no"])
def test_columns_are_those_that_opensim_wrote_and_it_is_known_whether_they_are_degrees(
    tmp_path: Path, degrees: str
) -> None:
    stored = read_storage(mot(tmp_path / "a.mot", degrees))
    assert stored.degrees is (degrees == "yes")
    np.testing.assert_allclose(stored.columns["pro_sup"], -0.2 * np.arange(FRAMES), atol=1e-9)
    np.testing.assert_allclose(stored.time, np.arange(FRAMES) / RATE, atol=1e-9)


WRONG = {
    "a.mot: No such file": None,
    "not a motion or storage file of OpenSim: it has no line 'endheader'": "time\ta\n0\t1\n",
    "line 2: wrong column labels; valid: `time`, then the other labels": "endheader\na\tb\n0\t1\n",
    "line 3: 3 columns; valid: 2": "endheader\ntime\ta\n0\t1\t2\n",
    "line 4: could not convert string to float: 'x'": "endheader\ntime\ta\n0\t1\n1\tx\n",
    "the times of the rows do not increase; valid: finite, increasing times": "endheader\ntime\ta\n1\t1\n0\t1\n",
    "has no rows": "endheader\ntime\ta\n",
}


@pytest.mark.parametrize("said", WRONG)
def test_what_is_no_motion_is_refused_with_its_line(tmp_path: Path, said: str) -> None:
    path = tmp_path / "a.mot"
    if (content := WRONG[said]) is not None:
        path.write_text(content)
    with pytest.raises(ParameterError, match=said):
        read_storage(path)


WRONG_MARKERS = {
    "is not a .trc file": ("PathFileType", "File"),
    "has markers in 'inch'; valid: mm, cm, dm, m": ("\tm\t", "\tinch\t"),
    "line 4: wrong marker names; valid: one name or more, each once": ("RWRA", "RELB"),
}


@pytest.mark.parametrize("said", WRONG_MARKERS)
def test_what_are_no_markers_is_refused(tmp_path: Path, said: str) -> None:
    path = trc(tmp_path / "a.trc")
    before, after = WRONG_MARKERS[said]
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after))
    with pytest.raises(ParameterError, match=said):
        read_markers(path)


def test_uneven_times_have_no_rate() -> None:
    with pytest.raises(ParameterError, match="not evenly spaced in time; valid: two rows or more, at a constant rate"):
        rate_of(Path("a.mot"), np.array([0.0, 0.1, 0.3]))
