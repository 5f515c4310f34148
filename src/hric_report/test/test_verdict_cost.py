"""Cost of a verdict: processor time for a run of one minute, and memory for one hour."""

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer

from hric_assessment.verdict import assess, opened
from hric_bags.parts import PartsReader
from hric_bags.reader import LOG_TYPE
from hric_core.command import main

MINUTE, HOUR = 60.0, 3600.0
PROCESSOR = 6.0
"""Maximum processor time for a run of one minute [s] (requirement of this project)."""
MEMORY = 1e9
"""Maximum memory for a run of one hour [B] (requirement of this project)."""
MEASURE = """
import re, sys
from pathlib import Path
from hric_assessment.verdict import assess, opened
outcome = assess(opened(sys.argv[1])).outcome
print(outcome, 1024 * int(re.search(r"VmHWM:\\s*([0-9]+)", Path("/proc/self/status").read_text())[1]))
"""
"""Program that prints its largest memory; that of `resource.getrusage` is at least that of the starting process."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run in which an upper body guides the robot."""
    root = tmp_path_factory.mktemp("runs")
    words = ["simulator:=mujoco", "human.parts:=upper_body", "duration:=5", "--quiet", "--no-figures"]
    assert main(["run", "hand_guidance", *words, "--runs", str(root)]) == 0
    return (root / "latest").resolve()


def lengthened(run: Path, seconds: float) -> None:
    """Replace the bag by one in which its streams are repeated with later stamps."""
    (path,) = run.glob("*.bag")
    longer = path.with_suffix(".longer")
    with PartsReader(path) as reader, Writer(longer) as writer:
        fields = reader.typestore.fielddefs
        chosen = [c for c in reader.connections if fields[c.msgtype][1][0][0] == "header"]  # all but clock, tf, texts
        kept = [(c, stamp, bytes(raw)) for c, stamp, raw in reader.messages(connections=chosen)]
        added = {
            c.topic: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest) for c in chosen
        }
        first, span = kept[0][1], kept[-1][1] - kept[0][1] + 5_000_000
        for turn in range(int(np.ceil(seconds * 1e9 / span))):
            later = turn * span
            for connection, stamp, raw in kept:
                if stamp - first + later > seconds * 1e9:
                    break
                moved = _log(reader, raw, later) if connection.msgtype == LOG_TYPE else _stamped(raw, later)
                writer.write(added[connection.topic], stamp + later, moved)
    longer.replace(path)


def _stamped(raw: bytes, later: int) -> bytes:
    """Return a serialised message, whose header comes first, with a stamp that is increased by `later` [ns]."""
    stamp = int.from_bytes(raw[4:8], "little") * 1_000_000_000 + int.from_bytes(raw[8:12], "little") + later
    seconds, rest = divmod(stamp, 1_000_000_000)
    return raw[:4] + seconds.to_bytes(4, "little") + rest.to_bytes(4, "little") + raw[12:]


def _log(reader: PartsReader, raw: bytes, later: int) -> bytes:
    message: Any = reader.deserialize(raw, LOG_TYPE)
    message.time = message.time + 1e-9 * later
    message.first_cycle += later // 1_000_000
    return _stamped(bytes(reader.typestore.serialize_ros1(message, LOG_TYPE)), later)


@pytest.mark.slow
def test_a_minute_is_assessed_in_six_seconds_of_a_processor(run: Path) -> None:
    lengthened(run, MINUTE)
    begin = time.process_time()
    verdict = assess(opened(str(run)))
    used = time.process_time() - begin
    print(f"verdict of a minute: {used:.1f} s of processor")
    assert verdict.input.end - verdict.input.begin == pytest.approx(MINUTE, abs=0.1)
    assert verdict.timelines.separation and verdict.timelines.activation and len(verdict.timelines.scores["rula"]) == 2
    assert used < PROCESSOR


@pytest.mark.slow
def test_an_hour_is_assessed_in_less_than_a_gigabyte(run: Path) -> None:
    lengthened(run, HOUR)
    done = subprocess.run([sys.executable, "-c", MEASURE, str(run)], capture_output=True, text=True, check=True)
    used = float(done.stdout.split()[-1])
    print(f"verdict of an hour: {1e-6 * used:.0f} MB")
    assert used < MEMORY
