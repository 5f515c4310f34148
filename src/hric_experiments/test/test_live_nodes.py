"""Recorder and experiment node with their own ROS master and a simulated interface of a robot."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
from real_master import free_port
from rosbags.highlevel import AnyReader

from hric_bags import reader as bag_reader
from hric_bags.run_folder import RunFolder
from hric_experiments.recorder.process import RecorderProcess, RecordError
from hric_run.definition import experiment as experiments
from hric_run.definition import parameters

HERE = Path(__file__).parent
pytestmark = [pytest.mark.alone, pytest.mark.rostest]
PATIENCE = 60.0
"""Time limit of each step [s]."""

OWN = """
description: three joints that move at once
robot: {hw: fake/Robot}
controllers: [pd]
setpoints:
  - {time: 0.2, controller: pd, positions: [1.0, 0.0, -0.5]}
duration: 2.0
"""

SEEN = """
mocap:
  stream: {rate: 60, transport: unicast, command_port: %d, data_port: %d}
  human: {program: minimum_jerk, points: [[0, 0.5, 0, 0.4], [1, 0.5, 0.2, 0.4]]}
"""


class System:
    """Processes with a ROS master; each is stopped by its process id."""

    def __init__(self, folder: Path, uri: str) -> None:
        self.runs = folder / "runs"
        self.master = ServerProxy(uri)
        self.environment = os.environ | {
            "ROS_MASTER_URI": uri,
            "ROS_IP": "127.0.0.1",
            "ROS_LOG_DIR": str(folder / "log"),
            "HRIC_RUNS": str(self.runs),
            "PYTHONUNBUFFERED": "1",
        }
        self.processes: list[subprocess.Popen[str]] = []

    def until(self, what: Callable[[], bool], timeout: float = PATIENCE) -> None:
        """Wait until a condition is met."""
        deadline = time.monotonic() + timeout
        while not what():
            assert time.monotonic() < deadline, f"not within {timeout} s"
            time.sleep(0.05)

    def knows(self, node: str) -> bool:
        """Return whether a node of this test is registered with the master."""
        return self.master.lookupNode("/test", f"/{node}_{self.runs.parent.name}")[0] == 1  # type: ignore[index]

    def serves(self, service: str) -> bool:
        """Return whether a node provides a service."""
        return self.master.lookupService("/test", service)[0] == 1  # type: ignore[index]

    def start(self, *command: str) -> subprocess.Popen[str]:
        """Start a process."""
        process = subprocess.Popen(
            command,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.processes.append(process)
        return process

    def node(self, name: str, *parameters: str) -> subprocess.Popen[str]:
        """Start a node of this package with a unique name, so that parameters and registrations of other tests do not
        affect it."""
        return self.start(str(HERE.parent / "nodes" / name), f"__name:={name}_{self.runs.parent.name}", *parameters)

    def robot(self) -> subprocess.Popen[str]:
        """Start the simulated robot interface."""
        return self.start(sys.executable, str(HERE / "fake_robot.py"))

    def folder(self) -> RunFolder:
        """Return the run folder as soon as its bag is written."""
        self.until(lambda: bool(list(self.runs.glob("latest/*.bag.active"))))
        return RunFolder.open("latest", self.runs)

    def close(self) -> None:
        """Stop all processes, the newest first."""
        for process in reversed(self.processes):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
                try:
                    process.wait(30)
                except subprocess.TimeoutExpired:
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()
            if process.stdout is not None:
                process.stdout.close()


@pytest.fixture(scope="module")
def uri(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    port = free_port()
    uri = f"http://127.0.0.1:{port}"
    system = System(tmp_path_factory.mktemp("master"), uri)
    try:
        system.start("roscore", "-p", str(port))
        system.until(rosgraph.Master("/test", uri).is_online)
        system.master.setParam("/test", "/use_sim_time", True)
        yield uri
    finally:
        system.close()


@pytest.fixture
def system(tmp_path: Path, uri: str) -> Iterator[System]:
    running = System(tmp_path, uri)
    try:
        yield running
    finally:
        running.close()


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Return exit code and output."""
    output, _ = process.communicate(timeout=PATIENCE)
    return process.returncode, output


def test_an_armed_experiment_waits_for_the_trigger_then_records_reports_and_ends_by_itself(
    system: System, tmp_path: Path
) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(OWN)
    recorder = system.node("recorder", f"_experiment:={path}", "_start:=on_trigger")
    system.robot()
    experiment = system.node("experiment", f"_experiment:={path}", "_armed:=true", "_ready_timeout:=10")
    assert experiment.stdout is not None
    said = ""
    while "waits until the recording is triggered" not in said:
        said = experiment.stdout.readline()
        assert said, "the experiment ended"
    assert not system.runs.exists() and recorder.poll() is None
    system.start("rostopic", "pub", "/hric/experiment/trigger", "std_msgs/Empty")  # latched until the end of the test
    code, output = ended(experiment)
    assert code == 0, output
    assert "final error" in output and "run folder: " in output and "[WARN]" not in output
    folder = RunFolder.open("latest", system.runs)
    run = folder.read()
    assert (run["status"], run["mode"], run["experiment"]) == ("completed", "live", "own")
    assert 1.5 < run["real_time_factor"] < 12.0
    record = bag_reader.read(folder.bag_path)
    assert (record.log.gaps, record.log.repeats) == ((), ())
    assert len(record.setpoints) == 1 and record.log.time[0] < record.setpoints[0].time - 0.15
    assert record.log.time[-1] - record.setpoints[0].time > 1.0
    assert (folder.path / "figures" / "positions.png").is_file() and folder.metrics_path.is_file()


