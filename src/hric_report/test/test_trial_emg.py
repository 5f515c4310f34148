"""EMG of a trial next to the estimated activation: channels that are made from a known activation, and spoiled ones."""

import csv
import json
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from hric_core.command import perform
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose
from hric_human.body import Subject, describe
from hric_human.muscles.after_run import AfterRun, smoothed
from hric_human.muscles.anatomy import BUILT_IN, load
from hric_human.muscles.muscle_set import MuscleSet
from hric_motion.postures import BodyPostures, MarkerPostures
from hric_perception.emg.envelope import lag
from hric_report.trial import emg

RATE, PER_FRAME, FRAMES, EARLIER = 100.0, 20, 400, 0.06
BODY = describe(Subject(code="S07", mass=78.2, height=1.759, sex="male", parts="whole_body"))
NAMES = tuple(BODY.markers)
TIME = np.arange(FRAMES * PER_FRAME) / (RATE * PER_FRAME)


def angles() -> FloatArray:
    """Return joint angles of a person who bends the elbows twice, shape (n, j) [rad]."""
    t, joints = np.arange(FRAMES) / RATE, list(BODY.joints)
    q = np.zeros((FRAMES, len(joints)))
    for side in ("right", "left"):
        q[:, joints.index(f"{side}_sh_flex")] = 0.3
        q[:, joints.index(f"{side}_sh_abd")] = 0.2
        q[:, joints.index(f"{side}_el_flex")] = 1.0 + 0.7 * np.sin(2.0 * np.pi * 0.5 * t)
    return q


def activation(lines: list[str]) -> FloatArray:
    """Return the mean activation of lines of action, EARLIER s before the force, at TIME."""
    anatomy = load(BUILT_IN)
    muscles = MuscleSet(BODY, anatomy, 1.0)
    result = AfterRun(BODY, muscles, anatomy, Pose()).of(smoothed(np.arange(FRAMES) / RATE, angles()))
    mean = result.activation[:, [result.names.index(line) for line in lines]].mean(axis=1)
    return np.interp(TIME + EARLIER, result.time, mean)


def raw(shape: FloatArray, seed: int) -> FloatArray:
    """Return EMG with an amplitude, noise between 30 and 300 Hz [V]."""
    noise = np.random.default_rng(seed).normal(size=len(shape))
    return shape * sosfiltfilt(butter(4, (30.0, 300.0), "bandpass", fs=RATE * PER_FRAME, output="sos"), noise)


