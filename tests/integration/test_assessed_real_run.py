"""Verdict on a run with an arm through libfranka, motion capture, EMG and a force plate, without a simulated human."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from fci_peer import control_box
from live_system import LiveSystem
from test_data_collection import ran, shortened

from hric_assessment.verdict import command
from hric_core.command import perform

pytestmark = [pytest.mark.alone, pytest.mark.live]

GIVES = {
    "joint angles of a person": "RULA, REBA, the distance to the arm",
    "contacts of a person by region": "contact forces to compare with limits",
    "joint torques of a person": "share of the strength",
    "activation of the muscles": "how active they were",
    "maximum voluntary contraction of each EMG channel": "how active the muscles below them were",
    "objects in the hands": "the effort of the interaction",
}
"""Signals that such a run does not contain, and the results that each would allow."""


def test_a_run_of_the_laboratory_is_assessed_as_far_as_its_signals_go(
    start: Callable[..., LiveSystem], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with control_box() as (ip, _):
        system = start("env:=real", f"robot_ip:={ip}", "rviz:=false", f"experiment:={shortened(tmp_path, 8.0)}")
        sources = ran(system, 300.0)["sources"]
    for sensor in ("/hric/perception/mocap", "/hric/perception/emg/raw", "/hric/perception/force_plate/1/samples"):
        assert sources[sensor]["recorded"] > 0
    assert perform(["assess", str(system.run_folder)]) == 4  # nothing could be held against a limit
    said = capsys.readouterr().out
    verdict = json.loads((system.run_folder / command.FILE).read_text())
    assert verdict["outcome"] == "not assessable" and verdict["person"] is None
    missing = {one["signal"]: one["gives"] for one in verdict["missing"]}
    for signal, gives in GIVES.items():
        (found,) = [text for name, text in missing.items() if signal in name]
        assert gives in found, found
        assert found in said
    # What is there is not said to be missing.
    assert not any("control_log" in name or "description" in name for name in missing)
