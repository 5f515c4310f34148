"""Findings of the health command in bags, and the salvage of damaged ones."""

import io
import json
from pathlib import Path
from typing import Any

import export_bags
import numpy as np
import pytest
import rosbag
from geometry_msgs.msg import PointStamped
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from synthetic import log_message, signals, write_run

from gazebo_msgs.msg import ContactsState, ContactState
from hric_bags.health.examine import examine
from hric_core.command import main
from hric_core.robot_time.stamps import to_time
from hric_msgs.msg import MocapData, SampleChunk
from hric_run.bag_writer import BagWriter


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_bags.write(tmp_path_factory.mktemp("bag") / "whole.bag").bag


def contents(path: Path) -> list[tuple[str, int, bytes]]:
    with AnyReader([path]) as reader:
        return [(connection.topic, time, bytes(raw)) for connection, time, raw in reader.messages()]


def points(path: Path, stamps: Any, recorded: Any = None) -> Path:
    """Write a bag with one topic of stamped points."""
    with BagWriter(path) as bag:
        for stamp, time in zip(stamps, stamps if recorded is None else recorded, strict=True):
            message = PointStamped()
            message.header.stamp = to_time(float(stamp))
            bag.write("/point", message, float(time))
    return path


def findings(path: Path) -> str:
    """Return the findings on a bag, one per line."""
    return "\n".join(f"{finding.level} {finding.topic} {finding.text}" for finding in examine(path).findings)


def test_a_whole_bag_is_healthy_and_its_rates_are_reported(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["health", str(whole), "--json", str(tmp_path / "health.json")]) == 0
    assert "healthy" in capsys.readouterr().out
    (found,) = json.loads((tmp_path / "health.json").read_text())["bags"]
    assert found["findings"] == [] and found["topics"]["/hric/perception/mocap"]["rate"] == pytest.approx(
        240.0, rel=1e-6
    )
    assert found["topics"]["/control_log"]["messages"] == 20


@pytest.mark.parametrize(
    ("kind", "message", "expected"),
    [
        (
            "/chunk",
            lambda k: SampleChunk(channels=["a"], rate=1000.0, first_sample=10 * k, data=[0.0] * 10),
            "10 samples are missing, first 10 from number 100",
        ),
        ("/mocap", lambda k: MocapData(frame_number=7 + k), "1 frames are missing, first 1 from number 17"),
        (
            "/control_log",
            lambda k: log_message(20 * k, 20, signals(1000, 0.1)),
            "20 cycles are missing, first 20 from number 200",
        ),
    ],
)
def test_missing_samples_frames_and_cycles_are_counted_by_their_running_number(
    tmp_path: Path, kind: str, message: Any, expected: str
) -> None:
    with BagWriter(tmp_path / "a.bag") as bag:
        for k in [*range(10), *range(11, 30)]:
            one = message(k)
            one.header.stamp = to_time(0.02 * k)
            bag.write(kind, one, 0.02 * k)
    assert expected in findings(tmp_path / "a.bag") and examine(tmp_path / "a.bag").code == 3


def test_a_gap_of_a_regular_stream_is_reported(tmp_path: Path) -> None:
    stamps = np.arange(200) * 0.01
    assert "1 gap, the longest 0.510 s from 0.990 s on" in findings(
        points(tmp_path / "a.bag", np.delete(stamps, range(100, 150)))
    )


def test_events_have_no_gaps(tmp_path: Path) -> None:
    assert findings(points(tmp_path / "a.bag", np.cumsum(np.random.default_rng(3).exponential(1.0, 100)))) == ""


def contacts(path: Path, times: Any, touching: Any) -> Path:
    """Write a bag with contacts of bodies, which are published while there are any, and once after the last one."""
    with BagWriter(path) as bag:
        for time, touches in zip(times, touching, strict=True):
            message = ContactsState(states=[ContactState(info="rigid contact of a on b")] * int(touches))
            message.header.frame_id, message.header.stamp = "world", to_time(float(time))
            bag.write("/sim/contacts", message, float(time))
    return path


TOUCHES = np.concatenate([np.arange(30) * 0.01, 2.0 + np.arange(30) * 0.01])


def test_a_pause_while_nothing_touches_is_no_gap(tmp_path: Path) -> None:
    assert findings(contacts(tmp_path / "a.bag", TOUCHES, np.arange(60) % 30 < 29)) == ""


def test_a_pause_during_a_contact_is_a_gap(tmp_path: Path) -> None:
    assert "1 gap, the longest 1.710 s from 0.290 s on; the stream's period is 0.0100 s" in findings(
        contacts(tmp_path / "a.bag", TOUCHES, np.arange(60) < 59)
    )


def test_stamps_out_of_order_are_reported(tmp_path: Path) -> None:
    stamps = np.arange(100) * 0.01 + 5.0
    swapped = stamps.copy()
    swapped[[50, 52]] = swapped[[52, 50]]
    assert "2 stamps are older than the one before, the first at message 51, by up to 0.010 s" in findings(
        points(tmp_path / "a.bag", swapped, stamps)
    )


ARM, GRIPPER = "/robot", "/franka_gripper"


