"""c3d files of a run, read back by a reader that shares no code with the writer, by OpenSim, and as a trial to
replay."""

import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import c3d
import export_bags
import ezc3d
import numpy as np
import opensim
import pytest
from export_bags import EMG_RATE, FRAMES, HIDDEN, MARKERS_BODY, PLATE_ORIGIN, PRESSED, WEIGHT, Truth

from hric_bags.export import exporting, frames, opensim_text, recording
from hric_bags.export.exporting import ExportRequest
from hric_bags.export.resampling import SampledTopic, frame_grid
from hric_bags.export.table import ExportError, TopicColumn, TopicTable
from hric_bags.export.trial import c3d_format, c3d_trial
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_core.errors import HricError
from hric_core.trial.c3d import read_trial
from hric_core.trial.events import TrialEvent
from hric_perception.plate.section import PlateSection

SINGLE = 2.0**-24
"""Relative rounding error of a 32-bit float."""
CALIBRATION = (
    (np.diag([500.0, 510.0, 1000.0, 300.0, 200.0, 100.0]) + np.random.default_rng(5).normal(scale=3.0, size=(6, 6)))
    .round(6)
    .tolist()
)
"""Calibration matrix of the plate [N/V, N m/V]."""
R_GROUND_BASE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return export_bags.write(tmp_path_factory.mktemp("bag") / "made_up.bag", mocap_frame="base")


def run_of(truth: Truth, folder: Path, section: dict[str, Any]) -> RunFolder:
    """A run with that bag, whose experiment has a force plate."""
    run = RunFolder.create(folder, "made_up")
    (run.path / f"{run.path.name}.bag").write_bytes(truth.bag.read_bytes())
    plate = PlateSection.of({"id": "left", **section}, "force_plate")
    run.write(
        {
            "bag": f"{run.path.name}.bag",
            "started": "2026-01-02T03:04:05Z",
            "definition": {"force_plate": plate.record()},
        }
    )
    return run


