"""A node, the recorder, its program or the master is killed while a bring-up records: the bring-up ends with nothing
left behind, and run.yaml says what died."""

import os
import re
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from live_system import LiveSystem, wait_for

pytestmark = pytest.mark.alone
Start = Callable[..., LiveSystem]

ENDS = 60.0
"""A bring-up that is stuck is not over by then [s]."""


def kill(system: LiveSystem, program: str) -> None:
    """End one process of a bring-up by SIGKILL."""
    pids = [pid for pid, command in system.processes().items() if re.search(program, command)]
    assert len(pids) == 1, system.processes()
    os.kill(pids[0], signal.SIGKILL)


@pytest.mark.parametrize(
    ("program", "status", "why"),
    [
        (r"/robot ", "failed", r"robot was killed by SIGKILL"),
        (r"/recorder ", "interrupted", r"recorder was killed by SIGKILL"),
        (r"/bag_recorder ", "failed", r"bag_recorder \(pid \d+\) was killed by SIGKILL"),
        (r"rosmaster ", "failed", r"the ROS master at http://\S+ does not respond"),
    ],
    ids=["robot", "recorder", "bag_recorder", "master"],
)
def test_what_was_killed_is_in_run_yaml_and_nothing_outlives_the_bring_up(
    program: str, status: str, why: str, start: Start
) -> None:
    system = start("env:=sim", "rviz:=false", "record:=true", "controller:=none", "hand:=false")
    system.wait_output("  ready ")
    folder: Path = system.run_folder
    kill(system, program)
    assert system.wait(ENDS) not in (0, 2)
    wait_for(lambda: system.processes() == {}, 10.0, "the end of all processes")
    run: dict[str, Any] = yaml.safe_load((folder / "run.yaml").read_text())
    assert run["status"] == status and re.search(why, run.get("error") or run["reason"]), run
    assert run["finished"] and "Traceback" not in system.output, system.output
