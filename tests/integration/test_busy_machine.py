"""Tests on a busy machine: order of motion capture stamps, behaviour of the controller, and Ctrl-C at any time."""

import contextlib
import itertools
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from bags import control_log, gaps_and_repeats, topics
from bringup_end import LIMIT
from live_system import ROOT, LiveSystem
from rosbags.highlevel import AnyReader

pytestmark = pytest.mark.alone

EXPERIMENT = ROOT / "src/hric_experiments/config/experiments/marker_tracking.yaml"
MINUTE = 60.0
STAMPED = ("/hric/perception/mocap", "/mocap/marker_stamped", "/mocap/hand/pose")
STATE = "/cartesian_pose_controller/state"
LOG = "/control_log"
MOMENTS = 10


@contextlib.contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """Yield while processes compete for processor time.

    Each has a separate session, as in separate terminals, since the kernel shares processor time among sessions.
    """
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"], start_new_session=True) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def a_minute(folder: Path) -> Path:
    """Write the experiment marker_tracking with this duration."""
    experiment = yaml.safe_load(EXPERIMENT.read_text())
    experiment["duration"] = MINUTE
    experiment["mocap"]["human"]["cycles"] = round((MINUTE - 3.0) * experiment["mocap"]["human"]["frequency"])
    path = folder / "marker_tracking_minute.yaml"
    path.write_text(yaml.safe_dump(experiment))
    return path


def recorded(bag: Path) -> tuple[dict[str, list[int]], Any]:
    """Return the stamps of each stamped topic in recording order [ns], and the last state of the controller."""
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


def whole_run(system: LiveSystem) -> float:
    """Return the duration of pd_step from the command to its report [s of wall time]."""
    began = time.monotonic()
    assert system.wait(240.0) == 0, system.output
    return time.monotonic() - began


def ended_well(system: LiveSystem) -> None:
    """Check that no process was killed or reported an error, and that all files are complete."""
    output = system.output
    assert system.process.returncode in {0, 130, -signal.SIGINT}, output  # the last: before Python ran
    assert system.processes() == {}
    assert not any(word in output for word in ("Traceback", "killed", "SIGKILL", "[ERROR]", "[FATAL]")), output
    for folder in [folder for folder in system.runs.glob("*") if not folder.is_symlink()]:
        assert yaml.safe_load((folder / "run.yaml").read_text())["status"] in {"interrupted", "completed"}, output
        assert not list(folder.glob("*.active"))
        for bag in (bag for bag in folder.glob("*.bag") if LOG in topics(bag)):  # it may end before the robot runs
            assert gaps_and_repeats(control_log(bag)[0]) == (0, 0)


@pytest.mark.slow
def test_ctrl_c_at_ten_moments_of_a_run_beside_two_busy_loops_ends_it_quietly_and_whole(
    start: Callable[..., LiveSystem], figure: Callable[[str, float, str], None]
) -> None:
    arguments = ("env:=sim", "rviz:=false", "experiment:=pd_step")
    ends = []
    with busy_loops(2):
        duration = whole_run(start(*arguments))
        for moment in range(MOMENTS):
            system = start(*arguments)
            with contextlib.suppress(subprocess.TimeoutExpired):
                system.process.wait((moment + 0.5) / MOMENTS * duration)
            ends.append(system.interrupt() if system.process.poll() is None else 0.0)
            ended_well(system)
    figure("Ctrl-C beside two busy loops: longest end", max(ends), "s")
    assert max(ends) < LIMIT
