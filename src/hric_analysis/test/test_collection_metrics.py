"""Lost samples and skew of synchronised samples of a synthetic bag with known values."""

from collections.abc import Collection as Some
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from synthetic import log_message, signals

from hric_analysis import collection, collection_record
from hric_analysis.collection import CollectionMetrics
from hric_bags import reader as bag_reader
from hric_core.command import main
from hric_core.robot_time.stamps import to_time
from hric_msgs.msg import MocapData, SampleChunk, SourceCount, SyncedSample, SyncLayout, SyncStatus
from hric_report import sensor_text
from hric_run.bag_writer import BagWriter

END, RATE, CHUNK, FRAME_RATE, SYNC_RATE = 4.0, 500.0, 25, 200.0, 50.0
INTERVAL = (1.0, 3.0)
EMG, FRAMES, SYNC = "/hric/perception/emg/raw", "/hric/perception/mocap", "/hric/perception/sync_50hz"
BORN = 100
"""Number of the sample of the source at which the driver starts to count."""


def hand(time: Any) -> Any:
    return np.stack([0.1 * np.sin(3 * time), 0.2 * np.cos(2 * time), 0.4 + 0 * time], axis=-1)


def write(
    path: Path,
    *,
    late: float = 0.0,
    lost: Some[int] = (),
    frames_lost: Some[int] = (),
    skew: float = 0.0,
    ticks_lost: Some[int] = (),
) -> Path:
    """Write a bag of END seconds: stamps of samples are delayed by `late`, chunks `lost` are missing, synchronised
    values are older than their instant by `skew`."""
    data = signals(int(END * 1000), 1.5)
    with BagWriter(path) as bag:
        for first in range(0, int(END * 1000), 20):
            bag.write("/control_log", log_message(first, 20, data), first * 1e-3)
        for chunk in range(int(END * RATE) // CHUNK):
            if chunk not in lost:
                bag.write(EMG, emg(chunk, late), chunk * CHUNK / RATE)
        for number in range(int(END * FRAME_RATE)):
            if number not in frames_lost:
                bag.write(
                    FRAMES, stamped(MocapData(frame_number=number), number / FRAME_RATE, "base"), number / FRAME_RATE
                )
        for tenth in range(1, int(END * 10)):
            bag.write("/hric/perception/sent", sent("lsl EMG made_up", "samples", tenth / 10, RATE), tenth / 10)
            bag.write("/hric/perception/sent", sent("", "frames", tenth / 10, FRAME_RATE), tenth / 10)
        for step in range(int(END * 100)):
            bag.write("/hric/human/hand", hand_message(step / 100), step / 100)
        synchronised(bag, data, skew, ticks_lost)
    return path


def stamped(message: Any, time: float, frame: str = "") -> Any:
    message.header.stamp, message.header.frame_id = to_time(time), frame
    return message


def emg(chunk: int, late: float) -> Any:
    times = (BORN + chunk * CHUNK + np.arange(CHUNK)) / RATE
    values = np.column_stack([np.ones(CHUNK), times]).ravel().tolist()
    message = SampleChunk(
        source="lsl EMG made_up",
        channels=["biceps", "time"],
        unit="V s",
        rate=RATE,
        first_sample=chunk * CHUNK,
        data=values,
    )
    return stamped(message, times[0] + late)


def sent(source: str, counts: str, time: float, rate: float) -> Any:
    following = round(time * rate) + 1
    return stamped(SourceCount(source=source, counts=counts, next=following, sent=following, rate=rate), time)


def hand_message(time: float) -> Any:
    message = stamped(PoseStamped(), time, "base")
    message.pose.position.x, message.pose.position.y, message.pose.position.z = hand(time).tolist()
    return message


def synchronised(bag: BagWriter, data: Any, skew: float, lost: Some[int]) -> None:
    joints = [f"position[j{joint}]" for joint in (1, 2, 3)]
    places = [f"rigid_bodies[hand].pose.position.{axis}" for axis in "xyz"]
    names = (
        [f"/control_log.{name}" for name in joints] + [f"{FRAMES}.{name}" for name in places] + [f"{EMG}.data[time]"]
    )
    sources = ["/control_log"] * 3 + [FRAMES] * 3 + [EMG]
    layout = SyncLayout(
        names=names, units=[""] * 7, sources=sources, interpolations=["linear"] * 7, policy="resample", rate=SYNC_RATE
    )
    bag.write(f"{SYNC}_layout", layout, 0.0)
    topics = list(dict.fromkeys(sources))
    bag.write(f"{SYNC}_status", SyncStatus(sources=topics, skew_max=[0.0] * 3, late=[0, 0, 2]), 1.0)
    for tick in range(10, int(END * SYNC_RATE) - 10):
        time = tick / SYNC_RATE
        position = [float(np.interp(time - skew, data[0], column)) for column in data[1].T]
        values = [*position, *hand(time - skew).tolist(), time - skew]
        if tick not in lost:
            bag.write(SYNC, stamped(SyncedSample(values=values, age=[0.0] * 3, valid=[True] * 3), time), time)


def judged(path: Path, interval: tuple[float, float] | None = INTERVAL) -> CollectionMetrics:
    record, data = bag_reader.read(path), collection_record.read(path)
    assert data is not None
    return collection.metrics(data, record.log, record.robot_time, interval)


def test_a_bag_with_all_that_was_sent_says_so_by_the_numbers_of_the_sources(tmp_path: Path) -> None:
    found = judged(write(tmp_path / "a.bag"))
    emg_found, frames = found.sources[EMG], found.sources[FRAMES]
    assert (emg_found.sent, emg_found.recorded, emg_found.lost, emg_found.twice) == (1000, 1000, 0, 0)
    assert (frames.sent, frames.recorded, frames.lost) == (400, 400, 0)
    assert (emg_found.first, emg_found.last) == (501, 1500)
    assert found.sources["/control_log"].sent == found.sources["/control_log"].recorded == 2001
    assert "1000 samples sent, 1000 recorded, 0 lost" in sensor_text.collection(found.sources, found.sync)


def test_what_is_not_in_the_bag_is_lost_though_no_driver_reports_it(tmp_path: Path) -> None:
    found = judged(write(tmp_path / "a.bag", lost=[30, 31], frames_lost=[250, 700]))
    assert (found.sources[EMG].lost, found.sources[EMG].driver_lost) == (2 * CHUNK, 2 * CHUNK)
    assert found.sources[FRAMES].lost == 1, "frame 700 is after the interval"


def test_stamps_are_held_against_the_time_code(tmp_path: Path) -> None:
    stamps = judged(write(tmp_path / "a.bag", late=0.003)).sources[EMG].stamps
    assert stamps.median == pytest.approx(0.003, abs=1e-6) and stamps.largest == pytest.approx(0.003, abs=1e-6)


def numbered(codes: Any, stamps: Any, numbers: Any) -> Any:
    return collection_record.Numbered("trigno EMG", 500.0, np.asarray(stamps), np.asarray(numbers), np.asarray(codes))


COUNTS = collection_record.SourceCounts(500.0, np.array([0.0]), np.array([0]), np.array([0]))


def test_stamps_that_lag_behind_make_no_loss_of_a_time_code_within_the_second() -> None:
    own = np.arange(700, 30_700)
    stamps = own / 500.0 + np.where((own > 9_000) & (own < 10_500), 0.9, 0.0)
    found = collection.source_sequence(numbered(own / 500.0 % 1.0, stamps, own - 700), COUNTS)
    assert found is not None and (found == own).all()


def test_samples_that_the_driver_missed_are_missing_from_the_sequence_though_they_fill_seconds() -> None:
    own = np.delete(np.arange(700, 30_700), np.arange(5_000, 6_700))
    found = collection.source_sequence(numbered(own / 500.0 % 1.0, own / 500.0, own - 700), COUNTS)
    assert found is not None and (found == own).all()


def test_a_driver_that_lost_count_of_whole_seconds_leaves_the_loss_unknown() -> None:
    own = np.delete(np.arange(700, 30_700), np.arange(10_000, 11_000))
    assert collection.source_sequence(numbered(own / 500.0 % 1.0, own / 500.0, np.arange(len(own))), COUNTS) is None


def test_a_source_without_a_number_of_its_own_has_no_sequence() -> None:
    came = collection_record.Numbered("lsl EMG", 500.0, np.arange(9) / 500.0, np.arange(9), None)
    assert collection.source_sequence(came, COUNTS) is None


def test_frames_go_on_after_the_last_number_of_their_counter(tmp_path: Path) -> None:
    numbers = [(2**32 - 50 + k) % 2**32 for k in range(100) if k != 70]
    with BagWriter(tmp_path / "a.bag") as bag:
        bag.write("/control_log", log_message(0, 20, signals(20, 0.0)), 0.0)
        for k, number in enumerate(numbers):
            bag.write(FRAMES, stamped(MocapData(frame_number=number), k / FRAME_RATE, "base"), k / FRAME_RATE)
    found = judged(tmp_path / "a.bag", None).sources[FRAMES]
    assert (found.recorded, found.driver_lost, found.twice) == (99, 1, 0)
    assert main(["health", str(tmp_path / "a.bag"), "--quiet"]) == 3


def test_without_an_interval_nothing_is_known_to_be_sent(tmp_path: Path) -> None:
    found = judged(write(tmp_path / "a.bag"), None)
    assert found.sources[EMG].sent is None and found.sources[EMG].recorded == int(END * RATE)
    assert "number of sent samples not known" in sensor_text.collection(found.sources, found.sync)


@pytest.mark.parametrize("skew", [0.0, 0.002])
def test_the_skew_of_each_source_is_measured_by_what_has_its_time(tmp_path: Path, skew: float) -> None:
    stream = judged(write(tmp_path / "a.bag", skew=skew)).sync[SYNC]
    assert {topic: one.by for topic, one in stream.sources.items()} == {
        "/control_log": "control log",
        FRAMES: "truth of the hand",
        EMG: "time code",
    }
    for one in stream.sources.values():
        assert one.skew.median == pytest.approx(skew, rel=0.2, abs=5e-5)
        assert (one.valid, one.told_skew) == (1.0, 0.0)


def test_a_window_that_has_hardly_begun_when_the_interval_ends_shows_its_noise_and_is_left_out() -> None:
    stamps = np.arange(2.0, 8.03, 1e-3)
    noise = 1e-4 * np.random.default_rng(4).standard_normal((len(stamps), 3))
    speed = np.column_stack([0.4 * np.cos(3 * stamps), 0.4 * np.sin(3 * stamps), 0 * stamps])
    found = collection._fitted(stamps, noise, speed, np.ones(len(stamps), bool), 0.05)
    assert found is not None and found.largest < 5e-5 and found.uncertainty < 5e-5


def test_ticks_that_are_not_there_are_missing(tmp_path: Path) -> None:
    stream = judged(write(tmp_path / "a.bag", ticks_lost=[60, 61, 190])).sync[SYNC]
    assert (stream.expected, stream.ticks, stream.missing) == (101, 99, 2)
    assert stream.grid_error < 1e-9


def test_a_tick_at_the_end_of_the_interval_is_in_it_whatever_the_sum_rounds_to(tmp_path: Path) -> None:
    begin, end = 0.72, 0.72 + 0.6
    assert end < 1.32
    stream = judged(write(tmp_path / "a.bag"), (begin, end)).sync[SYNC]
    assert (stream.expected, stream.ticks, stream.missing) == (31, 31, 0)


@pytest.mark.parametrize("other", [3, collection_record.BLOCK + 3])
def test_samples_are_decoded_by_their_own_lengths_also_where_the_sum_of_these_is_equal(
    tmp_path: Path, other: int
) -> None:
    count = 2 * collection_record.BLOCK + 7
    with BagWriter(tmp_path / "a.bag") as bag:
        layout = SyncLayout(names=["/a.data[time]", "/a.data[b]"], sources=["/a", "/a"], rate=100.0)
        bag.write("/sync_layout", layout, 0.0)
        for k in range(count):
            long = {"values": [k, 0.5], "age": [0.0], "valid": [k % 2 == 0]}
            message = SyncedSample(**({"values": [k], "age": [0.0] * 3, "valid": [True]} if k == other else long))
            bag.write("/sync", stamped(message, 0.01 * k), 0.01 * k)
    found = collection_record.read(tmp_path / "a.bag")
    assert found is not None
    stream = found.streams["/sync"]
    assert np.array_equal(stream.values[:, 0], np.arange(count))
    assert np.allclose(stream.stamps, 0.01 * np.arange(count), rtol=0.0, atol=1e-9)
    assert np.array_equal(stream.valid[:, 0], (np.arange(count) % 2 == 0) | (np.arange(count) == other))


def test_a_bag_without_sensors_has_none_of_it(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "a.bag") as bag:
        bag.write("/control_log", log_message(0, 20, signals(20, 0.0)), 0.0)
    assert collection_record.read(tmp_path / "a.bag") is None
