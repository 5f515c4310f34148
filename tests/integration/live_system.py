"""A bring-up as a user starts it, in a process of its own on a ROS master of its own; used by the integration tests."""

import os
import signal
import subprocess
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import rospy
from bringup_master import free_port

from controller_manager_msgs.srv import ListControllers

ROOT = Path(__file__).resolve().parents[2]
MARK = "HRIC_TEST_SYSTEM"
READY_TIMEOUT = 60.0
"""For the first start on a busy machine [s of wall time]."""
LAST_SERVICES = {"/recorder_bag/get_loggers", "/recorder_bag/set_logger_level"}


def wait_for(condition: Callable[[], object], timeout: float, what: str) -> float:
    """Wait until `condition()` holds; answers how long it took [s of wall time].

    Raises:
        AssertionError: it did not in `timeout`.
    """
    started = time.monotonic()
    while not condition():
        assert time.monotonic() - started < timeout, f"after {timeout:g} s still not: {what}"
        time.sleep(0.05)
    return time.monotonic() - started


class LiveSystem:
    """`scripts/bringup` with arguments, its output in a file, its processes marked so that a leftover is found.

    Args:
        folder: for output and runs.
        arguments: as on the command line.
        program: in place of `scripts/bringup`.
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
        """What was printed so far."""
        return self.output_path.read_text(errors="replace")

    def run(self, *command: str, timeout: float = 30.0) -> subprocess.CompletedProcess[str]:
        """A command in another terminal, on this system's master."""
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=timeout, cwd=ROOT)

    @contextmanager
    def started(self, *command: str) -> Iterator[subprocess.Popen[bytes]]:
        """A command that stays, in another terminal; its program is ended at the latest with the block."""
        # rosrun replaces itself by the program, so the signal reaches it.
        process = subprocess.Popen(
            command, env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT, cwd=ROOT
        )
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()

    def wait_output(self, text: str, timeout: float = READY_TIMEOUT) -> None:
        """Wait until `text` was printed."""

        def seen() -> bool:
            assert self.process.poll() is None or text in self.output, (
                f"ended with {self.process.returncode} before saying {text!r}:\n{self.output}"
            )
            return text in self.output

        wait_for(seen, timeout, f"output {text!r} in\n{self.output}")

    def controllers(self, namespace: str = "") -> dict[str, str]:
        """State of each controller; none while nobody answers. Asked by this process: one per question would take what
        the system starts with."""
        with mock.patch.dict(os.environ, ROS_MASTER_URI=self.uri):
            try:
                answer = rospy.ServiceProxy(f"{namespace}/controller_manager/list_controllers", ListControllers)()
            except rospy.ServiceException:
                return {}
        return {controller.name: controller.state for controller in answer.controller}

    def services(self) -> set[str]:
        """Services that its nodes offer; nodes whose names are random, such as rostopic's, come and go."""
        listed = self.run("rosservice", "list").stdout.split()
        return {
            name
            for name in listed
            if "anonymous" not in name and not name.startswith(("/rostopic", "/rosservice", "/play_", "/record_"))
        }

    def services_of_a_run(self) -> set[str]:
        """Services while an experiment runs, once those of its last node, which writes the bag, are there."""
        self.wait_output("setpoints")
        services: set[str] = set()

        def complete() -> bool:  # a second look could fall into the end of the run
            nonlocal services
            services = self.services()
            return services >= LAST_SERVICES

        wait_for(complete, READY_TIMEOUT, f"{LAST_SERVICES}; output:\n{self.output}")
        return services

    def wait_running(self, *controllers: str, namespace: str = "") -> None:
        """Wait until these controllers run."""

        def running() -> bool:
            assert self.process.poll() is None, f"ended with {self.process.returncode}:\n{self.output}"
            states = self.controllers(namespace)
            return all(states.get(name) == "running" for name in controllers)

        wait_for(running, READY_TIMEOUT, f"running {controllers}; output:\n{self.output}")

    def interrupt(self) -> float:
        """Ctrl-C, which a terminal sends to the whole group; answers how long the end took [s of wall time]."""
        started = time.monotonic()
        os.killpg(self.process.pid, signal.SIGINT)
        self.process.wait(timeout=30.0)
        return time.monotonic() - started

    def wait(self, timeout: float) -> int:
        """Wait for the end; answers the exit code."""
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"still running after {timeout:g} s:\n{self.output}") from None

    def processes(self) -> dict[int, str]:
        """Processes of this system that are alive: pid -> command line."""
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
        """End it, whatever state it is in."""
        if self.process.poll() is None:
            self.interrupt()
        for pid in self.processes():
            os.kill(pid, signal.SIGKILL)

    @property
    def run_folder(self) -> Path:
        """Folder of the newest run."""
        return (self.runs / "latest").resolve()


@dataclass(frozen=True)
class PdStep:
    """A bring-up with the experiment pd_step on PyBullet.

    Attributes:
        system: which has ended by itself, or should have.
        services: that it offered while it ran.
    """

    system: LiveSystem
    services: set[str]
