"""Marker tracking (chapter 3 of the thesis) with one command, over the real network protocol, in every environment."""

import contextlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from bags import topics
from fci_peer import control_box
from live_system import LiveSystem

pytestmark = pytest.mark.alone

Start = Callable[..., LiveSystem]
Figure = Callable[[str, float, str], None]
RECORDED = {
    "/hric/clock",
    "/hric/perception/mocap",
    "/hric/human/hand",
    "/hric/human/phase",
    "/mocap/marker",
    "/mocap/trail",
    "/cartesian_pose_controller/state",
    "/control_log",
}
SLOWLY = "real_time_factor:=0.25"
"""Argument for a slow run; results depend on the time of the run only, so that a busy machine does not affect them."""


def address(system_number: int) -> str:
    """Return an address for an emulated Motive that is not used by others on this machine."""
    return f"127.0.7.{system_number}"


@contextlib.contextmanager
def motive(address: str, folder: Path) -> Iterator[None]:
    """Yield an emulated Motive as on another computer: a process without a ROS master, which uses the wall clock."""
    scene = folder / "scene.yaml"
    motion = {"type": "sinusoid", "centre": [0.7, 0, 0.5], "amplitude": [0, 0.1, 0], "frequency": 0.25}
    scene.write_text(yaml.safe_dump({"bodies": [{"name": "hand", "motion": motion}]}))
    options = ["--scene", str(scene), "--clock", "wall", "--ip", address, "--transport", "unicast", "--duration", "170"]
    server = subprocess.Popen(
        [sys.executable, "-m", "mocap_natnet.server", *options],
        env={**os.environ, "ROS_MASTER_URI": "http://127.0.0.1:9"},
    )
    try:
        yield
    finally:
        server.terminate()
        server.wait(10.0)


def ran(system: LiveSystem, timeout: float, recorded: set[str] = RECORDED) -> dict[str, Any]:
    """Wait for the end of a bring-up, check its output and files, and return its metrics."""
    assert system.wait(timeout) == 0, system.output
    assert system.processes() == {}
    assert "Traceback" not in system.output
    folder = system.run_folder
    assert yaml.safe_load((folder / "run.yaml").read_text())["status"] == "completed"
    assert topics(next(folder.glob("*.bag"))) >= recorded
    assert f"Motive records the take {folder.name}" in system.output, "the take has the name of the run"
    metrics: dict[str, Any] = json.loads((folder / "metrics.json").read_text())
    tracking: dict[str, Any] = metrics["tracking"]
    assert re.search(
        rf"lag {1e3 * tracking['lag']:.1f} ms; after compensation of the lag: "
        rf"RMS error {1e3 * tracking['rms_error']:.2f} mm",
        system.output,
    )
    assert metrics["reflexes"] == 0 or metrics["reflexes"] == []
    return tracking


def check_default_mode(tracking: dict[str, Any], what: str, figure: Figure) -> None:
    """Check the requirements on the default mode."""
    figure(f"marker tracking, {what}: lag", 1e3 * tracking["lag"], "ms")
    figure(f"marker tracking, {what}: RMS error after it", 1e3 * tracking["rms_error"], "mm")
    figure(f"marker tracking, {what}: acceleration beside the marker's", tracking["acceleration"]["ratio"], "1")
    assert tracking["lag"] <= 0.150
    assert tracking["rms_error"] <= 2e-3
    assert tracking["acceleration"]["ratio"] <= 1.5
    assert tracking["losses"] == 0


@pytest.mark.slow
def test_the_simulated_arm_follows_the_marker_and_the_run_reports(start: Start, figure: Figure) -> None:
    system = start("env:=sim", "rviz:=false", "experiment:=marker_tracking", f"mocap_server:={address(1)}", SLOWLY)
    check_default_mode(ran(system, 240.0), "a quarter of real time", figure)


@pytest.mark.live
def test_with_one_argument_a_motive_elsewhere_takes_the_place_of_the_emulated_one(start: Start, tmp_path: Path) -> None:
    with motive(address(9), tmp_path):
        system = start(
            "env:=sim", "rviz:=false", "experiment:=marker_tracking", "mocap:=motive", f"mocap_server:={address(9)}"
        )
        tracking = ran(system, 150.0, {topic for topic in RECORDED if not topic.startswith("/hric/human")})
    assert tracking["lag"] <= 0.150 and tracking["frames"]["received"] > 3000


@pytest.mark.live
def test_at_real_time_the_simulated_arm_follows_the_marker(start: Start, figure: Figure) -> None:
    system = start("env:=sim", "rviz:=false", "experiment:=marker_tracking", f"mocap_server:={address(2)}")
    check_default_mode(ran(system, 180.0), "real time", figure)


@pytest.mark.slow
def test_the_arm_in_opensim_follows_the_marker(start: Start, figure: Figure) -> None:
    system = start(
        "env:=sim",
        "simulator:=opensim",
        "rviz:=false",
        "experiment:=marker_tracking",
        f"mocap_server:={address(3)}",
        SLOWLY,
    )
    check_default_mode(ran(system, 300.0), "OpenSim at a quarter of real time", figure)


@pytest.mark.live
def test_the_arm_behind_the_control_box_follows_the_marker(start: Start, figure: Figure) -> None:
    with control_box() as (ip, _):
        system = start(
            "env:=real", f"robot_ip:={ip}", "rviz:=false", "experiment:=marker_tracking", f"mocap_server:={address(4)}"
        )
        check_default_mode(ran(system, 180.0), "through libfranka at real time", figure)