def seen(path: Path, *ports: int) -> list[dict[str, Any]]:
    """Write an experiment with motion capture, and return the parameters of its two nodes."""
    # The hand's end has to be heard before the run's, also where this machine is busy.
    path.write_text(OWN.replace("duration: 2.0", "duration: 4.0") + SEEN % ports)
    described = parameters.mocap(experiments.load(str(path)))
    return [described["natnet_client"] | {"local": "127.0.0.1"}, described["emulated_human"]]


def test_an_experiment_starts_the_human_when_all_receive_the_motion_capture(system: System, tmp_path: Path) -> None:
    path = tmp_path / "seen.yaml"
    ports = free_port(), free_port()
    for (package, name), values in zip(
        (("mocap_natnet", "natnet_client"), ("hric_perception", "emulated_human")), seen(path, *ports), strict=True
    ):
        node = HERE.parents[1] / package / "nodes" / name
        system.start(str(node), *(f"_{key}:={json.dumps(value)}" for key, value in values.items()))
    system.node("recorder", f"_experiment:={path}")
    system.robot()
    code, output = ended(system.node("experiment", f"_experiment:={path}"))
    assert code == 0, output
    assert "the hand starts at" in output
    folder = RunFolder.open("latest", system.runs)
    phases, hand = [], []
    with AnyReader([folder.bag_path]) as reader:
        for connection, _, raw in reader.messages():
            if connection.topic.startswith("/hric/human"):
                message = reader.deserialize(raw, connection.msgtype)
                phases += [message.data] if connection.topic.endswith("phase") else []
                hand += [message.pose.position.y] if connection.topic.endswith("hand") else []
        assert {"/hric/perception/mocap", "/mocap/marker"} <= {connection.topic for connection in reader.connections}
    assert phases == ["rest", "moving", "done"]
    assert hand[0] == 0.0 and hand[-1] == pytest.approx(
        0.2, abs=1e-9
    )  # from its rest on: it began when the recorder heard it


def test_an_experiment_that_sees_nobody_says_so(system: System, tmp_path: Path) -> None:
    path = tmp_path / "seen.yaml"
    seen(path, 1510, 1511)
    system.robot()
    system.until(lambda: system.serves("/controller_manager/list_controllers"))
    code, output = ended(system.node("experiment", f"_experiment:={path}", "_record:=false", "_ready_timeout:=5"))
    assert code == 1 and "Traceback" not in output, output
    assert (
        "motion capture is not ready: no messages on /hric/perception/mocap; is the node natnet_client running?"
        in output
    )


def test_ctrl_c_closes_the_bag_and_leaves_no_process(system: System) -> None:
    recorder = system.node("recorder")
    system.robot()
    folder = system.folder()
    time.sleep(2.0)
    children = [
        int(pid)
        for pid in subprocess.run(
            ["pgrep", "-P", str(recorder.pid)], capture_output=True, text=True, check=False
        ).stdout.split()
    ]
    os.kill(recorder.pid, signal.SIGINT)
    code, output = ended(recorder)
    assert code == 0 and "Traceback" not in output, output
    assert folder.bag_path.is_file() and folder.read()["status"] == "completed"
    assert bag_reader.read(folder.bag_path).log.cycles > 100
    assert all(not Path(f"/proc/{pid}").exists() for pid in children) and children


def test_an_experiment_without_robot_ends_on_ctrl_c_without_traceback(system: System) -> None:
    experiment = system.node("experiment", "_experiment:=pd_step")
    system.until(lambda: system.knows("experiment"))
    time.sleep(0.3)
    os.kill(experiment.pid, signal.SIGINT)
    code, output = ended(experiment)
    assert code == 130 and "Traceback" not in output, output


def test_an_experiment_that_never_becomes_ready_says_what_is_missing(system: System) -> None:
    code, output = ended(system.node("experiment", "_experiment:=pd_step", "_ready_timeout:=0.5"))
    assert code == 1 and "Traceback" not in output, output
    assert "controllers are not running: controller_manager/list_controllers" in output


def test_an_unknown_experiment_is_one_line_with_the_valid_names(system: System) -> None:
    for name in ("recorder", "experiment"):
        code, output = ended(system.node(name, "_experiment:=pdstep"))
        assert code == 2 and "Traceback" not in output, output
        assert (
            "no experiment 'pdstep'" in output
            and "valid: co_transport, contact, data_collection, guided_collection, hand_guidance, handover, " in output
        )


@pytest.mark.parametrize("script", ["exit 3", "sleep 0.1; exit 0"])
def test_a_recording_that_ends_by_itself_is_reported(tmp_path: Path, script: str) -> None:
    process = RecorderProcess(tmp_path / "a.bag", ["sh", "-c", script])
    with pytest.raises(RecordError, match="ended with code"):
        process.wait_open(PATIENCE)


def test_a_recorder_that_does_not_end_is_killed_and_reported(tmp_path: Path) -> None:
    process = RecorderProcess(
        tmp_path / "a.bag", ["sh", "-c", f"trap '' INT; touch {tmp_path}/a.bag.active; while :; do sleep 0.05; done"]
    )
    process.wait_open(PATIENCE)
    with pytest.raises(RecordError, match=r"not closed within 0\.5 s; the recorded messages are in a\.bag\.active"):
        process.stop(0.5)
    assert not process.running