def write(path: Path, channels: dict[str, FloatArray], per_frame: int = PER_FRAME) -> Path:
    """Write the motion with EMG channels [V] as a c3d file that states z up."""
    q = angles()
    still = BodyPostures(np.tile(np.eye(3), (FRAMES, 1, 1)), np.tile([0.4, 0.1, 0.95], (FRAMES, 1)), q)
    p = MarkerPostures(BODY, NAMES).positions(still)
    file = ezc3d.c3d()
    file["data"]["points"] = np.vstack([1e3 * p.transpose(2, 1, 0), np.ones((1, len(NAMES), FRAMES))])
    file["data"]["analogs"] = np.array([values[:: PER_FRAME // per_frame] for values in channels.values()])[None]
    point, analog = file["parameters"]["POINT"], file["parameters"]["ANALOG"]
    point["RATE"]["value"], point["LABELS"]["value"] = [RATE], list(NAMES)
    analog["RATE"]["value"], analog["LABELS"]["value"] = [RATE * per_frame], list(channels)
    file.add_parameter("POINT", "UNITS", ["mm"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    file.add_parameter("ANALOG", "UNITS", ["V"] * len(channels))
    file.write(str(path))
    return path


@pytest.fixture(scope="module")
def channels() -> dict[str, FloatArray]:
    biceps = raw(1e-3 * activation(["right_bic_l", "right_bic_b"]), 1)
    flat, gap = np.zeros(len(TIME)), biceps.copy()
    gap[4000:4400] = gap[4000]
    other = raw(1e-4 * np.ones(len(TIME)), 2)
    return {
        "R BICEPS BRACHII: EMG 1 (IM)": biceps + 0.01,
        "Noraxon.LT_Triceps": flat,
        "RBIC": np.clip(biceps, -3e-5, 3e-5),
        "BrachioradR": gap,
        "Rect_Fem_L EMG": other,
        "L RF": other,
        "Biceps": other,
        "EMG 7": other,
        "Synchronisation": other,
    }


@pytest.fixture(scope="module")
def folder(channels: dict[str, FloatArray], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = write(tmp_path_factory.mktemp("emg") / "bend.c3d", channels)
    assert perform(["trial", str(path), "--mass", "78.2", "--height", "1.759"]) == 0
    return path.parent / "bend_trial"


@pytest.fixture(scope="module")
def values(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "trial.json").read_text())["emg"]
    return content


def test_the_muscle_that_drives_the_emg_is_found_again(values: dict[str, Any]) -> None:
    one = values["channels"]["R BICEPS BRACHII: EMG 1 (IM)"]
    assert (one["muscle"], one["reason"]) == ("right biceps brachii", "")
    assert one["lag"] == pytest.approx(EARLIER, abs=0.021)
    assert one["best"] > 0.9 and one["correlation"] < one["best"] and one["rms"] < 0.3


def test_each_spoiled_channel_has_its_own_reason(values: dict[str, Any]) -> None:
    reasons = {label: one["reason"] for label, one in values["channels"].items()}
    assert reasons.pop("R BICEPS BRACHII: EMG 1 (IM)") == ""
    assert reasons == {
        "Noraxon.LT_Triceps": "it is a flat line",
        "RBIC": "it is clipped: 3 or more successive samples have the smallest value",
        "BrachioradR": "it has a constant value for 0.2 s: samples were lost",
        "Rect_Fem_L EMG": "no muscle of the model",
        "L RF": "no muscle of the model",
        "Biceps": "its label names no side",
        "EMG 7": "no muscle of the model: its label names none",
    }
    assert values["notes"] == ["analog channels in volts whose labels name no muscle: Synchronisation"]


def test_the_table_has_both_curves(folder: Path, values: dict[str, Any]) -> None:
    rows = list(csv.DictReader((folder / "activations.csv").open()))
    label, unit = "R BICEPS BRACHII: EMG 1 (IM)", "[maximum in the trial]"
    pairs = [(row[f"{label} measured {unit}"], row[f"{label} estimated {unit}"]) for row in rows]
    known = np.array([tuple(map(float, pair)) for pair in pairs if "" not in pair])
    assert np.corrcoef(known.T)[0, 1] == pytest.approx(values["channels"][label]["correlation"], abs=1e-3)
    assert known.max(axis=0) == pytest.approx([1.0, 1.0], abs=0.15)


def test_the_page_shows_both_curves_and_claims_no_effort(folder: Path) -> None:
    text = (folder / "trial.html").read_text()
    assert text.count("class=second") == 1 and "says nothing of effort" in text


def test_an_mvc_of_twice_the_amplitude_halves_the_envelope(channels: dict[str, FloatArray], tmp_path: Path) -> None:
    label = "R BICEPS BRACHII: EMG 1 (IM)"
    trial, double = (write(tmp_path / f"{k}.c3d", {label: k * channels[label]}) for k in (1, 2))
    options = ["--mass", "78.2", "--height", "1.759", "-o", str(tmp_path)]
    assert perform(["trial", str(trial), "--mvc", str(double), *options]) == 0
    rows = list(csv.DictReader((tmp_path / "1_trial" / "activations.csv").open()))
    cells = [row[f"{label} measured [MVC]"] for row in rows]
    assert max(float(cell) for cell in cells if cell) == pytest.approx(0.5, abs=0.01)
    assert "effort" not in (tmp_path / "1_trial" / "trial.html").read_text()


def test_mvc_values_without_a_channel_of_the_trial_are_refused(channels: dict[str, FloatArray], tmp_path: Path) -> None:
    trial, values = write(tmp_path / "a.c3d", {"RBIC": channels["RBIC"]}), tmp_path / "mvc.yaml"
    values.write_text("LBIC: 0.001\n")
    with pytest.raises(HricError, match=r"mvc.yaml has no EMG channel of a.c3d; valid: RBIC"):
        emg.compared(emg.read_trial(trial), None, {}, [values])
    values.write_text("RBIC: -1\n")
    with pytest.raises(HricError, match=r"RBIC is -1; valid: a number above 0, in the unit of the channel"):
        emg.compared(emg.read_trial(trial), None, {}, [values])


def test_channels_are_mapped_by_hand(channels: dict[str, FloatArray], tmp_path: Path) -> None:
    trial = emg.read_trial(write(tmp_path / "a.c3d", {"EMG 7": channels["EMG 7"], "RBIC": channels["RBIC"]}))
    file = tmp_path / "labels.yaml"
    file.write_text(emg.map_text(trial).replace('"EMG 7": ""', '"EMG 7": left triceps brachii, long head'))
    mapped = emg.read_map(file)
    assert mapped["EMG 7"] == ("left", "triceps brachii, long head", ("tric_long",))
    assert mapped["RBIC"] == emg.muscle_of("RBIC") == ("right", "biceps brachii", ("bic_l", "bic_b"))
    file.write_text("emg:\n  EMG 7: triceps brachii\n")
    with pytest.raises(
        HricError, match=r"EMG 7 is 'triceps brachii'; valid: right or left, and one of biceps brachii,"
    ):
        emg.read_map(file)


def test_a_rate_below_that_of_the_filter_is_refused(channels: dict[str, FloatArray]) -> None:
    assert "band is 450 Hz; valid with 500 samples per second" in emg.unusable(channels["EMG 7"][::4], 500.0)


def test_a_channel_with_an_offset_is_raw_but_a_rectified_one_and_an_envelope_are_not(
    channels: dict[str, FloatArray],
) -> None:
    assert emg.unusable(channels["EMG 7"] + 1.0, 2000.0) == ""
    for spoiled in (np.abs(channels["EMG 7"]), 1.0 + np.sin(6.0 * TIME)):
        assert emg.unusable(spoiled, 2000.0).startswith("its samples have one sign")


def test_without_moments_no_channel_is_compared(channels: dict[str, FloatArray], tmp_path: Path) -> None:
    one = emg.compared(emg.read_trial(write(tmp_path / "a.c3d", {"R Bic": channels["EMG 7"]})), None, {})
    assert one is not None and [channel.reason for channel in one.channels] == ["joint moments are not known"]


def test_the_envelope_is_not_delayed() -> None:
    burst = np.exp(-(((TIME - 2.0) / 0.2) ** 2))
    times, smooth = emg.envelope(raw(burst, 5), RATE * PER_FRAME)
    centre = np.nansum(times * smooth) / np.nansum(smooth)
    assert centre == pytest.approx(2.0, abs=0.02) and lag(emg.SETTINGS, RATE * PER_FRAME) > 0.06


@pytest.mark.parametrize("label", ["Fx1", "Force.Fz2", "R BICEPS BRACHII: ACC X (IM)", "Voltage.1", ""])
def test_labels_of_other_signals_name_no_muscle(label: str) -> None:
    assert emg.muscle_of(label) is None