@pytest.fixture(scope="module", params=[2, 4])
def file(truth: Truth, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> tuple[int, Path]:
    """Return (type of the plate, path of the c3d file)."""
    section = {"size": [0.5, 0.3], "calibration": CALIBRATION} if request.param == 4 else {"size": [0.5, 0.3]}
    run = run_of(truth, tmp_path_factory.mktemp("run"), section)
    assert main(["export", str(run.path), "--format", "c3d", "--quiet"]) == 0
    return request.param, run.path / "export" / "c3d" / f"{run.path.name}.c3d"


def markers(truth: Truth) -> np.ndarray:
    """Return the marker positions in OpenSim's ground, shape (frames, 3, 3) [m]; NaN: not visible."""
    found = np.stack([(truth.p + truth.R @ point) @ R_GROUND_BASE.T for point in MARKERS_BODY], axis=1)
    found[list(HIDDEN), 1] = np.nan
    return found


def read(path: Path) -> tuple[c3d.Reader, np.ndarray, np.ndarray]:
    """Return (reader, points (frames, markers, 5), analogs (samples, channels)) by an independent reader."""
    with path.open("rb") as handle, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = c3d.Reader(handle)
        all_ = list(reader.read_frames())
    return reader, np.array([points for _, points, _ in all_]), np.concatenate([analog.T for _, _, analog in all_])


def test_an_independent_reader_finds_the_same_markers(truth: Truth, file: tuple[int, Path]) -> None:
    reader, points, _ = read(file[1])
    assert reader.point_rate == 240.0 and [label.strip() for label in reader.point_labels] == [
        "hand_1",
        "hand_2",
        "hand_3",
    ]
    assert reader.get("POINT.UNITS").string_value.strip() == "mm" and len(points) == FRAMES
    expected = markers(truth)
    seen = np.isfinite(expected).all(axis=2)
    np.testing.assert_allclose(points[seen][:, :3], 1000.0 * expected[seen], rtol=2 * SINGLE, atol=1e-6)
    assert (points[..., 3] == np.where(seen, 0.0, -1.0)).all()  # the residual
    assert sorted({int(frame) for frame in np.flatnonzero(~seen.all(axis=1))}) == list(HIDDEN)


def test_an_independent_reader_finds_the_same_analog_samples(truth: Truth, file: tuple[int, Path]) -> None:
    reader, _, analogs = read(file[1])
    labels = [label.strip() for label in reader.analog_labels]
    assert labels == ["Fx1", "Fy1", "Fz1", "Mx1", "My1", "Mz1", "biceps", "triceps"]
    units = reader.get("ANALOG.UNITS").string_array
    assert [unit.strip() for unit in units] == (["V"] * 6 if file[0] == 4 else ["N"] * 3 + ["Nmm"] * 3) + ["V", "V"]
    assert reader.analog_rate == 2160.0 and reader.analog_per_frame == 9 and len(analogs) == 9 * FRAMES
    source = recording.find(str(truth.bag))
    tables = recording.read(source)
    emg = SampledTopic(tables["/hric/perception/emg/raw"]).values(("biceps", "triceps"), np.arange(9 * FRAMES) / 2160.0)
    np.testing.assert_allclose(analogs[:, 6:], emg, rtol=2 * SINGLE, atol=1e-12)
    # Where the grid meets a sample, each 27th of 25, the values are those of the source.
    np.testing.assert_allclose(analogs[::27, 6:], truth.emg[::25][: len(analogs[::27])], rtol=4 * SINGLE)


def test_an_independent_reader_finds_the_plate_and_the_weight_on_it(file: tuple[int, Path]) -> None:
    kind, path = file
    reader, _, analogs = read(path)
    group = reader.get("FORCE_PLATFORM")
    assert (group.get("USED").int16_value, group.get("TYPE").int16_value) == (1, kind)
    corners = group.get("CORNERS").float_array.reshape(1, 4, 3)[0]
    quadrants = np.array(
        [[0.25, -0.15, 0.0], [-0.25, -0.15, 0.0], [-0.25, 0.15, 0.0], [0.25, 0.15, 0.0]]
    )  # y of the file's plate is -y of ours
    np.testing.assert_allclose(
        corners, 1000.0 * (PLATE_ORIGIN + quadrants) @ R_GROUND_BASE.T, rtol=4 * SINGLE, atol=1e-4
    )
    assert np.ravel(group.get("ORIGIN").float_array).tolist() == [0.0, 0.0, 0.0]
    assert np.ravel(group.get("CHANNEL").int16_array).tolist() == [1, 2, 3, 4, 5, 6]
    wrench = analogs[:, :6]
    if kind == 4:
        wrench = wrench @ group.get("CAL_MATRIX").float_array.reshape(
            6, 6
        )  # columns of the matrix follow each other in the file
    # What the plate does to the weight, z down: up.
    x, y = PRESSED
    expected = [0.0, 0.0, -WEIGHT, 1000.0 * WEIGHT * y, 1000.0 * WEIGHT * x, 0.0]
    np.testing.assert_allclose(wrench, np.tile(expected, (len(wrench), 1)), rtol=1e-5, atol=1e-2)
    assert "z down" in " ".join(reader.get("HRIC.FORCES").string_array) and "cubic splines" in " ".join(
        reader.get("HRIC.RESAMPLING").string_array
    )
    assert reader.get("HRIC.START_TIME").float_value == 0.0


def test_ezc3d_finds_the_weight_upwards_at_its_place(file: tuple[int, Path]) -> None:
    plate = ezc3d.c3d(str(file[1]), extract_forceplat_data=True)["data"]["platform"][0]
    np.testing.assert_allclose(plate["force"].T, np.tile([0.0, WEIGHT, 0.0], (9 * FRAMES, 1)), atol=1e-3)
    p_base = PLATE_ORIGIN + np.array([*PRESSED, 0.0])
    np.testing.assert_allclose(
        plate["center_of_pressure"].T, np.tile(1000.0 * R_GROUND_BASE @ p_base, (9 * FRAMES, 1)), atol=0.01
    )


def test_the_trial_that_is_read_back_is_that_of_the_bag_in_the_robots_base(
    truth: Truth, file: tuple[int, Path]
) -> None:
    trial = read_trial(file[1])
    assert (trial.up, trial.rate, trial.analog_rate, trial.labels) == (
        "y",
        240.0,
        2160.0,
        ("hand_1", "hand_2", "hand_3"),
    )
    np.testing.assert_allclose(trial.positions, markers(truth) @ R_GROUND_BASE, atol=1e-6)  # z up again
    plate = trial.plate(1)
    np.testing.assert_allclose(plate.T_lab_plate[:3, 3], PLATE_ORIGIN, atol=1e-6)
    np.testing.assert_allclose(plate.T_lab_plate[:3, :3], np.eye(3), atol=1e-6)
    assert plate.size == pytest.approx((0.5, 0.3), rel=1e-5)
    load = [0.0, 0.0, -WEIGHT, -WEIGHT * PRESSED[1], WEIGHT * PRESSED[0], 0.0]
    np.testing.assert_allclose(plate.load, np.tile(load, (len(plate.load), 1)), atol=1e-3)


def test_opensim_reads_trc_and_mot_made_from_the_file(file: tuple[int, Path], tmp_path: Path) -> None:
    made = ezc3d.c3d(str(file[1]), extract_forceplat_data=True)
    time = np.arange(FRAMES) / made["parameters"]["POINT"]["RATE"]["value"][0]
    p = np.where(made["data"]["meta_points"]["residuals"][0] < 0, np.nan, 1e-3 * made["data"]["points"][:3]).transpose(
        1, 2, 0
    )
    labels = made["parameters"]["POINT"]["LABELS"]["value"]
    opensim_text.write_trc(tmp_path / "a.trc", time, dict(zip(labels, p, strict=True)), "a.trc")
    table = opensim.TimeSeriesTableVec3(str(tmp_path / "a.trc"))
    assert list(table.getColumnLabels()) == labels and table.getTableMetaDataString("Units") == "m"
    for number in range(len(labels)):
        column = table.getDependentColumnAtIndex(number)
        np.testing.assert_array_equal(np.array([column[k].to_numpy() for k in range(FRAMES)]), p[number])
    plate = made["data"]["platform"][0]
    samples = np.arange(plate["force"].shape[1]) / made["parameters"]["ANALOG"]["RATE"]["value"][0]
    columns = {f"1_force_v{axis}": plate["force"][k] for k, axis in enumerate("xyz")}
    columns |= {f"1_force_p{axis}": 1e-3 * plate["center_of_pressure"][k] for k, axis in enumerate("xyz")}
    columns |= {f"1_torque_{axis}": 1e-3 * plate["Tz"][k] for k, axis in enumerate("xyz")}
    opensim_text.write_storage(tmp_path / "a.mot", samples, columns, "External loads")
    storage = opensim.TimeSeriesTable(str(tmp_path / "a.mot"))
    assert list(storage.getColumnLabels()) == list(columns) and np.array_equal(
        np.array(storage.getIndependentColumn()), samples
    )
    for name, values in columns.items():
        assert np.array_equal(storage.getDependentColumn(name).to_numpy(), values)


@pytest.mark.parametrize(("height", "invert"), [(0.04, False), (-0.04, False), (0.04, True)])
@pytest.mark.parametrize("calibration", [None, CALIBRATION])
def test_height_and_sign_of_a_device_are_those_of_the_file(
    truth: Truth, height: float, invert: bool, calibration: Any, tmp_path: Path
) -> None:
    section = {"height": height, "invert": invert, "calibration": calibration}
    run = run_of(truth, tmp_path, section)
    assert main(["export", str(run.path), "--format", "c3d", "--quiet"]) == 0
    plate = read_trial(run.path / "export" / "c3d" / f"{run.path.name}.c3d").plate(1)
    F, M = np.array([0.0, 0.0, -WEIGHT]), np.array([-WEIGHT * PRESSED[1], WEIGHT * PRESSED[0], 0.0])
    load = (-1 if invert else 1) * np.array([*F, *(M - np.cross([0.0, 0.0, height], F))])
    np.testing.assert_allclose(plate.load[0], load, atol=1e-3)


def sampled(time: np.ndarray, values: np.ndarray) -> SampledTopic:
    return SampledTopic(TopicTable("/a", "", "", time, (time * 1e9).astype(np.int64), (TopicColumn("x", "V", values),)))


def test_samples_at_the_times_of_the_grid_stay_as_they_are() -> None:
    values = np.random.default_rng(0).normal(size=1000)
    source = sampled(np.arange(1000) / EMG_RATE, values)
    assert np.array_equal(source.values(("x",), np.arange(100, 200) / EMG_RATE)[:, 0], values[100:200])
    assert source.how(np.arange(100, 200) / EMG_RATE) == "/a as recorded"


def test_resampling_keeps_the_band_of_emg_and_bridges_what_was_lost() -> None:
    time = np.arange(4000) / EMG_RATE
    grid = np.arange(10, 4000) / 2160.0
    for frequency, error in ((100.0, 1e-4), (250.0, 5e-3), (450.0, 0.1)):
        found = sampled(time, np.sin(2 * np.pi * frequency * time)).values(("x",), grid)[:, 0]
        assert np.abs(found - np.sin(2 * np.pi * frequency * grid)).max() < error
    kept = np.ones(4000, dtype=bool)
    kept[1000:1100] = False
    source = sampled(time[kept], np.sin(2 * np.pi * 20 * time)[kept])
    assert source.gaps == 1 and "straight lines over 1 gaps" in source.how(grid)
    assert np.abs(source.values(("x",), grid)).max() < 1.01


def test_frames_lie_on_an_even_grid_though_some_were_lost_and_stamps_jitter() -> None:
    numbers = np.delete(np.arange(100000), [5, 6, 7000])
    jitter = np.random.default_rng(0).normal(scale=5e-5, size=len(numbers))
    rate, first = frame_grid(3.0 + numbers / 240.0 + jitter, numbers.astype(float))
    assert rate == 240.0 and (first - 3.0) * 240 == pytest.approx(round((first - 3.0) * 240), abs=0.02)
    rate, _ = frame_grid(numbers / 240.02, numbers.astype(float))  # a camera of its own pace
    assert rate == pytest.approx(240.02, abs=1e-4)


def test_a_long_trial_becomes_files_that_the_format_can_count(truth: Truth, tmp_path: Path) -> None:
    source = recording.find(str(truth.bag))
    tables = recording.read(source)
    trial = c3d_trial.collect(tables, frames.of_run("", tables, {}), {})
    long = replace(
        trial,
        per_frame=0,
        channels=(),
        plates=(),
        positions=np.tile(trial.positions[:1], (70000, 1, 1)),
        events=(TrialEvent(10.0, "a"), TrialEvent(280.0, "b", "Left")),
    )
    first, second = c3d_format.parts(long)
    assert (len(first.positions), len(second.positions), second.start) == (65535, 4465, pytest.approx(65535 / 240.0))
    assert first.events == (TrialEvent(10.0, "a"),)
    assert second.events == (TrialEvent(280.0 - 65535 / 240.0, "b", "Left"),)
    c3d_format.write(first, tmp_path / "a.c3d")
    assert len(read_trial(tmp_path / "a.c3d").positions) == 65535 and read_trial(tmp_path / "a.c3d").channels == ()


@pytest.mark.parametrize(("topics", "held"), [
    (("/hric/perception/mocap",), (3, [])),
    (("/hric/perception/emg/raw",), (0, ["biceps", "triceps"])),
    (("/hric/perception/force_plate/left/samples",), (0, ["Fx1", "Fy1", "Fz1", "Mx1", "My1", "Mz1"])),
])  # fmt: skip
def test_a_run_without_some_of_the_sensors_has_a_file_too(
    truth: Truth, tmp_path: Path, topics: tuple[str, ...], held: tuple[int, list[str]]
) -> None:
    result = exporting.export(recording.find(str(truth.bag)), ExportRequest(("c3d",), topics), tmp_path)
    assert result.failures == {}
    trial = read_trial(result.files["c3d"][0])
    assert (len(trial.labels), list(trial.channels)) == held


def test_the_line_that_is_printed_tells_how_the_file_was_made(
    truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(truth.bag), "--format", "c3d", "--output", str(tmp_path), "--quiet"]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("c3d: ")]
    for words in (
        "60 frames at 240 Hz from 0.000 s",
        "3 markers",
        "plate left of type 2",
        "analog samples at 2160 Hz",
        "from 2000 Hz by cubic",
        "mm, N, Nmm",
    ):
        assert words in line


