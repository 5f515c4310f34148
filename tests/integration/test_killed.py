"""Bring-up while a node, the recorder, its program or the master is killed: it ends completely.

No process remains, and run.yaml has the killed process.
"""

import os
import re
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import yaml
from live_system import ROOT, LiveSystem, wait_for

from hric_bags.run_folder import RunFolder

pytestmark = pytest.mark.alone
Start = Callable[..., LiveSystem]

ENDS = 60.0
"""Timeout for the end of a bring-up [s]."""


def send(system: LiveSystem, program: str, number: signal.Signals) -> None:
    """Send a signal to one process of a bring-up."""
    pids = [pid for pid, command in system.processes().items() if re.search(program, command)]
    assert len(pids) == 1, system.processes()
    os.kill(pids[0], number)


KILLED = {
    "robot": (r"/robot ", "failed", r"robot was killed by SIGKILL"),
    "recorder": (r"/recorder ", "interrupted", r"recorder was killed by SIGKILL"),
    "bag_recorder": (r"/bag_recorder ", "failed", r"bag_recorder \(pid \d+\) was killed by SIGKILL"),
    "namespaced": (r"/robot ", "failed", r"robot was killed by SIGKILL"),
    "master": (r"rosmaster ", "failed", r"the ROS master at http://\S+ does not respond"),
}
"""Process that is killed, status of the run, and reason in run.yaml."""


STOPPED = {
    "robot": (r"/robot ", r"experiment ended with code 1"),
    "bag_recorder": (
        r"/bag_recorder ",
        r"the bag was not closed within 10 s; the recorded messages are in \S+\.active",
    ),
    "recorder": (r"/recorder ", r"experiment ended with code 1|recorder"),
}
"""Process that is stopped during an experiment, and reason in run.yaml."""
TOGETHER = 2
"""Number of bring-ups at the same time; they mostly wait for timeouts."""


def run_killed(name: str, folder: Path) -> LiveSystem:
    """Return an ended bring-up of which a process was killed."""
    words = ("env:=sim", "rviz:=false", "record:=true", "controller:=none", "hand:=false")
    with closing(LiveSystem(folder, *words, *["ns:=cell"] * (name == "namespaced"))) as system:
        system.wait_output("  ready ")
        send(system, KILLED[name][0], signal.SIGKILL)
        system.wait(ENDS)
        wait_for(lambda: system.processes() == {}, 10.0, "the end of all processes")
    return system


def run_stopped(name: str, folder: Path) -> LiveSystem:
    """Return an ended bring-up with an experiment, of which a process was stopped."""
    content = yaml.safe_load((ROOT / "src/hric_experiments/config/experiments/pd_step.yaml").read_text())
    file = folder / "short.yaml"
    file.write_text(yaml.safe_dump(content | {"duration": 3.0}))
    with closing(LiveSystem(folder, "env:=sim", "rviz:=false", f"experiment:={file}")) as system:
        system.wait_output("setpoints")
        send(system, STOPPED[name][0], signal.SIGSTOP)
        system.wait(3.0 * ENDS)
        wait_for(lambda: system.processes() == {}, 10.0, "the end of all processes")
    return system


@pytest.fixture(scope="module")
def ended(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[str, str], LiveSystem]]:
    """Return a function that returns the bring-up of a process and of what happens to it: "stopped" or "killed"."""
    items = [item for item in request.session.items if item.path == Path(__file__) and hasattr(item, "callspec")]
    cases = [next(iter(item.callspec.params.items())) for item in items]
    with ThreadPoolExecutor(TOGETHER) as pool:
        futures = {
            case: pool.submit(
                run_stopped if case[0] == "stopped" else run_killed, case[1], tmp_path_factory.mktemp(case[1])
            )
            for case in cases
        }
        yield lambda *case: futures[case].result()


@pytest.mark.parametrize(
    "stopped", [pytest.param(name, marks=[pytest.mark.slow] * (name == "recorder")) for name in STOPPED]
)
def test_a_peer_that_is_stopped_ends_the_experiment_with_one_line_and_a_failed_run(
    stopped: str, ended: Callable[[str, str], LiveSystem]
) -> None:
    system, (_, why) = ended("stopped", stopped), STOPPED[stopped]
    assert system.process.returncode == 1
    run = RunFolder(system.run_folder).read()
    assert run["status"] in ("failed", "interrupted") and re.search(why, run.get("error") or run["reason"]), run
    assert "Traceback" not in system.output, system.output
    if stopped == "recorder":  # it continues at the end, and closes its bag
        assert len([*system.run_folder.glob("*.bag")]) == 1


@pytest.mark.parametrize("killed", KILLED)
def test_what_was_killed_is_in_run_yaml_and_nothing_outlives_the_bring_up(
    killed: str, ended: Callable[[str, str], LiveSystem]
) -> None:
    system, (_, status, why) = ended("killed", killed), KILLED[killed]
    assert system.process.returncode not in (0, 2)
    run: dict[str, Any] = yaml.safe_load((system.run_folder / "run.yaml").read_text())
    assert run["status"] == status and re.search(why, run.get("error") or run["reason"]), run
    assert run["finished"] and "Traceback" not in system.output, system.output


def test_nothing_outlives_a_bring_up_that_is_killed(start: Start) -> None:
    system = start("env:=sim", "rviz:=false", "controller:=none", "hand:=false")
    system.wait_output("  ready ")
    assert len(system.processes()) > 5
    os.kill(system.process.pid, signal.SIGKILL)
    system.process.wait()
    wait_for(lambda: system.processes() == {}, ENDS, "the end of all processes")
    assert "Traceback" not in system.output, system.output


def test_nodes_end_with_a_roslaunch_that_is_killed(start: Start) -> None:
    file = f"{ROOT}/src/hric_bringup/launch/bringup.launch"
    system = start(
        file, "env:=sim", "rviz:=false", "controller:=none", program="/usr/bin/roslaunch", PYTHONUNBUFFERED="1"
    )
    wait_for(lambda: "running" in system.output, ENDS, "the robot")
    os.kill(system.process.pid, signal.SIGKILL)
    system.process.wait()
    ours = f"{ROOT}/"
    wait_for(
        lambda: not [line for line in system.processes().values() if ours in line and "__log:=" in line],
        ENDS,
        "the end of all nodes of the workspace",
    )
