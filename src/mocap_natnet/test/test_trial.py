"""Recorded trials from c3d files: what is read, what is refused, and how an emulated Motive streams them."""

from pathlib import Path

import c3d_files
import ezc3d
import numpy as np
import pytest
from c3d_files import CAL, ORIGIN, PER_FRAME, R_LAB_PLATE, RATE, Lab
from scipy.spatial.transform import Rotation

from hric_core.errors import HricError
from hric_core.geometry import Pose
from hric_core.trial.c3d import read_trial
from mocap_natnet.codec import Codec, parse
from mocap_natnet.codec.descriptions import ForcePlateDescription
from mocap_natnet.codec.types import TRACKED
from mocap_natnet.server import CameraFaults, Motive, MotiveSettings
from mocap_natnet.server.c3d_source import RecordedBody
from mocap_natnet.server.scene_file import load
from mocap_natnet.tracking.tracking import Tracker
from mocap_natnet.tracking.validity import PoseValidator

FRAMES = 60
HIDDEN, FEW = range(20, 25), range(30, 34)
"""Frames without hand_2, and frames with hand_1 and hand_2 only."""


def hidden(markers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    markers["hand_2"][list(HIDDEN)] = np.nan
    for label in ("hand_3", "hand_4"):
        markers[label][list(FEW)] = np.nan
    return markers


def wrench(frames: int = FRAMES) -> np.ndarray:
    """Wrench about a plate's origin [N, N mm]."""
    t = np.arange(frames * PER_FRAME) / (RATE * PER_FRAME)
    force = np.column_stack([20 * np.sin(t), 30 * np.cos(t), -700 - 100 * t])
    return np.hstack([force, 1e4 * np.column_stack([np.sin(3 * t), np.cos(2 * t), 0.1 * t])])


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    emg = np.random.default_rng(0).normal(size=FRAMES * PER_FRAME)
    lab = Lab(
        hidden(c3d_files.swinging(FRAMES)[0]),
        {"EMG1": ("mV", emg), "torque": ("Nm", emg)},
        [(2, wrench()), (4, wrench())],
    )
    return c3d_files.write(tmp_path_factory.mktemp("c3d") / "trial.c3d", lab)


def test_markers_are_metres_and_those_that_were_not_seen_nan(file: Path) -> None:
    trial = read_trial(file)
    markers = hidden(c3d_files.swinging(FRAMES)[0])
    assert (trial.rate, trial.labels, trial.up, trial.duration) == (RATE, tuple(markers), "z", (FRAMES - 1) / RATE)
    np.testing.assert_allclose(trial.positions, np.stack(list(markers.values()), axis=1) * 1e-3, rtol=1e-7)
    np.testing.assert_allclose(
        trial.volts(["EMG1"])[:, 0], 1e-3 * np.random.default_rng(0).normal(size=FRAMES * PER_FRAME), rtol=1e-6
    )


@pytest.mark.parametrize("number", [1, 2])
def test_a_plate_measures_what_pressed_on_it_about_the_middle_of_its_surface(file: Path, number: int) -> None:
    plate = read_trial(file).plate(number)
    assert (plate.kind, plate.rate, plate.size) == (
        (2, 4)[number - 1],
        RATE * PER_FRAME,
        pytest.approx((0.6, 0.4), rel=1e-6),
    )
    np.testing.assert_allclose(plate.T_lab_plate[:3, 3], [0.7, 0.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(plate.T_lab_plate[:3, :3], R_LAB_PLATE @ np.diag([1.0, -1.0, -1.0]), atol=1e-7)
    found = ezc3d.c3d(str(file), extract_forceplat_data=True)["data"]["platform"][number - 1]
    R = plate.T_lab_plate[:3, :3]
    np.testing.assert_allclose(plate.load[:, :3] @ R.T, -found["force"].T, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(plate.load[:, 3:] @ R.T, -found["moment"].T * 1e-3, rtol=1e-5, atol=1e-3)
    on_body = wrench()
    np.testing.assert_allclose(plate.load[:, :3] @ R.T, -on_body[:, :3] @ R_LAB_PLATE.T, rtol=1e-5, atol=1e-3)
    assert (plate.load[:, 2] < -600).all()  # what stands on it presses down
    about_surface = (on_body[:, 3:] + np.cross(on_body[:, :3], ORIGIN)) * 1e-3
    np.testing.assert_allclose(plate.load[:, 3:] @ R.T, -about_surface @ R_LAB_PLATE.T, rtol=1e-5, atol=1e-3)


def test_a_plate_of_type_3_is_read_as_ezc3d_reads_it(tmp_path: Path) -> None:
    forces = np.random.default_rng(1).normal(loc=-100.0, scale=20.0, size=(FRAMES * PER_FRAME, 8))
    channels = {f"f{k}": ("N", forces[:, k]) for k in range(8)}
    file = ezc3d.c3d(str(c3d_files.write(tmp_path / "a.c3d", Lab(c3d_files.swinging(FRAMES)[0], channels))))
    for name, values in {"USED": [1], "TYPE": [3], "CHANNEL": np.arange(1, 9)[:, None]}.items():
        file["parameters"]["FORCE_PLATFORM"][name].update(type=2, value=np.array(values))
    file.add_parameter("FORCE_PLATFORM", "CORNERS", c3d_files.CORNERS.T[:, :, None])
    file.add_parameter("FORCE_PLATFORM", "ORIGIN", np.array([[120.0], [200.0], [-50.0]]))
    file.write(str(tmp_path / "b.c3d"))
    found = ezc3d.c3d(str(tmp_path / "b.c3d"), extract_forceplat_data=True)["data"]["platform"][0]
    plate = read_trial(tmp_path / "b.c3d").plate(1)
    R = plate.T_lab_plate[:3, :3]
    np.testing.assert_allclose(plate.load[:, :3] @ R.T, -found["force"].T, rtol=1e-6, atol=1e-4)
    np.testing.assert_allclose(plate.load[:, 3:] @ R.T, -found["moment"].T * 1e-3, rtol=1e-5, atol=1e-4)


def test_a_file_with_y_up_is_turned(tmp_path: Path) -> None:
    markers = c3d_files.swinging(FRAMES)[0]
    y_up = {label: p[:, [0, 2, 1]] * [1, 1, -1] for label, p in markers.items()}
    told = c3d_files.write(tmp_path / "told.c3d", Lab(y_up, parameters={("POINT", "Y_SCREEN"): "+Y"}))
    silent = c3d_files.write(tmp_path / "silent.c3d", Lab(y_up))
    expected = np.stack(list(markers.values()), axis=1) * 1e-3
    for trial in (read_trial(told), read_trial(silent, "y")):
        assert trial.up == "y"
        np.testing.assert_allclose(trial.positions, expected, rtol=1e-6, atol=1e-7)


def test_a_body_is_where_its_markers_are(file: Path) -> None:
    _, p, R = c3d_files.swinging(FRAMES)
    trial = read_trial(file)
    body = RecordedBody(trial, trial.labels)
    for frame in range(FRAMES):
        pose = body(frame / RATE)
        assert (pose is None) == (frame in FEW)
        if pose is not None:
            np.testing.assert_allclose(pose.position, p[frame], atol=1e-6)
            turn = Rotation.from_quat(pose.orientation).as_matrix()
            np.testing.assert_allclose(turn, R[frame] @ R[0].T, atol=1e-5)
        seen = body.seen(frame / RATE)
        assert [point is None for point in seen] == [False, frame in HIDDEN, frame in FEW, frame in FEW]
    before, after = body.pose(FEW.start / RATE - 0.01).position, body.pose(FEW.stop / RATE).position
    assert body.pose((FEW.start + FEW.stop - 1) / 2 / RATE).position == pytest.approx((np.array(before) + after) / 2)
    assert body(-5.0).position == body(0.0).position and body(1e6).position == body(trial.duration).position
    np.testing.assert_allclose(body.seen(0.5 / RATE)[0], trial.positions[:2, 0].mean(axis=0), rtol=1e-12)


def test_one_marker_is_a_body_that_keeps_its_axes(file: Path) -> None:
    body = RecordedBody(read_trial(file), ["hand_2"])
    assert body(0.3) == Pose(tuple(read_trial(file).positions[30, 1].tolist())) and body(HIDDEN.start / RATE) is None


SCENE = """
bodies:
  - name: hand
    motion: {type: c3d, path: trial.c3d}
  - name: finger
    id: 7
    motion: {type: c3d, path: trial.c3d, labels: [hand_2]}
plates:
  - recorded: {path: trial.c3d, plate: 2}
"""


def test_an_emulated_motive_streams_the_trial_and_leaves_out_what_was_not_seen(file: Path) -> None:
    scene_file = file.parent / "scene.yaml"
    scene_file.write_text(SCENE)
    motive = Motive(MotiveSettings(rate=RATE), load(scene_file, CameraFaults(), "y"))
    codec, trial = Codec(parse("4.1")), read_trial(file)
    tracker = Tracker("y", Pose(), PoseValidator())
    tracker.describe(codec.decode_model(codec.encode_model(motive.scene.model())))
    for number in range(FRAMES):
        frame = codec.decode_frame(motive.datagram(motive.frame(number), parse("4.1")))
        markers = {marker.name: marker.position for marker in tracker.markers(frame)}
        wanted = {f"hand/Marker{k}": p for k, p in enumerate(trial.positions[number], 1)} | {
            "finger/Marker1": trial.positions[number, 1]
        }
        wanted = {name: p for name, p in wanted.items() if np.isfinite(p).all()}
        assert markers.keys() == wanted.keys()
        for name, p in wanted.items():
            assert markers[name] == pytest.approx(p, abs=2e-7)
        tracked = {body.id: bool(body.flags & TRACKED) for body in frame.bodies}
        assert tracked == {1: number not in FEW, 7: number not in HIDDEN}
        assert frame.force_plates[0].channels[2][-1] == pytest.approx(
            trial.plate(2).load[number * PER_FRAME, 2], rel=1e-6
        )
    corners = next(one for one in motive.scene.model().descriptions if isinstance(one, ForcePlateDescription)).corners
    assert np.mean(corners, axis=0) == pytest.approx([0.7, 0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("motion", "told"),
    [
        ("{type: c3d, path: nothing.c3d}", "nothing.c3d: No such file"),
        ("{type: c3d, path: scene.yaml}", "is not a c3d file"),
        (
            "{type: c3d, path: trial.c3d, labels: [elbow]}",
            "no marker 'elbow' in trial.c3d; valid: hand_1, hand_2, hand_3, hand_4",
        ),
        ("{type: c3d, path: trial.c3d}", "no marker of trial.c3d begins with 'foot'; give labels; valid: hand_1"),
        ("{type: c3d, path: trial.c3d, labels: [hand_1], up: x}", "is 'x'; valid: y, z"),
        ("{type: c3d, path: empty.c3d}", "empty.c3d has no markers"),
    ],
)
def test_a_scene_that_cannot_be_is_one_line(file: Path, motion: str, told: str) -> None:
    c3d_files.write(file.parent / "empty.c3d", Lab({}, {"EMG1": ("V", np.zeros(600))}))
    scene_file = file.parent / "scene.yaml"
    scene_file.write_text(f"bodies:\n  - name: foot\n    motion: {motion}\n")
    with pytest.raises(HricError) as error:
        load(scene_file, CameraFaults(), "y")
    assert told in str(error.value) and "\n" not in str(error.value)


def test_an_unknown_plate_or_channel_is_an_error_with_those_that_are_there(file: Path) -> None:
    trial = read_trial(file)
    for wrong, told in (
        (lambda: trial.plate(3), "has no force plate 3; valid: 1, 2"),
        (lambda: trial.volts(["EMG7"]), "no analog channel 'EMG7' in trial.c3d; valid: EMG1, Fx1, Fx2, "),
        (lambda: trial.volts(["torque"]), "channel torque of trial.c3d is in 'Nm'; valid: V, mV, uV"),
    ):
        with pytest.raises(HricError, match=told):
            wrong()


def test_a_damaged_file_is_refused_and_ends_nobody(file: Path, tmp_path: Path) -> None:
    whole = file.read_bytes()
    damaged = {
        "cut": whole[: len(whole) // 2],
        "no parameters": whole[:512] + bytes(len(whole) - 512),
        "many frames": whole[:8] + b"\xff\xff" + whole[10:],
        "parameters of rubbish": whole[:520] + bytes(range(256)) * 4 + whole[1544:],
        "short": whole[:100],
    }
    for name, data in damaged.items():
        path = tmp_path / f"{name}.c3d"
        path.write_bytes(data)
        with pytest.raises(HricError) as error:
            read_trial(path)
        print(error.value)
        assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_a_file_that_ends_anywhere_is_refused(file: Path, tmp_path: Path) -> None:
    whole = file.read_bytes()
    for end in range(0, len(whole) - 512, len(whole) // 200):  # the last block of 512 bytes is filled up
        path = tmp_path / f"{end}.c3d"
        path.write_bytes(whole[:end])
        with pytest.raises(HricError):
            read_trial(path)


def test_damaged_parameters_are_told(file: Path, tmp_path: Path) -> None:
    random, told = np.random.default_rng(3), 0
    for number in range(8):
        data = np.frombuffer(file.read_bytes(), np.uint8).copy()
        places = random.integers(516, 3000, 30)
        data[places] = random.integers(0, 256, 30)
        path = tmp_path / f"{number}.c3d"
        path.write_bytes(data.tobytes())
        try:
            told += bool(read_trial(path).left_out)
        except HricError as error:
            told += "\n" not in str(error)
    assert told >= 6


def test_the_calibration_of_the_test_file_is_not_symmetric() -> None:
    """The matrix is not symmetric, so that a transposed one would be noticed."""
    assert np.abs(CAL - CAL.T).max() > 1.0
