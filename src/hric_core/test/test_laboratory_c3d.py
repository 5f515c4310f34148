"""c3d files as laboratories write them: gaps, odd force plates and rates, units, byte orders, other alphabets."""

import logging
import math
import struct
from pathlib import Path
from typing import Any

import byte_orders
import c3d_files
import ezc3d
import numpy as np
import pytest
from c3d_files import CAL, CORNERS, ORIGIN, PER_FRAME, RATE, Lab

from hric_core.errors import ParameterError
from hric_core.trial.c3d import Trial, read_trial

FRAMES = 20
MARKERS = c3d_files.swinging(FRAMES)[0]
SAMPLES = FRAMES * PER_FRAME
WRENCH = np.random.default_rng(4).normal(loc=[5.0, 3.0, -700.0, 2e4, 1e4, 5e3], scale=3.0, size=(SAMPLES, 6))
"""Wrench about a plate's origin [N, N mm]."""
POSITIONS = np.stack(list(MARKERS.values()), axis=1) * 1e-3


def written(folder: Path, kinds: tuple[int, ...] = (2, 2), **parameters: object) -> Path:
    """Write a file with plates of types 2 and 4 and one channel of EMG; `parameters` of FORCE_PLATFORM replace its."""
    lab = Lab(MARKERS, {"EMG1": ("V", np.ones(SAMPLES))}, [(kind, WRENCH) for kind in kinds])
    lab.parameters = {("FORCE_PLATFORM", name): value for name, value in parameters.items()}
    return c3d_files.write(folder / "trial.c3d", lab)


def changed(path: Path, group: str, **parameters: object) -> Path:
    """Replace parameters of a file."""
    file = ezc3d.c3d(str(path))
    for name, value in parameters.items():
        file.add_parameter(group, name, value)
    file.write(str(path))
    return path


def test_a_point_at_the_origin_is_not_seen(tmp_path: Path) -> None:
    markers = {name: rows.copy() for name, rows in MARKERS.items()}
    markers["hand_2"][5:8] = 0.0
    path = c3d_files.write(tmp_path / "gaps.c3d", Lab(markers))
    assert np.flatnonzero(np.isnan(read_trial(path).positions[:, 1, 0])).tolist() == [5, 6, 7]


def test_angles_of_the_laboratory_keep_their_degrees(tmp_path: Path) -> None:
    angles = np.random.default_rng(5).normal(scale=30.0, size=(FRAMES, 3))
    path = c3d_files.write(tmp_path / "angles.c3d", Lab(MARKERS | {"Ann:LKneeAngles": angles}))
    np.testing.assert_allclose(read_trial(path, "y").angles["LKneeAngles"], angles, rtol=1e-6)


FEW_CHANNELS = np.array([[2, 3, 4, 5, 6, 7], [8, 9, 10, 90, 12, 13]], dtype=float).T
FLAT = np.stack([CORNERS.T, np.zeros((3, 4))], axis=2)
ODD: dict[str, dict[str, Any]] = {
    "force plate 2 is of type 9; valid: 1, 2, 3, 4, 5": {"TYPE": [2, 9]},
    "force plate 2 is of type 0": {"TYPE": [2]},
    r"force plate 2 is on channels \[8, 9, 10, 90, 12, 13\]; the file has 13": {"CHANNEL": FEW_CHANNELS},
    "force plate 2 has no FORCE_PLATFORM:CHANNEL of 6 finite numbers": {"CHANNEL": FEW_CHANNELS[:, :1]},
    "force plate 2 has the corners .*; valid: four that span a rectangle": {"CORNERS": FLAT},
    "force plate 2 has no FORCE_PLATFORM:CORNERS of 3 x 4 finite numbers": {"CORNERS": FLAT[:, :, :1]},
    "force plate 2 has no FORCE_PLATFORM:CAL_MATRIX of 6 x 8 finite numbers": {
        "TYPE": [2, 5],
        "CHANNEL": np.array([[2, 3, 4, 5, 6, 7, 0, 0], range(1, 9)], dtype=float).T,
    },
}


