"""Data collection with one command: robot, motion capture, EMG and force plate over their network protocols.

All data is in one bag, and synchronised.
"""

import contextlib
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from bags import control_log, gaps_and_repeats, topics
from live_system import ROOT, LiveSystem
from rosbags.highlevel import AnyReader

pytestmark = pytest.mark.alone

Start = Callable[..., LiveSystem]
Figure = Callable[[str, float, str], None]
FILE = ROOT / "src/hric_experiments/config/experiments/data_collection.yaml"
LOG, FRAMES, EMG, PLATE = (
    "/control_log",
    "/hric/perception/mocap",
    "/hric/perception/emg/raw",
    "/hric/perception/force_plate/1/samples",
)
RATES = {LOG: 1000.0, FRAMES: 120.0, EMG: 2000.0, PLATE: 1000.0}
STREAMS = {"/hric/perception/sync_100hz": 100.0, "/hric/perception/sync_1000hz": 1000.0}
SKEW = 2e-4
"""Required limit of the skew of resampled values [s]."""


def shortened(folder: Path, duration: float) -> Path:
    """Write the experiment with a shorter motion [s]."""
    content = yaml.safe_load(FILE.read_text())
    content["duration"] = duration
    content["setpoints"] = [{**content["setpoints"][0], "time": 0.5}]
    path = folder / "collection.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def ran(system: LiveSystem, timeout: float) -> dict[str, Any]:
    """Wait for the end of a bring-up, check its output and files, and return its metrics."""
    assert system.wait(timeout) == 0, system.output
    assert system.processes() == {}
    assert "Traceback" not in system.output
    run = yaml.safe_load((system.run_folder / "run.yaml").read_text())
    assert run["status"] == "completed" and len(run["interval"]) == 2
    metrics: dict[str, Any] = json.loads((system.run_folder / "metrics.json").read_text())
    for topic, values in metrics["sources"].items():
        if values["sent"] is not None:
            assert f"{topic}: {values['sent']} {values['counts']} sent, {values['recorded']} recorded" in system.output
    return metrics


def numbers(bag: Path, topic: str) -> np.ndarray:
    """Return the sample indices of the source itself: frame numbers, or indices computed from its time codes."""
    found = []
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages([item for item in reader.connections if item.topic == topic]):
            message = reader.deserialize(raw, connection.msgtype)
            if topic == FRAMES:
                found.append([message.frame_number])
            else:
                found.append(
                    np.rint(
                        message.data.reshape(-1, len(message.channels))[:, message.channels.index("time")]
                        * RATES[topic]
                    )
                )
    return np.concatenate(found).astype(np.int64)


def check_counts(system: LiveSystem, metrics: dict[str, Any], duration: float) -> None:
    """Check that no sample of any source is missing: by the count that the source reports, and by gaps in the bag."""
    bag = next(system.run_folder.glob("*.bag"))
    assert topics(bag) >= {
        *RATES,
        *STREAMS,
        "/hric/perception/emg/envelope",
        "/hric/perception/sent",
        "/hric/human/hand",
    }
    assert gaps_and_repeats(control_log(bag)[0]) == (0, 0)
    for topic, rate in RATES.items():
        values = metrics["sources"][topic]
        assert (values["sent"], values["lost"], values["twice"]) == (values["recorded"], 0, 0), topic
        assert values["sent"] >= rate * (duration - 0.5), (
            f"{topic}: the source tells ten times a second what it has sent"
        )
        if topic != LOG:
            own = numbers(bag, topic)
            inside = own[(own >= values["first"]) & (own <= values["last"])]
            assert gaps_and_repeats(inside) == (0, 0) and len(inside) == values["sent"]


