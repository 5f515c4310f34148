"""Every reader of a run folder reads all parts of a recording that the recorder really split, and the health command
looks at where they meet."""

import json
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rosbag
import rospy
from real_master import ros, roscore  # noqa: F401
from recorder_rig import Node, start  # noqa: F401
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from synthetic import BATCH, PERIOD, TARGET, log_message, signals

from hric_analysis import recordings
from hric_bags import reader as bag_reader
from hric_bags.export import recording
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_msgs.msg import ControlLog, SampleChunk

SENT_AT, CYCLES = 0.1, 60_000
EMG_RATE, EMG_CHUNK = 500.0, 10
pytestmark = [pytest.mark.alone, pytest.mark.rostest]
CONTROL_LOG, EMG, JOINTS = "/parts_test/control_log", "/parts_test/emg", "/parts_test/joint_states"
COMMAND = "/pd/command"


class Robot:
    """Publishes a control log, chunks of samples and joint states, 50 times a second, with the time since it began as
    stamps."""

    def __init__(self) -> None:
        self.batches = 0
        kinds = {CONTROL_LOG: ControlLog, EMG: SampleChunk, JOINTS: JointState}
        self._publishers = {topic: rospy.Publisher(topic, kind, queue_size=100) for topic, kind in kinds.items()}
        self._command = rospy.Publisher(COMMAND, Float64MultiArray, queue_size=1)
        self._data = signals(CYCLES, SENT_AT)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def send_setpoint(self) -> None:
        """Publish one setpoint for the report."""
        self._command.publish(Float64MultiArray(data=TARGET.tolist()))

    def _run(self) -> None:
        begin = time.monotonic()
        while not self._stop.wait(max(begin + self.batches * BATCH * PERIOD - time.monotonic(), 0.0)):
            now = rospy.Time.from_sec(self.batches * BATCH * PERIOD)
            self._publishers[CONTROL_LOG].publish(log_message(self.batches * BATCH, BATCH, self._data))
            chunk = SampleChunk(
                source="made up", channels=["a"], unit="V", rate=EMG_RATE, first_sample=self.batches * EMG_CHUNK
            )
            chunk.header.stamp = now
            chunk.data = [float(chunk.first_sample + k) for k in range(EMG_CHUNK)]
            self._publishers[EMG].publish(chunk)
            joints = JointState(name=["j1"], position=[0.001 * self.batches])
            joints.header.stamp = now
            self._publishers[JOINTS].publish(joints)
            self.batches += 1

    def close(self) -> None:
        """Stop publishing."""
        self._stop.set()
        self._thread.join()
        for publisher in (*self._publishers.values(), self._command):
            publisher.unregister()


@pytest.fixture
def robot(ros: str) -> Iterator[Robot]:  # noqa: F811
    running = Robot()
    yield running
    running.close()


@pytest.fixture
def split(robot: Robot, start: Callable[..., Node], tmp_path: Path) -> RunFolder:  # noqa: F811
    """A run of three parts."""
    node = start(topics=f"[{CONTROL_LOG}, {EMG}, {JOINTS}, {COMMAND}]")
    node.wait_recording()
    robot.send_setpoint()
    for _ in range(2):
        time.sleep(0.5)
        response = node.call("split")
        assert response.success, response.message
    time.sleep(0.5)
    assert node.call("stop").success
    folder = node.folder()
    folder.update(
        limits={
            f"j{k}": {"lower": -2.0, "upper": 2.0, "velocity": 20.0, "effort": 20.0, "effort_rate": 1000.0}
            for k in (1, 2, 3)
        }
    )
    return folder


def cut(bag: Path, keep: Callable[[str, float], bool]) -> None:
    """Write a bag without some messages; keep: function (topic, recording time [s]) that returns True to keep one."""
    whole = bag.with_suffix(".whole")
    shutil.move(bag, whole)
    with rosbag.Bag(str(whole)) as old, rosbag.Bag(str(bag), "w") as new:
        for topic, message, stamp in old.read_messages():
            if keep(topic, stamp.to_sec()):
                new.write(topic, message, stamp)


def test_every_reader_of_a_run_reads_all_its_parts_and_a_gap_between_them_is_reported(
    split: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = split.read()["bags"]
    log = bag_reader.read(split.path / names[0]).log
    assert len(names) == 3 and log.gaps == () and log.repeats == ()
    with rosbag.Bag(str(split.path / names[2])) as last:
        end = max(message.first_cycle + message.n_cycles for _, message, _ in last.read_messages(CONTROL_LOG))
    assert log.first_cycle + log.cycles == end

    assert main(["report", str(split.path), "--no-figures", "--html"]) == 0
    metrics = json.loads(split.metrics_path.read_text())
    assert metrics["control_log"]["cycles"] == log.cycles and (split.path / "report.html").is_file()
    (shown,) = [s for s in recordings.read(split.path / names[0], float).signals if s.topic == EMG]
    assert np.array_equal(np.diff(shown.values[:, 0]), np.ones(len(shown.values) - 1))

    table = recording.read(recording.find(str(split.path)), [EMG])[EMG]
    assert np.array_equal(np.diff(table.columns[0].values), np.ones(len(table.columns[0].values) - 1))
    assert len(table.time) == len(shown.values)

    capsys.readouterr()
    for given in (split.path, split.path / names[0]):
        assert main(["health", str(given), "--json", str(tmp_path / "health.json")]) == 0, capsys.readouterr().out
        report = json.loads((tmp_path / "health.json").read_text())
        assert len(report["bags"]) == 3 and [seam["after"] for seam in report["seams"]] == names[1:]
    assert "recorded together for" in capsys.readouterr().out

    # The next part comes too late, and another loses its joint states.
    cut(split.path / names[1], lambda topic, _: topic != JOINTS)
    with rosbag.Bag(str(split.path / names[1])) as middle:
        ended = middle.get_end_time()
    cut(split.path / names[2], lambda _, recorded: recorded > ended + 0.1)
    assert main(["health", str(split.path), "--quiet"]) == 3
    found = capsys.readouterr().out
    assert f"problem: {CONTROL_LOG}: " in found and "cycles are missing between the parts, from number" in found
    assert f"problem: {EMG}: " in found and "samples are missing between the parts" in found
    assert f"note: {JOINTS}: is not in {names[1]}, although it went on to the end of {names[0]}" in found
