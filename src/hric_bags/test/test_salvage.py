"""One flipped bit anywhere in a bag destroys at most one chunk, and doubtful messages are marked."""

import json
import struct
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import rosbag
import rospy
from rosbags.rosbag1 import Reader
from std_msgs.msg import Float64MultiArray, String

from hric_bags import reader as bag_reader
from hric_bags.health.examine import examine
from hric_bags.health.salvage import salvage
from hric_core.command import main
from hric_core.errors import HricError
from hric_run.bag_writer import BagWriter

KINDS = ("headless", "none", "lz4", "bz2")
Messages = Counter[tuple[str, str, str, int, bytes]]


def write(path: Path, kind: str) -> Path:
    """Write 300 arrays of 1 kB and 30 texts, in several chunks: by a headless run, or by ROS's own writer."""
    random = np.random.default_rng(1)
    messages = [
        ("/array", Float64MultiArray(data=random.normal(size=128).tolist()), 1.0 + 0.01 * k) for k in range(300)
    ]
    messages += [("/text", String(f"text {k} " * 5), 1.005 + 0.1 * k) for k in range(30)]
    messages.sort(key=lambda one: one[2])
    if kind == "headless":
        with BagWriter(path) as bag:
            for topic, message, time in messages:
                bag.write(topic, message, time)
        return path
    with rosbag.Bag(str(path), "w", compression=kind, chunk_threshold=48_000) as ros_bag:
        for topic, message, time in messages:
            ros_bag.write(topic, message, rospy.Time.from_sec(time))
    return path


def contents(path: Path) -> Messages:
    with Reader(path) as reader:
        return Counter((c.topic, c.msgtype, c.digest, time, bytes(raw)) for c, time, raw in reader.messages())


def places(path: Path) -> dict[str, int]:
    """Return the offset of what can be damaged in a bag, by its name."""
    data = path.read_bytes()
    with Reader(path) as reader:
        chunk = reader.chunks[sorted(reader.chunks)[1]]
    index = struct.unpack("<Q", data[(at := data.index(b"index_pos=") + 10) : at + 8])[0]
    return {
        "magic": 3,
        "position of the index": at + 1,
        "kind of a chunk": data.rindex(b"op=\x05", 0, chunk.datapos) + 3,
        "length of a chunk": chunk.datapos - 3,
        "size of a chunk": data.rindex(b"size=", 0, chunk.datapos) + 5,
        "compression of a chunk": data.rindex(b"compression=", 0, chunk.datapos) + 12,
        "first byte of the data": chunk.datapos,
        "middle of the data": chunk.datapos + chunk.datasize // 2,
        "end of the data": chunk.datapos + chunk.datasize - 3,
        "index of a chunk": data.index(b"count=", chunk.datapos + chunk.datasize) + 6,
        "connection at the end": data.index(b"std_msgs/", index) + 2,
        "place of a chunk": data.index(b"chunk_pos=", index) + 10,
    }