def check_skew(metrics: dict[str, Any], figure: Figure, share: str) -> None:
    """Check that no synchronised sample is missing, and that the median or p99 of the skew is within the limit."""
    assert [stream["missing"] for stream in metrics["sync"].values()] == [0, 0]
    for topic, stream in metrics["sync"].items():
        assert stream["rate"] == STREAMS[topic] and stream["bound"] == SKEW and stream["grid_error"] < 1e-6
        for source, values in stream["sources"].items():
            skew = values["skew"]
            figure(f"data collection, {topic}, {source}: skew, 99 %", 1e3 * skew["p99"], "ms")
            assert values["told_skew"] == 0.0 and values["valid"] > 0.9, source
            assert skew[share] <= SKEW + skew.get("uncertainty", 0.0), (topic, source, values)


def test_the_bag_holds_every_sample_and_the_synchronised_ones_are_of_their_instants(
    start: Start, tmp_path: Path, figure: Figure
) -> None:
    # At real time, whatever else the machine does: where it does not keep up, the run slows down. A pause of 30 ms is
    # 1 % of this short run, so that its limit is for the median; the live tests below have it for 99 %.
    path = shortened(tmp_path, 3.0)
    system = start("env:=sim", "rviz:=false", f"experiment:={path}", "mocap_server:=127.0.7.11")
    metrics = ran(system, 240.0)
    check_counts(system, metrics, 3.0)
    expected = {topic: stream["expected"] for topic, stream in metrics["sync"].items()}
    begin, end = yaml.safe_load((system.run_folder / "run.yaml").read_text())["interval"]  # robot time
    assert end - begin >= 3.0 - 1e-6
    assert expected == pytest.approx({topic: (end - begin) * rate for topic, rate in STREAMS.items()}, abs=1.5)
    check_skew(metrics, figure, "median")


@pytest.mark.live
def test_for_a_minute_at_real_time_nothing_is_lost_and_all_is_of_its_instant(start: Start, figure: Figure) -> None:
    system = start("env:=sim", "rviz:=false", "experiment:=data_collection", "mocap_server:=127.0.7.12")
    metrics = ran(system, 400.0)
    check_counts(system, metrics, 60.0)
    check_skew(metrics, figure, "p99")
    figure("data collection at real time: robot time per wall time", metrics["real_time_factor"], "1")
    assert metrics["real_time_factor"] == pytest.approx(1.0, rel=0.01)


def memory(pid: int) -> float:
    """Return the resident memory of a process [MB]; NaN if it has ended."""
    with contextlib.suppress(OSError):
        fields = Path(f"/proc/{pid}/statm").read_text().split()
        return int(fields[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return math.nan


@pytest.mark.live
def test_ten_minutes_beside_four_busy_loops_cost_pace_and_nothing_else(
    start: Start, tmp_path: Path, figure: Figure
) -> None:
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]
    try:
        system = start(
            "env:=sim", "rviz:=false", f"experiment:={shortened(tmp_path, 600.0)}", "mocap_server:=127.0.7.13"
        )
        settled, used = time.monotonic() + 120.0, dict[tuple[int, str], list[float]]()
        while True:
            assert system.process.poll() is None and time.monotonic() < settled + 3600.0
            time.sleep(5.0)
            now = {process: memory(process[0]) for process in system.processes().items()}
            if [*system.run_folder.glob("*.bag")]:  # the recording is closed, and a report is written
                break
            for process, size in now.items() if time.monotonic() > settled else ():
                used.setdefault(process, []).append(size)
        metrics = ran(system, 600.0)
    finally:
        for loop in busy:
            loop.kill()
            loop.wait()
    check_counts(system, metrics, 600.0)
    check_skew(metrics, figure, "p99")
    figure("data collection beside four busy loops: robot time per wall time", metrics["real_time_factor"], "1")
    grown = {process: np.nanmax(mb) - mb[0] for process, mb in used.items() if len(mb) > 20}
    figure("data collection of ten minutes: largest growth of a process", max(grown.values()), "MB")
    assert {process: mb for process, mb in grown.items() if mb > 10.0} == {}
