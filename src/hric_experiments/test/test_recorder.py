"""Recorder node: start, split, trigger and stop by service; behaviour with a full disk."""

import os
import random
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from real_master import ros, roscore  # noqa: F401
from recorder_rig import Node, Source, source, start, until  # noqa: F401
from rosbags.highlevel import AnyReader
from std_msgs.msg import Empty, UInt8MultiArray

from hric_bags.parts import PartsReader, parts
from hric_bags.run_folder import RunFolder
from hric_core.errors import ParameterError
from hric_experiments.recorder.settings import RecorderSettings

pytestmark = pytest.mark.alone

rostest = pytest.mark.rostest


def numbers(bags: list[Path]) -> list[list[int]]:
    """Return the numbers in each bag."""
    found: list[list[int]] = []
    for bag in bags:
        with AnyReader([bag]) as reader:
            found.append(
                [
                    reader.deserialize(raw, c.msgtype).data
                    for c, _, raw in reader.messages()
                    if c.topic.endswith("counter")
                ]  # type: ignore[attr-defined]
            )
    return found


@rostest
def test_a_split_loses_no_message_and_reading_all_parts_gives_each_once(
    source: Source,  # noqa: F811
    start: Callable[..., Node],  # noqa: F811
) -> None:
    node = start("_subject:=P07", "_notes:=left hand, tired")
    node.wait_recording()
    for _ in range(2):
        time.sleep(0.3)
        answer = node.call("split")
        assert answer.success, answer.message
    folder = node.folder()
    assert answer.message == str(folder.path / f"{folder.path.name}_1.bag")
    assert node.call("stop").success
    run = folder.read()
    names = [f"{folder.path.name}_{number}.bag" for number in range(3)]
    assert sorted(path.name for path in folder.path.glob("*.bag*")) == names
    assert (run["bag"], run["bags"], run["status"]) == (names[0], names, "completed")
    assert (run["subject"], run["notes"]) == ("P07", "left hand, tired")
    first, second, third = numbers([folder.path / name for name in names])
    for part in (first, second, third):
        assert part == list(range(part[0], part[0] + len(part)))
    assert first[0] < second[0] <= first[-1] + 1 and second[-1] + 1 >= third[0] > second[0]
    with PartsReader(folder.path / names[0]) as reader:
        messages = [(c.topic, reader.deserialize(raw, c.msgtype).data) for c, _, raw in reader.messages()]  # type: ignore[attr-defined]
    assert [data for topic, data in messages if topic.endswith("counter")] == list(range(first[0], third[-1] + 1))
    assert [data for topic, data in messages if topic.endswith("layout")] == ["x y z"]


@rostest
def test_parts_of_a_given_length_follow_each_other_by_themselves(source: Source, start: Callable[..., Node]) -> None:  # noqa: F811
    node = start("_split_duration:=1.0")
    node.wait_recording()
    until(lambda: len(node.folder().read().get("bags", [])) >= 3)
    assert node.call("stop").success
    found = numbers(parts(node.folder().path / node.folder().read()["bag"]))
    assert len(found) >= 2 and {*found[0], *found[1]} == set(range(found[0][0], found[1][-1] + 1))


@rostest
def test_an_armed_recorder_begins_with_the_trigger_and_each_trigger_is_a_run(
    source: Source,  # noqa: F811
    start: Callable[..., Node],  # noqa: F811
) -> None:
    node = start("_start:=on_trigger")
    assert not node.call("stop").success and not node.call("split").success
    publisher = rospy.Publisher("/hric/experiment/trigger", Empty, queue_size=1)
    until(lambda: publisher.get_num_connections() > 0)
    assert not list(node.runs.iterdir())
    publisher.publish(Empty())
    node.wait_recording()
    again = node.call("start")
    assert not again.success and "is already running" in again.message
    time.sleep(0.3)
    assert node.call("stop").success
    assert node.call("start").success
    assert node.call("stop").success
    runs = [path for path in node.runs.iterdir() if not path.is_symlink()]
    assert len(runs) == 2 and all(RunFolder(path).read()["status"] == "completed" for path in runs)
    publisher.unregister()


@rostest
@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_ctrl_c_while_a_recording_begins_leaves_an_interrupted_run(
    source: Source,  # noqa: F811
    start: Callable[..., Node],  # noqa: F811
    delay: float,
) -> None:
    node = start("_experiment:=pd_step")
    until(lambda: any(node.runs.glob("pd_step_*")))
    time.sleep(delay)
    node.close()
    (folder,) = node.runs.glob("pd_step_*")
    assert RunFolder(folder).read()["status"] == "interrupted"
    assert RunFolder(folder).read().get("reason") in (None, "ended before the recording began")


def test_a_disk_without_room_is_refused_before_anything_is_made(source: Source, start: Callable[..., Node]) -> None:  # noqa: F811
    node = start("_min_free:=1e12")
    output = node.process.communicate(timeout=30)[0]
    assert node.process.returncode == 1 and "Traceback" not in output
    assert "are free in the folder for recordings" in output and "min_free" in output and "record:=false" in output
    assert not list(node.runs.iterdir())


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Return a folder on a disk of 24 MB."""
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small file system")
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=24m", "tmpfs", str(disk)], capture_output=True, text=True, check=False
    )
    if mounted.returncode:
        pytest.skip(f"a small file system cannot be mounted here: {mounted.stderr.strip()}")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=False)


@rostest
def test_a_disk_that_fills_ends_the_recording_with_one_error_and_a_bag_that_is_whole(
    source: Source,  # noqa: F811
    start: Callable[..., Node],  # noqa: F811
    small_disk: Path,
) -> None:
    told: list[Any] = []
    listener = rospy.Subscriber("/diagnostics", DiagnosticArray, lambda message: told.extend(message.status))
    node = start("_min_free:=12", runs=small_disk, topics="[/recorder_test/counter, /recorder_test/noise]")
    chance = random.Random(1)
    publisher = rospy.Publisher("/recorder_test/noise", UInt8MultiArray, queue_size=10)
    node.wait_recording()
    for _ in range(200):
        publisher.publish(UInt8MultiArray(data=chance.randbytes(100_000)))
        if any(status.level == 2 for status in told):
            break
        time.sleep(0.03)
    until(lambda: any(status.level == 2 for status in told))
    status = next(status for status in told if status.level == 2)
    assert "the recording was ended" in status.message and "min_free" in status.message
    folder = node.folder()
    assert folder.read()["status"] == "interrupted" and "min_free" in folder.read()["reason"]
    output = node.close()
    assert output.count("the recording was ended") == 1 and "Traceback" not in output
    assert not list(folder.path.glob("*.active")) and len(numbers([folder.bag_path])[0]) > 50
    listener.unregister()
    publisher.unregister()


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("start", "later", "valid: now, on_trigger, on_request"),
        ("subject", "Jane Doe", "for example P07"),
        ("notes", "n" * 3000, "at most 2000"),
        ("split_size", -1, "0 or more"),
        ("split_duration", "long", "0 or more"),
        ("min_free", True, "0 or more"),
    ],
)
def test_a_setting_that_cannot_be_is_refused_with_what_is_valid(name: str, value: Any, text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        RecorderSettings(**{name: value})


def test_none_says_that_nothing_is_given() -> None:
    settings = RecorderSettings(subject="none", notes="none")
    assert (settings.subject, settings.notes) == ("", "")