def test_what_cannot_be_a_c3d_file_is_told(truth: Truth) -> None:
    tables = recording.read(recording.find(str(truth.bag)), ("/joint_states",))
    with pytest.raises(ExportError, match="formats c3d, bids and xdf need motion capture, force plates or EMG"):
        c3d_trial.collect(tables, frames.FixedFrames(), {})


def test_two_plates_of_different_types_stand_in_one_file(truth: Truth, tmp_path: Path) -> None:
    tables = recording.read(recording.find(str(truth.bag)), ("/hric/perception/force_plate/left/samples", "/tf_static"))
    left = tables["/hric/perception/force_plate/left/samples"]
    right = replace(left, topic="/hric/perception/force_plate/right/samples")
    run = {"definition": {"force_plate": {"driver": {"id": "right"}, "described": {"calibration": CALIBRATION}}}}
    known = frames.of_run("", tables, {})
    c3d_format.write(c3d_trial.collect({left.topic: left, right.topic: right}, known, run), tmp_path / "a.c3d")
    reader, _, analogs = read(tmp_path / "a.c3d")
    assert (
        reader.get("FORCE_PLATFORM.TYPE").int16_array.tolist() == [2, 4]
        and reader.get("FORCE_PLATFORM.USED").int16_value == 2
    )
    assert reader.get("FORCE_PLATFORM.CHANNEL").int16_array.tolist() == [[1, 2, 3, 4, 5, 6], [7, 8, 9, 10, 11, 12]]
    matrix = reader.get("FORCE_PLATFORM.CAL_MATRIX").float_array.reshape(2, 6, 6)[1]
    np.testing.assert_allclose(analogs[:, 6:] @ matrix, analogs[:, :6], rtol=1e-5, atol=1e-2)
    trial = read_trial(tmp_path / "a.c3d")
    np.testing.assert_allclose(trial.plate(1).load, trial.plate(2).load, atol=1e-3)


