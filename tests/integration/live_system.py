"""Bring-up for integration tests, in a separate process with a separate ROS master, as a user starts it."""

import os
import signal
import subprocess
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO
from unittest import mock

import rosgraph
import rospy
from bringup_master import free_port

from controller_manager_msgs.srv import ListControllers

ROOT = Path(__file__).resolve().parents[2]
MARK = "HRIC_TEST_SYSTEM"
READY_TIMEOUT = 180.0
"""Timeout for the first start on a busy machine [s of wall time]."""
LAST_SERVICES = {"/recorder_bag/get_loggers", "/recorder_bag/set_logger_level"}


def wait_for(condition: Callable[[], object], timeout: float, what: str) -> float:
    """Wait until `condition()` is true; return the duration [s of wall time].

    Raises:
        AssertionError: the condition was not true within `timeout`.
    """
    started = time.monotonic()
    while not condition():
        assert time.monotonic() - started < timeout, f"after {timeout:g} s still not: {what}"
        time.sleep(0.05)
    return time.monotonic() - started


class LiveSystem:
    """Running `scripts/bringup`, with its output in a file, and its processes marked so that remaining ones are found.

    Args:
        folder: folder for output and runs.
        arguments: arguments of the command line.
        program: program to start instead of `scripts/bringup`.
        environment: additional variables.
    """

    def __init__(
        self, folder: Path, *arguments: str, program: str = f"{ROOT}/scripts/bringup", **environment: str
    ) -> None:
        self.mark = uuid.uuid4().hex
        self.uri = f"http://localhost:{free_port()}"
        self.runs = folder / "runs"
        self.output_path = folder / "output.txt"
        self.environment = {
            **{key: value for key, value in os.environ.items() if key != "DISPLAY"},
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": "127.0.0.1",
            "HRIC_RUNS": str(self.runs),
            "ROS_HOME": str(folder / "ros"),
            MARK: self.mark,
            **environment,
        }
        with self.output_path.open("w") as output:
            self.process = subprocess.Popen(
                [program, *arguments],
                env=self.environment,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    @property
    def output(self) -> str:
        """Output so far."""
        return self.output_path.read_text(errors="replace")

    def run(self, *command: str, timeout: float = 30.0) -> subprocess.CompletedProcess[str]:
        """Run a command as in another terminal, on the master of this bring-up."""
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=timeout, cwd=ROOT)

    @contextmanager
    def started(self, *command: str, output: IO[str] | int = subprocess.DEVNULL) -> Iterator[subprocess.Popen[bytes]]:
        """Start a command as in another terminal; it is ended after the `with` block at the latest."""
        # rosrun replaces itself by the program, so that the signal reaches the program.
        process = subprocess.Popen(command, env=self.environment, stdout=output, stderr=subprocess.STDOUT, cwd=ROOT)
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()

    @contextmanager
    def following(self, topic: str) -> Iterator[Callable[[], list[float]]]:
        """Yield a function that returns the numbers of the newest message on a topic, or on a field of a topic.

        It returns no numbers before the first message. One `rostopic echo` runs in the whole `with` block, as each
        start of the tool takes a second of processor time.
        """
        path = self.output_path.with_name(f"{topic.strip('/').replace('/', '-')}.csv")

        def newest() -> list[float]:
            lines = path.read_text().rpartition("\n")[0].splitlines()[1:]
            return [float(number) for number in lines[-1].split(",")[1:]] if lines else []

        with path.open("w") as output, self.started("rostopic", "echo", "-p", topic, output=output):
            yield newest

    @contextmanager
    def published(self, topic: str, kind: str, text: str) -> Iterator[None]:
        """Publish a message as in another terminal, latched until the end of the `with` block.

        `rostopic pub -1` waits 3 s for subscribers and drops the message if a busy machine needs longer.
        """
        with self.started("rostopic", "pub", topic, kind, text):
            yield

    def wait_output(self, text: str, timeout: float = READY_TIMEOUT) -> None:
        """Wait until `text` is in the output."""

        def seen() -> bool:
            assert self.process.poll() is None or text in self.output, (
                f"ended with {self.process.returncode} before saying {text!r}:\n{self.output}"
            )
            return text in self.output

        wait_for(seen, timeout, f"output {text!r} in\n{self.output}")

    def controllers(self, namespace: str = "") -> dict[str, str]:
        """Return the state of each controller; empty while the controller manager does not respond.

        This process sends the request, since a process per request would slow down the start of the system.
        """
        with mock.patch.dict(os.environ, ROS_MASTER_URI=self.uri):
            try:
                answer = rospy.ServiceProxy(f"{namespace}/controller_manager/list_controllers", ListControllers)()
            except rospy.ServiceException:
                return {}
        return {controller.name: controller.state for controller in answer.controller}

    def services(self) -> set[str]:
        """Return the services of its nodes, without nodes with random names; empty while there is no master.

        This process asks the master: a run of 6 s may be over before `rosservice list` has started on a busy machine.
        """
        try:
            listed = [name for name, _ in rosgraph.Master("/test", master_uri=self.uri).getSystemState()[2]]
        except OSError:
            return set()
        return {
            name
            for name in listed
            if "anonymous" not in name and not name.startswith(("/rostopic", "/rosservice", "/play_", "/record_"))
        }

    def services_of_a_run(self) -> set[str]:
        """Return the services during an experiment, when those of its last node, the recorder, exist."""
        self.wait_output("setpoints")
        services: set[str] = set()

        def complete() -> bool:  # a second look could fall into the end of the run
            nonlocal services
            services = self.services()
            return services >= LAST_SERVICES

        wait_for(complete, READY_TIMEOUT, f"{LAST_SERVICES}; output:\n{self.output}")
        return services

    def wait_running(self, *controllers: str, namespace: str = "") -> None:
        """Wait until these controllers are running."""

        def running() -> bool:
            assert self.process.poll() is None, f"ended with {self.process.returncode}:\n{self.output}"
            states = self.controllers(namespace)
            return all(states.get(name) == "running" for name in controllers)

        wait_for(running, READY_TIMEOUT, f"running {controllers}; output:\n{self.output}")

    def interrupt(self) -> float:
        """Send Ctrl-C to the process group, as a terminal does; return the duration of the shutdown [s wall time]."""
        started = time.monotonic()
        os.killpg(self.process.pid, signal.SIGINT)
        self.process.wait(timeout=30.0)
        return time.monotonic() - started

    def wait(self, timeout: float) -> int:
        """Wait for the end and return the exit code."""
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"still running after {timeout:g} s:\n{self.output}") from None

    def processes(self) -> dict[int, str]:
        """Return the command lines of the living processes of this system by pid."""
        found = {}
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                environment, command = (entry / "environ").read_bytes(), (entry / "cmdline").read_bytes()
            except OSError:
                continue
            if f"{MARK}={self.mark}".encode() in environment and command:
                found[int(entry.name)] = command.replace(b"\0", b" ").decode(errors="replace")
        return found

    def close(self) -> None:
        """End all processes of the system."""
        if self.process.poll() is None:
            self.interrupt()
        for pid in self.processes():
            os.kill(pid, signal.SIGKILL)

    @property
    def run_folder(self) -> Path:
        """Return the folder of the newest run."""
        return (self.runs / "latest").resolve()


@dataclass(frozen=True)
class PdStep:
    """A bring-up with the experiment pd_step on PyBullet.

    Attributes:
        system: the bring-up, which has ended by itself, or should have.
        services: services that it offered while it ran.
    """

    system: LiveSystem
    services: set[str]