@pytest.mark.parametrize("reason", ODD)
def test_an_odd_plate_costs_only_itself(tmp_path: Path, reason: str) -> None:
    trial = read_trial(written(tmp_path, **ODD[reason]))
    np.testing.assert_allclose(trial.positions, POSITIONS, rtol=1e-6)
    assert trial.volts(["EMG1"]).shape == (SAMPLES, 1) and trial.plate(1).kind == 2
    (sentence,) = trial.left_out
    with pytest.raises(ParameterError, match=f"trial.c3d: {reason}") as error:
        trial.plate(2)
    assert str(error.value).endswith(sentence)


def test_a_plate_after_an_odd_one_keeps_its_number(tmp_path: Path) -> None:
    trial = read_trial(written(tmp_path, (2, 4), TYPE=[9, 4]))
    assert list(trial.plates) == [2] and trial.plate(2).kind == 4


def test_a_reader_logs_what_it_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "hric.core.trial"):
        read_trial(written(tmp_path, TYPE=[2, 9]))
    assert caplog.messages == ["trial.c3d: left out: force plate 2 is of type 9; valid: 1, 2, 3, 4, 5"]


def test_plates_of_types_1_and_2_agree(tmp_path: Path) -> None:
    force, moment = WRENCH[:, :3], WRENCH[:, 3:] + np.cross(WRENCH[:, :3], ORIGIN)
    pressure = np.column_stack([-moment[:, 1], moment[:, 0]]) / force[:, 2:]
    free = moment[:, 2] - np.cross(pressure, force[:, :2])
    lab = Lab(MARKERS, plates=[(2, WRENCH), (1, np.column_stack([force, pressure, free]))])
    trial = read_trial(c3d_files.write(tmp_path / "a.c3d", lab))
    np.testing.assert_allclose(trial.plate(1).load, trial.plate(2).load, rtol=1e-5, atol=1e-4)


def test_a_plate_of_type_5_has_eight_signals_and_a_matrix(tmp_path: Path) -> None:
    random = np.random.default_rng(6)
    matrix, signals = (
        random.normal(size=(6, 8)) * [[1], [1], [100], [1e3], [1e3], [1e3]],
        random.normal(size=(SAMPLES, 8)),
    )
    channels = {f"s{k}": ("V", signals[:, k]) for k in range(8)}
    lab = Lab(MARKERS, channels, [(2, signals @ matrix.T)])
    path = c3d_files.write(tmp_path / "five.c3d", lab)
    expected = read_trial(path).plate(1).load
    matrices = np.zeros((6, 8, 1))
    matrices[:, :, 0] = matrix
    changed(path, "FORCE_PLATFORM", TYPE=[5], CHANNEL=np.arange(1.0, 9.0)[:, None], CAL_MATRIX=matrices)
    plate = read_trial(path).plate(1)
    assert plate.kind == 5
    np.testing.assert_allclose(plate.load, expected, rtol=1e-4, atol=1e-2)


def test_a_plate_of_type_4_takes_its_part_of_wider_matrices(tmp_path: Path) -> None:
    path = written(tmp_path, (4,))
    expected = read_trial(path).plate(1).load
    wide = np.zeros((6, 8, 1))
    wide[:, :6, 0] = CAL
    assert np.allclose(read_trial(changed(path, "FORCE_PLATFORM", CAL_MATRIX=wide)).plate(1).load, expected)


@pytest.mark.parametrize(("zero", "frames"), [([1, 10], slice(0, 10)), ([0, 4], slice(0, 4)), ([3, 3], slice(2, 3))])
def test_the_baseline_of_the_frames_is_subtracted(tmp_path: Path, zero: list[int], frames: slice) -> None:
    loads = read_trial(written(tmp_path, ZERO=[0, 0])).plate(1).load
    baseline = loads.reshape(FRAMES, PER_FRAME, 6)[frames].mean(axis=(0, 1))
    (tmp_path / "zero").mkdir()
    corrected = read_trial(written(tmp_path / "zero", ZERO=zero)).plate(1).load
    np.testing.assert_allclose(corrected, loads - baseline, atol=1e-3)


@pytest.mark.parametrize("zero", [[1, 0], [0, 0], []])
def test_a_baseline_without_frames_is_none(tmp_path: Path, zero: list[int]) -> None:
    load = read_trial(written(tmp_path, **({"ZERO": zero} if zero else {}))).plate(1).load
    assert load[:, 2].mean() == pytest.approx(-700.0, abs=2.0)


