"""A recorded trial beside the robot: its markers before the emulated Motive, its EMG and force plates as what the
emulated devices measure."""

from pathlib import Path
from typing import Any

import c3d_files
import numpy as np
import pytest
from c3d_files import PER_FRAME, RATE, Lab

from hric_core.errors import HricError
from hric_core.local.node import LocalNode
from hric_core.trial.c3d import read_trial
from hric_msgs.msg import MocapData
from hric_perception.emulation import EvenSensor, Faults
from hric_perception.human import see
from hric_perception.replayed import RecordedEmg, RecordedLoad, Replayed
from mocap_natnet.headless import HeadlessMocap, robot_time
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.node.publisher import MocapPublisher

FRAMES = 100
HIDDEN = range(0, 5)
"""Frames at the beginning in which the hand is not seen."""
GONE = range(40, 45)
BASE = {"xyz": [0.2, -0.5, 0.1], "xyzw": [0.0, 0.0, 0.6, 0.8]}


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    markers = c3d_files.swinging(FRAMES)[0]
    for label in ("hand_3", "hand_4"):
        markers[label][[*HIDDEN, *GONE]] = np.nan
    markers["elbow"] = np.tile([100.0, 200.0, 300.0], (FRAMES, 1))
    t = np.arange(FRAMES * PER_FRAME) / (RATE * PER_FRAME)
    wrench = np.column_stack([0 * t, 0 * t, -500 - 100 * np.sin(t), 0 * t, 0 * t, 0 * t])
    emg = np.sin(40 * t)
    lab = Lab(markers, {"EMG1": ("mV", emg), "biceps": ("V", 2 * emg)}, [(2, wrench)])
    return c3d_files.write(tmp_path_factory.mktemp("c3d") / "trial.c3d", lab)


def frames_of(human: dict[str, Any], start: float, duration: float) -> list[Any]:
    """What the client publishes of it, in the base, the hand started at `start` [s]."""
    node = LocalNode({"natnet_client": {"body": "hand", "base_from_mocap": BASE, "base_frame": "panda_link0"}})
    built = see(human, {"rate": 100}, BASE, 0)
    mocap = HeadlessMocap(built.motive, MocapPublisher(node, Publishing.read(node.child("natnet_client")), robot_time))
    frames: list[Any] = []
    node.subscribe("/hric/perception/mocap", MocapData, frames.append)
    mocap.advance(start - 1e-4)
    built.hand.start(start)
    mocap.advance(duration)
    return frames


def test_the_trial_streams_from_the_start_on_in_the_place_of_the_laboratory(file: Path) -> None:
    human = {"program": "c3d", "path": str(file), "bodies": {"arm": ["elbow"]}, "still": {"table": [0.5, 0.3, 0.1]}}
    start, trial = 0.3, read_trial(file)
    frames = frames_of(human, start, 2.0)
    R = np.array([[0.28, -0.96, 0.0], [0.96, 0.28, 0.0], [0.0, 0.0, 1.0]])
    for message in frames:
        k = round((message.header.stamp.to_sec() - start) * RATE)
        index = min(max(k, 0), FRAMES - 1) if k >= 0 else HIDDEN.stop
        seen = dict(zip(message.labelled_marker_names, message.labelled_markers, strict=True))
        for number in range(1, 5):
            there = np.isfinite(trial.positions[index, number - 1]).all()
            assert (f"hand/Marker{number}" in seen) == there
            if there:
                p = seen[f"hand/Marker{number}"]
                assert [p.x, p.y, p.z] == pytest.approx(R @ trial.positions[index, number - 1] + BASE["xyz"], abs=1e-6)
        bodies = {body.name: body for body in message.rigid_bodies}
        assert list(bodies) == ["hand", "arm", "table"]
        assert bodies["hand"].tracking_valid == (index not in (*HIDDEN, *GONE))
        p = bodies["table"].pose.position
        assert [p.x, p.y, p.z] == pytest.approx([0.5, 0.3, 0.1], abs=1e-6)


def test_the_truth_of_the_hand_goes_on_where_it_was_not_seen(file: Path) -> None:
    hand = see({"program": "c3d", "path": str(file)}, {}, None, 0).hand
    hand.start(0.0)
    before, after = (np.array(hand(frame / RATE).position) for frame in (GONE.start - 1, GONE.stop))
    assert hand((GONE.start + 1) / RATE).position == pytest.approx(before + (after - before) * 2 / 6, abs=1e-9)
    assert [hand.phase(time) for time in (0.5, 5.0)] == ["moving", "done"]