def test_events_are_triggers_and_phases(tmp_path: Path) -> None:
    time, words = np.array([0.5, 1.5, 99.0]), np.array(["rest", "moving", "done"])
    phases = TopicTable(
        "/hric/human/phase", "std_msgs/msg/String", "", time, time.astype(int), (TopicColumn("data", "", words),)
    )
    trigger = TopicTable("/hric/experiment/trigger", "std_msgs/msg/Empty", "", np.array([2.0]), np.array([2]), ())
    emg = TopicTable(
        "/emg/raw",
        "hric_msgs/msg/SampleChunk",
        "",
        np.arange(4000) / 1000,
        np.arange(4000),
        tuple(TopicColumn(name, "V", np.zeros(4000)) for name in ("a", "b")),
    )
    trial = c3d_trial.collect({table.topic: table for table in (phases, trigger, emg)}, frames.FixedFrames(), {})
    assert trial.events == (TrialEvent(0.5, "rest"), TrialEvent(1.5, "moving"), TrialEvent(2.0, "trigger"))
    c3d_format.write(trial, tmp_path / "a.c3d")
    group = read(tmp_path / "a.c3d")[0].get("EVENT")
    assert [label.strip() for label in group.get("LABELS").string_array] == ["rest", "moving", "trigger"]
    assert group.get("TIMES").float_array[:, 1].tolist() == [0.5, 1.5, 2.0]
    c3d_format.write(replace(trial, events=(TrialEvent(0.5, "é" * 300, "x" * 300),)), tmp_path / "a.c3d")
    assert read_trial(tmp_path / "a.c3d").events == (TrialEvent(0.5, "é" * 60, "x" * 120),)


@pytest.mark.parametrize(
    ("section", "message"),
    [
        (
            {"calibration": [[1] * 6] * 6},
            "force_plate.calibration is ((1.0, 1.0, 1.0, 1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 1.0, 1.0, ... (6 values); "
            "valid: six rows of six numbers that can be inverted [N/V, N m/V]",
        ),
        ({"size": [0.5, 0]}, "force_plate.size is [0.5, 0]; valid: a list of 2 finite numbers above 0 [m]"),
        (
            {"calibration": 3},
            "force_plate.calibration is 3; valid: six rows of six numbers that can be inverted [N/V, N m/V]",
        ),
    ],
)
def test_a_plate_that_cannot_be_described_is_refused_by_its_full_name(section: dict[str, Any], message: str) -> None:
    with pytest.raises(HricError, match=f"^{re.escape(message)}$"):
        PlateSection.of(section, "force_plate")
