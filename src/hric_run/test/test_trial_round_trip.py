"""A laboratory's c3d file, replayed by a headless run and exported again, as an independent reader finds both."""

from pathlib import Path
from typing import Any

import c3d_files
import ezc3d
import numpy as np
import pytest
import yaml
from c3d_files import PER_FRAME, RATE, Lab

from hric_bags.export.trial.replayed_trial import ReplayedTrial
from hric_core.command import main
from hric_core.geometry.transforms import vectors_z_up
from hric_core.trial.c3d import read_trial
from hric_core.trial.opensim_text import read_markers
from hric_core.trial.plates import PlateReader, TrialPlate
from hric_report import headless
from hric_run.definition import experiment

FRAMES = 150
PREFIX = "S01:"
TIMES = np.array([[0.0, 0.0, 0.0], [0.25, 0.4, 0.75]])
"""Times of the events, minutes and seconds."""
EVENTS = {
    "USED": [3],
    "TIMES": TIMES,
    "LABELS": ["Foot Strike", "Foot Off", "Foot Strike"],
    "CONTEXTS": ["Left", "Right", "Right"],
}
BASE = {"xyz": [0.2, -0.5, 0.1], "xyzw": [0.0, 0.0, 0.6, 0.8]}


def laboratory(path: Path, kind: int) -> Path:
    markers = {f"{PREFIX}{label.upper()}": p for label, p in c3d_files.swinging(FRAMES)[0].items()}
    markers[f"{PREFIX}RELB"] = np.tile([100.0, 200.0, 300.0], (FRAMES, 1))
    t = np.arange(FRAMES * PER_FRAME) / (RATE * PER_FRAME)
    wrench = np.column_stack([10 + t, 5 - t, -500 - 100 * t, 4000 * t, 3000 + t, 200 * t])
    events: dict[tuple[str, str], Any] = {("EVENT", name): value for name, value in EVENTS.items()}
    return c3d_files.write(path, Lab(markers, {"Voltage.EMG1": ("mV", 1 + t)}, [(kind, wrench)], events))