def test_emg_is_that_of_the_trial_and_silent_outside_it(file: Path) -> None:
    replayed = RecordedEmg(path=str(file), channels=["EMG1", "biceps"], begin=0.5).replayed(("triceps", "biceps"))
    sensor = EvenSensor(RATE * PER_FRAME, 2, replayed, Faults())
    sensor.due(0.0)
    (samples,) = sensor.due(0.99)
    t = np.arange(491) / 1000.0
    inside = samples.times >= 0.4999
    assert not samples.data[~inside].any()
    np.testing.assert_allclose(samples.data[inside][:, 1], 2 * np.sin(40 * t), atol=1e-6)
    np.testing.assert_allclose(samples.data[inside][:, 0], 1e-3 * np.sin(40 * t), atol=1e-9)
    assert not replayed.at(np.array([0.2, 2.0])).any()


def test_a_plate_holds_its_first_and_last_load_and_waits_for_the_human(file: Path) -> None:
    replayed = RecordedLoad(path=str(file)).replayed()
    assert replayed.waits and replayed.at(np.array([0.0, 100.0]))[:, 2] == pytest.approx([-500.0, -500.0])
    replayed.start(10.0)
    load = read_trial(file).plate(1).load
    assert replayed.at(np.array([0.0, 10.25, 11.5])) == pytest.approx(np.stack([load[0], load[250], load[-1]]))


def test_samples_that_the_file_does_not_know_stay_unknown(tmp_path: Path) -> None:
    markers = c3d_files.swinging(FRAMES)[0]
    emg = np.full(FRAMES * PER_FRAME, 0.25)
    wrench = np.tile([0.0, 0.0, -500.0, 0.0, 0.0, 0.0], (FRAMES * PER_FRAME, 1))
    emg[100:200] = wrench[100:200, 2] = np.nan
    path = c3d_files.write(tmp_path / "gap.c3d", Lab(markers, {"biceps": ("V", emg)}, [(2, wrench)]))
    times = np.array([0.05, 0.15, 0.25])
    voltage = RecordedEmg(path=str(path), begin=0.0).replayed(("biceps",)).at(times)
    load = RecordedLoad(path=str(path), begin=0.0).replayed().at(times)
    np.testing.assert_allclose(voltage[:, 0], [0.25, np.nan, 0.25], rtol=1e-6)
    np.testing.assert_allclose(load[:, 2], [-500.0, np.nan, -500.0], rtol=1e-6)


def test_samples_between_those_of_the_trial_lie_on_straight_lines() -> None:
    replayed = Replayed(np.array([[0.0], [1.0], [4.0]]), 2.0, 0.0, holds=True)
    assert replayed.at(np.array([0.25, 0.75, 0.9])) == pytest.approx(np.array([[0.5], [2.5], [3.4]]))


@pytest.mark.parametrize(
    ("human", "told"),
    [
        ({"path": "/nowhere.c3d"}, "m.human.path: c3d file /nowhere.c3d: No such file or directory"),
        ({}, "m.human.path is not set; valid: a c3d or xdf file"),
        ({"path": "FILE", "labels": ["knee"]}, "m.human: no marker 'knee' in trial.c3d; valid: elbow, hand_1"),
        ({"path": "FILE", "bodies": {"hand": ["elbow"]}}, "valid: other names"),
        ({"path": "FILE", "labels": []}, "m.human.labels is []; valid: a list of names"),
        ({"path": "FILE", "markers": [[0, 0, 0]]}, "no parameter 'markers' in m.human"),
    ],
)
def test_a_human_that_cannot_be_is_one_line(file: Path, human: dict[str, Any], told: str) -> None:
    given = {key: str(file) if value == "FILE" else value for key, value in human.items()}
    with pytest.raises(HricError) as error:
        see({"program": "c3d", **given}, {}, None, 0, "m.")
    assert told in str(error.value) and "\n" not in str(error.value)


def test_an_unknown_channel_or_plate_is_one_line(file: Path) -> None:
    for read, told in (
        (
            lambda: RecordedEmg.of({"path": str(file)}, "emg.a").replayed(("triceps",)),
            "emg.a.channels: no analog channel 'triceps' in trial.c3d; valid: ",
        ),
        (
            lambda: RecordedEmg.of({"path": str(file), "channels": ["EMG1"]}, "emg.a").replayed(("a", "b")),
            "emg.a.channels is ['EMG1']; valid: 2 names",
        ),
        (
            lambda: RecordedLoad.of({"path": str(file), "plate": 2}, "p.load").replayed(),
            "p.load.plate: trial.c3d has no force plate 2; valid: 1",
        ),
    ):
        with pytest.raises(HricError) as error:
            read()
        assert str(error.value).startswith(told)