@pytest.mark.parametrize("kind", KINDS)
def test_one_flipped_bit_costs_one_chunk_at_most_and_is_found(kind: str, tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.bag", kind)
    expected = contents(whole)
    with Reader(whole) as reader:
        largest = max(sum(info.connection_counts.values()) for info in reader.chunk_infos)
        assert len(reader.chunk_infos) >= 6
    assert examine(whole).code == 0
    for name, place in places(whole).items():
        damaged = tmp_path / "damaged.bag"
        data = bytearray(whole.read_bytes())
        data[place] ^= 4
        damaged.write_bytes(data)
        undetected = kind == "none" and "data" in name  # without a checksum
        assert examine(damaged).code == 4 or undetected, name
        salvaged = salvage(damaged)
        kept = contents(salvaged.bag)
        assert (expected - kept).total() <= largest, name
        assert not kept - expected or salvaged.doubtful or undetected, f"{name}: what is wrong is marked"
        assert examine(salvaged.bag).code == 0
        for path in (salvaged.bag, salvaged.original):
            path.unlink()


def test_what_a_wrong_checksum_leaves_readable_is_kept_and_marked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = write(tmp_path / "a.bag", "headless")
    expected, data = contents(whole), bytearray(whole.read_bytes())
    data[places(whole)["middle of the data"]] ^= 1
    whole.write_bytes(data)
    assert main(["health", str(whole), "--salvage", "--quiet", "--json", str(tmp_path / "health.json")]) == 3
    assert "may have wrong values: the checksum of the chunk at byte" in capsys.readouterr().out
    assert json.loads((tmp_path / "health.json").read_text())["bags"][0]["exit_code"] == 3
    assert (expected - contents(whole)).total() <= 1


@pytest.mark.parametrize("kind", ["headless", "none"])
def test_flipped_bit_of_the_index_is_found_where_readers_stumble(kind: str, tmp_path: Path) -> None:
    whole, damaged = write(tmp_path / "whole.bag", kind), tmp_path / "damaged.bag"
    data, expected = whole.read_bytes(), contents(whole)
    index = struct.unpack("<Q", data[(at := data.index(b"index_pos=") + 10) : at + 8])[0]
    for bit in range(8 * index, 8 * len(data), 29):  # each bit of a byte in turn
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        damaged.write_bytes(flipped)
        if examine(damaged).code != 4:
            assert contents(damaged) == expected, f"bit {bit % 8} of byte {bit // 8 - index} of the index"


def test_zeros_before_the_index_are_no_damage(tmp_path: Path) -> None:
    path = write(tmp_path / "a.bag", "none")
    data = path.read_bytes()
    at = data.index(b"index_pos=") + 10
    index = struct.unpack("<Q", data[at : at + 8])[0]
    path.write_bytes(data[:at] + struct.pack("<Q", index + 49) + data[at + 8 : index] + bytes(49) + data[index:])
    assert sum(len(stream.recorded) for stream in examine(path).streams) == 330 and examine(path).code == 0


def test_a_connection_whose_chunk_is_lost_is_taken_from_the_index(tmp_path: Path) -> None:
    path = write(tmp_path / "a.bag", "bz2")
    expected, data = contents(path), bytearray(path.read_bytes())
    with Reader(path) as reader:
        first = reader.chunks[min(reader.chunks)]
    data[first.datapos + 100] ^= 1
    path.write_bytes(data)
    kept = contents(salvage(path).bag)
    assert kept and not kept - expected and {topic for topic, *_ in kept} == {"/array", "/text"}


def test_chunks_of_headless_bags_are_small_and_short(tmp_path: Path) -> None:
    path = write(tmp_path / "a.bag", "headless")
    data = path.read_bytes()
    sizes = [
        int.from_bytes(data[at + 5 : at + 9], "little") for at in range(len(data)) if data[at : at + 5] == b"size="
    ]
    assert len(sizes) >= 6 and max(sizes) <= 64 * 1024
    with BagWriter(tmp_path / "slow.bag") as bag:
        for time in range(10):
            bag.write("/text", String("slow"), float(time))
    with Reader(tmp_path / "slow.bag") as reader:
        assert max(info.end_time - info.start_time for info in reader.chunk_infos) <= 1.1e9
    with rosbag.Bag(str(path)) as ros_bag:
        assert sum(1 for _ in ros_bag.read_messages()) == 330, "ROS's own reader has them, too"


@pytest.mark.parametrize("kind", KINDS)
def test_reading_a_damaged_bag_names_health(kind: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.bag", kind)
    data = bytearray(path.read_bytes())
    data[places(path)["place of a chunk" if kind == "none" else "middle of the data"]] ^= 4
    path.write_bytes(data)
    named = r"cannot read a\.bag: .*hric health --salvage /"
    with pytest.raises(HricError, match=named), bag_reader.opened(path) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)


@pytest.mark.parametrize("command", [["report"], ["export", "--format", "csv"]], ids=["report", "export"])
def test_a_command_on_a_bag_that_was_cut_ends_in_one_line(
    tmp_path: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "a.bag", "lz4")
    path.write_bytes(path.read_bytes()[:-1000])
    first, *options = command
    assert main([first, str(path), *options]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1 and "health --salvage" in message and "('" not in message


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "`git lfs pull`"),
        (b"SQLite format 3\0", "a bag of ROS 2"),
        (b"\x89MCAP0\r\n\x01\x0c\0\0\0\0\0\0\0\x04\0\0\0ros1\0\0\0\0", "an MCAP file of ROS 1"),
        (b"\x89MCAP0\r\n\x01\x0c\0\0\0\0\0\0\0\x04\0\0\0ros2\0\0\0\0", "a bag of ROS 2; rename it"),
        (b"\x1f\x8b\x08", "`gunzip`"),
        (b"PK\x03\x04", "`unzip`"),
        (b"\n<!DOCTYPE html><html>404", "a web page"),
    ],
)
@pytest.mark.parametrize("command", [["health"], ["report"], ["export", "--format", "csv"]], ids=lambda words: words[0])
def test_a_file_that_is_no_bag_is_named_for_what_it_is(
    tmp_path: Path, head: bytes, expected: str, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.bag").write_bytes(head)
    first, *options = command
    assert main([first, str(tmp_path / "a.bag"), *options]) == 2
    message = capsys.readouterr().err
    assert expected in message and message.count("\n") == 1


@pytest.mark.parametrize("command", [["health"], ["report"], ["export", "--format", "csv"]], ids=lambda words: words[0])
@pytest.mark.parametrize("name", ["recording", "recording.bag"])
def test_a_folder_of_ros_2_is_named_for_what_it_is(
    tmp_path: Path, name: str, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    (tmp_path / name / "recording_0.db3").write_bytes(b"SQLite format 3\0")
    first, *options = command
    assert main([first, str(tmp_path / name), *options]) == 2
    message = capsys.readouterr().err
    assert f"{name} is a bag of ROS 2" in message or f"cannot read {name}, a bag of ROS 2: " in message
    assert message.count("\n") == 1
