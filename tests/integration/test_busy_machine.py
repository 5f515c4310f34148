"""A minute of motion capture while others take the processors: the order of its stamps, and what the controller makes
of them."""

import contextlib
import itertools
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from live_system import ROOT, LiveSystem
from rosbags.highlevel import AnyReader

pytestmark = pytest.mark.alone

EXPERIMENT = ROOT / "src/hric_experiments/config/experiments/marker_tracking.yaml"
MINUTE = 60.0
STAMPED = ("/hric/perception/mocap", "/mocap/marker_stamped", "/mocap/hand/pose")
STATE = "/cartesian_pose_controller/state"


@contextlib.contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """Processes that want a processor each; each in a session of its own, as in terminals of their own, so that the
    system does not share one's part with the bring-up's."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"], start_new_session=True) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def a_minute(folder: Path) -> Path:
    """The experiment marker_tracking for as long."""
    experiment = yaml.safe_load(EXPERIMENT.read_text())
    experiment["duration"] = MINUTE
    experiment["mocap"]["human"]["cycles"] = round((MINUTE - 3.0) * experiment["mocap"]["human"]["frequency"])
    path = folder / "marker_tracking_minute.yaml"
    path.write_text(yaml.safe_dump(experiment))
    return path


def recorded(bag: Path) -> tuple[dict[str, list[int]], Any]:
    """Stamps of each stamped topic [ns], in their order, and the last state of the controller."""
    stamps, state = defaultdict(list), None
    with AnyReader([bag]) as reader:
        wanted = [connection for connection in reader.connections if connection.topic in (*STAMPED, STATE)]
        for connection, _, raw in reader.messages(wanted):
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == STATE:
                state = message
            else:
                stamps[connection.topic].append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
    return stamps, state


@pytest.mark.slow
def test_beside_two_busy_loops_no_stamp_goes_back_for_a_minute_and_no_marker_is_refused(
    start: Callable[..., LiveSystem], tmp_path: Path
) -> None:
    system = start("env:=sim", "rviz:=false", f"experiment:={a_minute(tmp_path)}", "mocap_server:=127.0.7.5")
    system.wait_running("cartesian_pose_controller")
    with busy_loops(2):
        assert system.wait(240.0) == 0, system.output
    stamps, state = recorded(next(system.run_folder.glob("*.bag")))
    steps = {topic: min(b - a for a, b in itertools.pairwise(found)) * 1e-9 for topic, found in stamps.items()}
    print(
        f"least step {steps} s; refused "
        f"{dict(zip(state.refused_reasons, state.refused_counts, strict=True))}; lost {state.losses} times"
    )
    assert set(steps) == set(STAMPED) and all(len(found) > 200 * MINUTE for found in stamps.values())
    assert min(steps.values()) > 0.0
    assert list(state.refused_reasons) == []