def test_a_baseline_beyond_the_file_costs_the_plate(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no samples in frames 50 to 60, its baseline"):
        read_trial(written(tmp_path, ZERO=[50, 60])).plate(1)


def test_an_analog_rate_of_zero_is_not_stated(tmp_path: Path) -> None:
    path = written(tmp_path)
    path.write_bytes(path.read_bytes().replace(struct.pack("<f", RATE * PER_FRAME), struct.pack("<f", 0.0), 1))
    assert read_trial(path).analog_rate == RATE * PER_FRAME


@pytest.mark.parametrize("rate", [1.0, 1050.0, 2000.0])
def test_an_odd_analog_rate_costs_no_markers(tmp_path: Path, rate: float) -> None:
    path = written(tmp_path)
    path.write_bytes(path.read_bytes().replace(struct.pack("<f", RATE * PER_FRAME), struct.pack("<f", rate), 1))
    trial = read_trial(path)
    np.testing.assert_allclose(trial.positions, POSITIONS, rtol=1e-6)
    for missing in (lambda: trial.volts(["EMG1"]), lambda: trial.plate(1)):
        with pytest.raises(ParameterError, match=rf"a rate of {rate:g} Hz \(ANALOG:RATE\); valid: 1000 Hz"):
            missing()


@pytest.mark.parametrize(
    ("unit", "scale"), [("metres", 1e-3), ("METERS", 1e-3), ("m   ", 1e-3), ("mete", 1e-3), ("centimeters", 0.1)]
)
def test_units_of_length_may_be_words(tmp_path: Path, unit: str, scale: float) -> None:
    lab = Lab({name: rows * scale for name, rows in MARKERS.items()}, parameters={("POINT", "UNITS"): unit})
    np.testing.assert_allclose(read_trial(c3d_files.write(tmp_path / "a.c3d", lab)).positions, POSITIONS, rtol=1e-6)


def test_an_unknown_unit_names_the_valid_ones(tmp_path: Path) -> None:
    path = c3d_files.write(tmp_path / "a.c3d", Lab(MARKERS, parameters={("POINT", "UNITS"): "inch"}))
    with pytest.raises(ParameterError, match="points in 'inch'; valid: mm, cm, dm, m, millimetres"):
        read_trial(path)


def with_words(path: Path, words: dict[int, bytes]) -> Path:
    """Replace bytes of a file by their positions."""
    content = bytearray(path.read_bytes())
    for at, data in words.items():
        content[at : at + len(data)] = data
    path.write_bytes(content)
    return path


def test_frames_that_the_header_does_not_state_are_read_if_a_parameter_states_them(tmp_path: Path) -> None:
    path = c3d_files.write(tmp_path / "long.c3d", Lab(MARKERS))
    assert len(read_trial(with_words(path, {8: struct.pack("<H", 7)})).positions) == FRAMES


def test_frames_that_nothing_states_are_told(tmp_path: Path) -> None:
    path = written(tmp_path)
    content = path.read_bytes()
    frames = struct.pack("<H", FRAMES)
    at = content.index(b"FRAMES") + len("FRAMES") + 4
    assert content[at : at + 2] == frames
    left_out = read_trial(with_words(path, {8: struct.pack("<H", 7), at: struct.pack("<H", 7)})).left_out
    assert any("bytes after the 7 frames stated in the header" in sentence for sentence in left_out)


@pytest.mark.parametrize("rate", [-100.0, 1e6, math.nan])
def test_a_rate_that_no_camera_has_is_refused(tmp_path: Path, rate: float) -> None:
    path = c3d_files.write(tmp_path / "rate.c3d", Lab(MARKERS))
    path.write_bytes(path.read_bytes().replace(struct.pack("<f", RATE), struct.pack("<f", rate)))
    with pytest.raises(ParameterError, match=r"has 20 frames at .* Hz; valid: above 0, up to 10000"):
        read_trial(path)


def test_an_axis_that_points_down_does_not_state_which_points_up(tmp_path: Path) -> None:
    path = changed(c3d_files.write(tmp_path / "down.c3d", Lab(MARKERS)), "POINT", Y_SCREEN=["-Z"])
    assert not read_trial(path).up_known


@pytest.mark.parametrize("processor", [byte_orders.DEC, byte_orders.SGI])
def test_files_of_other_processors_have_equal_contents(tmp_path: Path, processor: int) -> None:
    path = written(tmp_path)
    expected = read_trial(path)
    other = tmp_path / "other.c3d"
    other.write_bytes(byte_orders.converted(path.read_bytes(), processor))
    trial = read_trial(other)
    assert (trial.labels, trial.rate, trial.analog_rate) == (expected.labels, expected.rate, expected.analog_rate)
    np.testing.assert_allclose(trial.positions, expected.positions, rtol=1e-6)
    np.testing.assert_allclose(trial.plate(2).load, expected.plate(2).load, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("encoded", [b"Pr\xfcfer", "Prüfe".encode()])
def test_labels_may_be_latin_1(tmp_path: Path, encoded: bytes) -> None:
    path = c3d_files.write(tmp_path / "a.c3d", Lab({f"PrXfer:{name}": rows for name, rows in MARKERS.items()}))
    path.write_bytes(path.read_bytes().replace(b"PrXfer", encoded))
    expected = "Prüfer" if encoded[2:3] == b"\xfc" else "Prüfe"
    assert read_trial(path).labels[0] == f"{expected}:hand_1"


def with_subject(folder: Path, group: str, parameters: dict[str, object]) -> Trial:
    lab = Lab(MARKERS, parameters={(group, name): value for name, value in parameters.items()})
    return read_trial(c3d_files.write(folder / "a.c3d", lab))


@pytest.mark.parametrize(
    ("group", "parameters"),
    [
        ("PROCESSING", {"Bodymass": [72.5], "Height": [1758.0]}),
        ("SUBJECTS", {"MASS": [72.5], "HEIGHT": [1.758]}),
        ("PROCESSING", {"BODYMASS": [72.5], "HEIGHT": [175.8]}),
    ],
)
def test_a_subjects_measures_are_read(tmp_path: Path, group: str, parameters: dict[str, object]) -> None:
    trial = with_subject(tmp_path, group, parameters)
    assert trial.subject == pytest.approx({"height": 1.758, "mass": 72.5}, rel=1e-6) and trial.left_out == ()


def test_widths_of_joints_are_read_and_0_was_not_measured(tmp_path: Path) -> None:
    trial = with_subject(tmp_path, "PROCESSING", {"LKneeWidth": [105.0], "RElbowWidth": [8.0], "LAnkleWidth": [0.0]})
    assert trial.subject == pytest.approx({"left_knee_width": 0.105, "right_elbow_width": 0.08}, rel=1e-6)
    assert trial.left_out == ()
    assert "left_knee_width" in with_subject(tmp_path, "PROCESSING", {"LKneeWidth": [1.05]}).left_out[0]


@pytest.mark.parametrize(
    ("parameters", "reasons"),
    [
        (
            {"Bodymass": [0.0], "Height": [2400.0]},
            (
                "the height of the subject is 2400 in the file; valid: one number, 1.2 to 2.2 m",
                "the mass of the subject is 0 in the file; valid: one number, 30 to 200 kg",
            ),
        ),
        ({"Bodymass": ["heavy"]}, ("the mass of the subject is a text in the file; valid: one number, 30 to 200 kg",)),
        (
            {"Height": [1700.0, 1800.0]},
            ("the height of the subject is 1700, 1800 in the file; valid: one number, 1.2 to 2.2 m",),
        ),
    ],
)
def test_impossible_measures_are_left_out(
    tmp_path: Path, parameters: dict[str, object], reasons: tuple[str, ...]
) -> None:
    trial = with_subject(tmp_path, "PROCESSING", parameters)
    assert trial.subject == {} and trial.left_out == reasons


def test_the_file_states_whether_z_was_assumed(tmp_path: Path) -> None:
    silent = c3d_files.write(tmp_path / "silent.c3d", Lab(MARKERS))
    stating = c3d_files.write(tmp_path / "told.c3d", Lab(MARKERS, parameters={("POINT", "Y_SCREEN"): "+Z"}))
    assert [read_trial(silent).up_known, read_trial(silent, "z").up_known, read_trial(stating).up_known] == [0, 1, 1]


def test_texts_where_numbers_belong_crash_nothing(tmp_path: Path) -> None:
    trial = read_trial(written(tmp_path, TYPE=["a", "b"], CHANNEL=["a"], ZERO=["x"], CORNERS=["y"]))
    assert len(trial.left_out) == 2