def joint_states(path: Path, arm: Any, gripper: Any) -> Path:
    """A bag as a recorder writes it: a connection for each of two nodes that publish on one topic; their stamps, in the
    order of their recording."""
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        named = {
            name: writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store, callerid=name)
            for name in (ARM, GRIPPER)
        }
        recorded = [(0.01 * k, stamp, ARM) for k, stamp in enumerate(arm)] + [
            (0.03 * k + 0.005, stamp, GRIPPER) for k, stamp in enumerate(gripper)
        ]
        for time, stamp, name in sorted(recorded):
            buffer = io.BytesIO()
            JointState(header=Header(stamp=to_time(float(stamp)))).serialize(buffer)
            writer.write(named[name], round(1e9 * (time + 5.0)), buffer.getvalue())
    with rosbag.Bag(str(path)) as bag:
        found = {
            message.connection_header["callerid"].decode()
            for message in bag.read_messages(return_connection_header=True)
        }
    assert found == {ARM, GRIPPER}, "ROS's own reader sees them so, too"
    return path


def test_two_publishers_of_one_topic_are_in_order_where_each_of_them_is(tmp_path: Path) -> None:
    arm, gripper = 5.0 + 0.01 * np.arange(300), 5.0 + 0.03 * np.arange(100) - 0.02
    assert findings(joint_states(tmp_path / "a.bag", arm, gripper)) == ""


def test_of_two_publishers_the_one_that_is_out_of_order_is_named(tmp_path: Path) -> None:
    arm, gripper = 5.0 + 0.01 * np.arange(300), 5.0 + 0.03 * np.arange(100) - 0.02
    gripper[[40, 41]] = gripper[[41, 40]]
    path = joint_states(tmp_path / "a.bag", arm, gripper)
    expected = (
        f"1 stamp is older than the one before, the first at its message 41, by up to 0.030 s; published by {GRIPPER}"
    )
    assert findings(path) == f"problem /joint_states {expected}" and examine(path).code == 3


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda stamps: np.where(np.arange(100) == 60, 0.0, stamps), "1 messages have no stamp (0)"),
        (
            lambda stamps: np.where(np.arange(100) > 60, stamps + 4.0, stamps),
            "39 stamps are younger than their recording by up to 4.000 s",
        ),
    ],
)
def test_a_stamp_that_is_not_the_time_of_measurement_is_reported(tmp_path: Path, change: Any, expected: str) -> None:
    stamps = np.arange(100) * 0.01 + 5.0
    assert expected in findings(points(tmp_path / "a.bag", change(stamps), stamps))


def test_a_clock_that_goes_back_is_reported(tmp_path: Path) -> None:
    stamps = np.concatenate([np.arange(50) * 0.01 + 20.0, np.arange(50) * 0.01 + 5.0])
    assert "the clock of the recording went back by 15.490 s at message 50" in findings(
        points(tmp_path / "a.bag", stamps)
    )


def test_a_bag_recorded_by_another_clock_is_a_note_and_no_problem(tmp_path: Path) -> None:
    stamps = np.arange(100) * 0.01
    path = points(tmp_path / "a.bag", stamps, stamps + 1.7e9)
    assert (
        "note  header stamps and recording times are on different clocks" in findings(path) and examine(path).code == 0
    )


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7, 0.9, 0.999])
def test_a_bag_that_was_cut_off_anywhere_gives_what_came_before(
    whole: Path, tmp_path: Path, share: float, capsys: pytest.CaptureFixture[str]
) -> None:
    cut = tmp_path / "cut.bag"
    data = whole.read_bytes()
    cut.write_bytes(data[: int(share * len(data))])
    assert main(["health", str(cut)]) == 4
    assert "damaged" in capsys.readouterr().out
    main(["health", str(cut), "--salvage"])
    found, expected = contents(cut), contents(whole)
    assert set(found) <= set(expected) and len(found) >= (len(expected) if share > 0.99 else 0)
    assert cut.with_name("cut.bag.damaged").read_bytes() == data[: int(share * len(data))]
    assert examine(cut).code != 4


def test_a_damaged_chunk_costs_only_itself(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with BagWriter(path) as bag:
        bag._writer.chunk_threshold = 4096
        for first in range(0, 2000, 20):
            bag.write("/control_log", log_message(first, 20, signals(2000, 0.1)), first * 1e-3)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 64] = bytes(64)
    path.write_bytes(data)
    assert "is damaged" in findings(path)
    assert main(["health", str(path), "--salvage"]) == 3
    assert len(contents(path)) >= 96


def test_what_is_salvaged_of_a_run_is_its_bag_and_the_run_counts_as_interrupted(tmp_path: Path) -> None:
    folder = write_run(tmp_path)
    active = folder.bag_path.with_name(folder.bag_path.name + ".active")
    folder.bag_path.rename(active)
    active.write_bytes(active.read_bytes()[:-5000])
    folder.update(status="running")
    assert main(["health", str(folder.path), "--salvage", "--quiet"]) == 0
    assert contents(folder.bag_path) and active.exists()
    run = folder.read()
    assert (run["status"], run["salvaged"]) == ("interrupted", True)
    assert main(["health", str(folder.path), "--quiet"]) == 0


def test_a_bag_that_is_being_written_is_not_salvaged(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.bag.active"
    path.write_bytes(whole.read_bytes()[:-4000])
    with path.open("ab"):
        assert main(["health", str(path), "--salvage", "--quiet"]) == 2
    assert "is being written" in capsys.readouterr().err and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "data", "expected"),
    [
        ("a.bag", b"", "not a bag of version 2.0"),
        ("a.bag", b"#ROSBAG V1.2\n", "an old version; `rosbag fix`"),
        ("b.txt", None, "no run folder"),
    ],
)
def test_what_is_no_bag_is_refused_in_one_line(
    tmp_path: Path, name: str, data: bytes | None, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    if data is not None:
        (tmp_path / name).write_bytes(data)
    assert main(["health", str(tmp_path / name), "--runs", str(tmp_path), "--salvage"]) == 2
    message = capsys.readouterr().err
    assert expected in message and message.count("\n") == 1
