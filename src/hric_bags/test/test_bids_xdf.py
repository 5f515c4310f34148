"""Runs as BIDS data sets and XDF files, judged by the BIDS validator and read by readers of others."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import edfio
import export_bags
import numpy as np
import pytest
import pyxdf
from export_bags import FRAMES, Truth

from hric_bags.export import exporting, frames, recording
from hric_bags.export.exporting import ExportRequest
from hric_bags.export.table import ExportError
from hric_bags.export.trial import bdf, bids, c3d_trial
from hric_bags.export.trial.c3d_trial import C3dTrial, Channel
from hric_bags.export.trial.xdf import write_xdf
from hric_core.trial.events import TrialEvent

EVENT = TrialEvent(0.1, "Foot Strike", "Left")


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return export_bags.write(tmp_path_factory.mktemp("bag") / "made_up.bag", mocap_frame="base")


@pytest.fixture(scope="module")
def trial(truth: Truth) -> C3dTrial:
    """Trial of the bag, with an event."""
    tables = recording.read(recording.find(str(truth.bag)))
    return replace(c3d_trial.collect(tables, frames.of_run("", tables, {}), {}), events=(EVENT,))


@pytest.fixture(scope="module")
def data_set(trial: C3dTrial, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the data set."""
    folder = tmp_path_factory.mktemp("bids")
    for name, write in bids.bids_files(trial, {"experiment": "marker_tracking", "subject": "S-07"}).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write(folder / name)
    return folder


@pytest.fixture(scope="module")
def streams(trial: C3dTrial, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Streams of the XDF file by name, with their times as they are in the file."""
    path = tmp_path_factory.mktemp("xdf") / "made_up.xdf"
    write_xdf(path, trial)
    found, _ = pyxdf.load_xdf(str(path), dejitter_timestamps=False)
    return {stream["info"]["name"][0]: stream for stream in found}


def validator() -> str:
    program = shutil.which("bids-validator-deno", path=str(Path(sys.executable).parent))
    assert program is not None, "the BIDS validator is not installed; scripts/setup --with checks"
    return program


def test_bids_validator_finds_no_error(data_set: Path) -> None:
    done = subprocess.run([validator(), str(data_set), "--json"], capture_output=True, text=True, timeout=120)
    issues = json.loads(done.stdout)["issues"]["issues"]
    assert [issue for issue in issues if issue["severity"] == "error"] == [] and done.returncode == 0


def test_bids_validator_counts_motion_and_emg(data_set: Path) -> None:
    done = subprocess.run([validator(), str(data_set), "--json"], capture_output=True, text=True, timeout=120)
    summary = json.loads(done.stdout)["summary"]
    assert (sorted(summary["dataTypes"]), summary["subjects"]) == (["emg", "motion"], ["S07"])


def test_motion_table_has_the_marker_positions(trial: C3dTrial, data_set: Path) -> None:
    (path,) = data_set.glob("sub-S07/motion/*_motion.tsv")
    rows = [line.split("\t") for line in path.read_text().splitlines()]
    values = np.array([[np.nan if cell == "n/a" else float(cell) for cell in row] for row in rows])
    assert np.array_equal(values, trial.positions.reshape(FRAMES, -1), equal_nan=True)


def test_emg_in_bdf_is_exact_to_24_bits(trial: C3dTrial, data_set: Path) -> None:
    (path,) = data_set.glob("sub-S07/emg/*_emg.bdf")
    signals = edfio.read_bdf(path).signals
    emg = trial.channels[6 * len(trial.plates) :]
    assert [(s.label, s.physical_dimension, s.sampling_frequency) for s in signals] == [
        (channel.label, "uV", 2160.0) for channel in emg
    ]
    for signal, channel in zip(signals, emg, strict=True):
        peak = 1e6 * np.abs(channel.values).max()
        error = np.abs(signal.data[: len(channel.values)] - 1e6 * channel.values).max()
        assert error <= 0.51 * (peak + 1.0) / bdf.LARGEST


def test_events_stand_beside_both_recordings(data_set: Path) -> None:
    tables = [path.read_text().splitlines()[1] for path in sorted(data_set.rglob("*_events.tsv"))]
    assert tables == ["0.100000\tn/a\tFoot Strike\tLeft"] * 2


def test_a_note_of_several_lines_is_one_row_of_a_table(trial: C3dTrial, tmp_path: Path) -> None:
    note = replace(trial, events=(TrialEvent(0.1, "looked\taway,\r\nthen back ", ""),))
    write = next(w for name, w in bids.bids_files(note, {}).items() if name.endswith("_events.tsv"))
    write(tmp_path / "a.tsv")
    assert (tmp_path / "a.tsv").read_bytes().split(b"\n")[1:] == [b"0.100000\tn/a\tlooked away, then back\tn/a", b""]


def test_bids_without_markers_and_emg_is_refused(truth: Truth, tmp_path: Path) -> None:
    request = ExportRequest(("bids",), ("/hric/perception/force_plate/left/samples",))
    result = exporting.export(recording.find(str(truth.bag)), request, tmp_path)
    assert result.failures == {"bids": "format bids needs motion capture or EMG, among the requested topics"}


def test_unknown_emg_is_not_written_as_zero(tmp_path: Path) -> None:
    values = np.ones(10)
    values[3] = np.nan
    with pytest.raises(ExportError, match="EMG of biceps has samples that are not known"):
        bdf.write_bdf(tmp_path / "a.bdf", [Channel("biceps", "V", values)], 10.0)


def test_emg_beyond_the_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="EMG of 20000000 uV does not fit into a BDF file; valid: below 10 V"):
        bdf.write_bdf(tmp_path / "a.bdf", [Channel("a", "V", np.full(10, 20.0))], 10.0)


def test_streams_of_xdf_have_labels_and_units(trial: C3dTrial, streams: dict[str, Any]) -> None:
    found = {
        name: [
            (channel["label"][0], channel.get("unit", [""])[0])
            for channel in stream["info"]["desc"][0]["channels"][0]["channel"]
        ]
        for name, stream in streams.items()
    }
    assert found["markers"][:4] == [(f"hand_1_{axis}", "meters") for axis in "XYZ"] + [("hand_2_X", "meters")]
    assert found["force"][2:4] == [("Fz1", "newtons"), ("Mx1", "newton millimeters")]
    assert found["emg"] == [("biceps", "volts"), ("triceps", "volts")]


def test_samples_of_xdf_are_those_of_the_trial(trial: C3dTrial, streams: dict[str, Any]) -> None:
    positions, emg = streams["markers"]["time_series"], streams["emg"]["time_series"]
    assert np.array_equal(positions, trial.positions.reshape(FRAMES, -1), equal_nan=True)
    assert np.array_equal(emg.T, [channel.values for channel in trial.channels[6:]])


def test_times_of_xdf_are_those_of_the_run(trial: C3dTrial, streams: dict[str, Any]) -> None:
    np.testing.assert_allclose(streams["markers"]["time_stamps"], trial.start + np.arange(FRAMES) / 240.0, atol=1e-12)
    assert streams["events"]["time_stamps"].tolist() == [trial.start + EVENT.time]


def test_events_of_xdf_are_text(streams: dict[str, Any]) -> None:
    assert streams["events"]["time_series"] == [["Foot Strike (Left)"]]