@pytest.fixture(scope="module", params=[2, 4])
def files(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> tuple[Path, Path]:
    """Return the paths of the laboratory's file, and of the file that the run exports."""
    folder = tmp_path_factory.mktemp("c3d")
    path = laboratory(folder / "trial.c3d", request.param)
    labels = [f"{PREFIX}HAND_{k}" for k in range(1, 5)]
    human = {"program": "c3d", "path": "trial.c3d", "labels": labels, "bodies": {"arm": [f"{PREFIX}RELB"]}}
    activation = {"program": "c3d", "path": "trial.c3d", "channels": ["Voltage.EMG1"]}
    raw = yaml.safe_load((experiment.config_path("experiments") / "marker_tracking.yaml").read_text())
    raw["mocap"] |= {"human": human, "stream": {"rate": 100}, "base_from_mocap": BASE}
    raw["emg"] = {"channels": ["biceps"], "rate": 1000, "emulated": {"activation": activation}}
    raw["force_plate"] = {"emulated": {"load": {"program": "c3d", "path": "trial.c3d"}}}
    (folder / "replay.yaml").write_text(yaml.safe_dump({**raw, "duration": 1.5}))
    definition = experiment.load(str(folder / "replay.yaml"))
    run = headless.run(definition, (), root=folder / "runs", progress=False, figures=False).folder
    assert main(["export", str(run.path), "--format", "c3d", "trc", "--quiet"]) == 0
    return path, run.path / "export" / "c3d" / f"{run.path.name}.c3d"


@pytest.fixture(scope="module")
def groups(files: tuple[Path, Path]) -> tuple[Any, Any]:
    """Return the parameters of both files."""
    before, after = (ezc3d.c3d(str(path))["parameters"] for path in files)
    return before, after


def test_labels_of_markers_keep_their_prefix(groups: tuple[Any, Any]) -> None:
    before, after = (group["POINT"]["LABELS"]["value"] for group in groups)
    assert after == before


def test_marker_positions_keep_the_axes_of_the_laboratory(files: tuple[Path, Path]) -> None:
    before, after = (read_trial(path) for path in files)
    assert after.up == before.up == "z"
    place = (after.start + np.arange(len(after.positions)) / after.rate - 1e-3) * RATE  # from the first millisecond
    inside = (place >= 0) & (place <= FRAMES - 1)
    for k in range(before.positions.shape[1]):
        exact = [np.interp(place[inside], np.arange(FRAMES), before.positions[:, k, axis]) for axis in range(3)]
        np.testing.assert_allclose(after.positions[inside, k], np.column_stack(exact), atol=1e-6)


def test_trc_keeps_labels_and_positions(files: tuple[Path, Path]) -> None:
    before = read_trial(files[0])
    (path,) = (files[1].parents[1] / "trc").glob("*.trc")
    after = read_markers(path)
    assert tuple(after.markers) == before.labels
    place = (after.time - 1e-3) * RATE
    inside = (place >= 0) & (place <= FRAMES - 1)
    R_base_lab = np.array([[0.28, -0.96, 0.0], [0.96, 0.28, 0.0], [0.0, 0.0, 1.0]])
    for k, p_ground in enumerate(after.markers.values()):
        p_lab = (vectors_z_up("y", p_ground[inside]) - BASE["xyz"]) @ R_base_lab
        exact = [np.interp(place[inside], np.arange(FRAMES), before.positions[:, k, axis]) for axis in range(3)]
        np.testing.assert_allclose(p_lab, np.column_stack(exact), atol=1e-6)


@pytest.mark.parametrize("name", ["TYPE", "CORNERS", "ORIGIN", "CAL_MATRIX"])
def test_force_plates_keep_type_pose_and_calibration(groups: tuple[Any, Any], name: str) -> None:
    before, after = (np.array(group["FORCE_PLATFORM"][name]["value"]) for group in groups)
    if name == "CAL_MATRIX" and groups[0]["FORCE_PLATFORM"]["TYPE"]["value"][0] == 2:
        before = np.eye(6)[:, :, None]  # a plate of this type has none
    np.testing.assert_allclose(after.reshape(before.shape), before, rtol=1e-6)


def test_analog_channels_keep_labels_and_units(groups: tuple[Any, Any]) -> None:
    before, after = (
        dict(zip(group["ANALOG"]["LABELS"]["value"], group["ANALOG"]["UNITS"]["value"], strict=True))
        for group in groups
    )
    assert {label: after.get(label) for label in before} == before


def test_analog_samples_keep_their_values(files: tuple[Path, Path]) -> None:
    before, after = (read_trial(path) for path in files)
    times = after.start + np.arange(len(after.analogs)) / after.analog_rate - 1e-3
    inside = (times >= 0) & (times <= 0.9)
    for row, label in enumerate(before.channels):
        exact = np.interp(times[inside], np.arange(len(before.analogs)) / before.analog_rate, before.analogs[:, row])
        np.testing.assert_allclose(after.analogs[inside, after.channels.index(label)], exact, rtol=1e-5, atol=1e-4)


def test_events_keep_label_context_and_time(files: tuple[Path, Path]) -> None:
    before, after = (read_trial(path) for path in files)
    assert [event[1:] for event in after.events] == [event[1:] for event in before.events]
    times = [event.time + after.start for event in after.events]
    np.testing.assert_allclose(times, TIMES[1] + 1e-3, atol=1e-6)


@pytest.mark.parametrize("kind", [1, 3, 5])
def test_plates_of_other_types_become_type_2_with_the_same_load(kind: int) -> None:
    """A plate of a type whose channels do not follow from the load is written with the channels of type 2."""
    corners = c3d_files.CORNERS.T[:, :, None]
    channels, names = {1: (6, ["N"] * 3 + ["mm"] * 2 + ["Nmm"]), 3: (8, ["N"] * 8), 5: (8, ["V"] * 8)}[kind]
    group: dict[str, Any] = {"USED": [1], "TYPE": [kind], "CORNERS": corners, "ORIGIN": [[120.0], [200.0], [-40.0]]}
    draw = np.random.default_rng(kind)
    group |= {"CHANNEL": np.arange(1, channels + 1)[:, None], "CAL_MATRIX": draw.normal(size=(6, 8, 1))}
    analogs = draw.normal(scale=100.0, size=(channels, 50))
    (before,), left_out = _plates(group, analogs, names)
    about = {"up": "z", "channels": ["c"] * channels, "units": names, "plates": {1: {"type": kind, **before.source}}}
    run = ReplayedTrial("x.c3d", about, {}, np.eye(4), ("1", 1), {}, 0.0)
    recorded = run.recorded_plate("1", before.load)
    assert recorded is not None and not left_out
    plate, signals, labels = recorded
    assert plate.kind == 2 and labels == []
    again: dict[str, Any] = {"USED": [1], "TYPE": [plate.kind], "CHANNEL": np.arange(1, 7)[:, None]}
    again |= {"CORNERS": 1e3 * plate.corners.T[:, :, None], "ORIGIN": 1e3 * plate.origin[:, None]}
    (after,), _ = _plates(again, signals.T, list(plate.units))
    np.testing.assert_allclose(after.load, before.load, atol=1e-9)
    np.testing.assert_allclose(after.T_lab_plate, before.T_lab_plate)


def _plates(group: dict[str, Any], analogs: np.ndarray, units: list[str]) -> tuple[list[TrialPlate], object]:
    plates, reasons = PlateReader(group, analogs, units, 1000.0, 10, 1e-3, "z").read()
    return list(plates.values()), reasons
