"""The program `bag_recorder` as a child process: started, watched, and ended so that its bag is whole."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from hric_core.errors import FailureError
from hric_core.processes import describe_exit, start_dependent

STOP_TIMEOUT = 10.0
"""How long the recorder may take to write what it holds and the index [s]."""
_POLL = 0.02


class RecordError(FailureError):
    """The recording cannot start, ended by itself, or did not end in time."""


def find_recorder() -> str:
    """Path of the program that records.

    Raises:
        RecordError: it is not built.
    """
    import roslib.packages

    found: list[str] = roslib.packages.find_node("hric_experiments", "bag_recorder") or []
    if not found:
        raise RecordError("the program bag_recorder of hric_experiments is not built; run scripts/build")
    return found[0]


def arguments(bag: Path, topics: Sequence[str], exclude: str, node_name: str) -> list[str]:
    """Command line of the recorder.

    Args:
        bag: final path of the bag.
        topics: what to record; empty: everything, also what appears later.
        exclude: regular expression of topics to leave out; empty: none.
        node_name: its ROS name, below the namespace of the environment.
    """
    return [str(bag), *(["--exclude", exclude] if exclude else []), *topics, f"__name:={node_name}"]


class RecorderProcess:
    """One recording.

    A Ctrl-C on the terminal does not reach the child before its turn; should this process be killed, or the thread end
    that made this object, the system ends it.

    Args:
        bag: final path of the bag.
        command: program and arguments.

    Attributes:
        bag: path of the bag when it is whole; a closed one may be renamed.
        pid: process id of the child.
    """

    def __init__(self, bag: Path, command: Sequence[str]) -> None:
        self.bag = bag
        # On stdout there is one line per topic; errors come on stderr.
        self._child = start_dependent(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        self.pid = self._child.pid

    @property
    def active(self) -> Path:
        """Where the bag is while it is being written."""
        return self.bag.with_name(self.bag.name + ".active")

    @property
    def running(self) -> bool:
        """Whether the child lives."""
        return self._child.poll() is None

    @property
    def exit_text(self) -> str:
        """Description of how the child ended, for messages."""
        return describe_exit(f"bag_recorder (pid {self.pid})", self._child.returncode or 0)

    def wait_open(self, timeout: float, give_up: Callable[[], bool] = lambda: False) -> None:
        """Wait until the bag is being written.

        Raises:
            RecordError: the child ended, or it takes longer than `timeout` [s].
        """
        deadline = time.monotonic() + timeout
        while not self.active.exists() and not give_up():
            if not self.running:
                raise RecordError(f"{self.exit_text} before it began to record; its messages are above")
            if time.monotonic() > deadline:
                raise RecordError(f"bag_recorder did not open {self.active.name} within {timeout:g} s")
            time.sleep(_POLL)

    def interrupt(self) -> None:
        """Request the child to end; `stop` waits for it."""
        if self.running:
            os.kill(self._child.pid, signal.SIGINT)

    def stop(self, timeout: float = STOP_TIMEOUT) -> Path:
        """End the recording and wait until the bag has its final name; a second call returns the same.

        Raises:
            RecordError: the bag is not whole after `timeout` [s].
        """
        deadline = time.monotonic() + timeout
        self.interrupt()
        while self.running or self.active.exists():
            left = deadline - time.monotonic()
            if left <= 0.0 or (not self.running and left < timeout / 2):
                self._give_up(timeout)
            time.sleep(_POLL)
        if not self.bag.exists():
            raise RecordError(f"{self.exit_text} and left no bag {self.bag.name}")
        return self.bag

    def _give_up(self, timeout: float) -> None:
        if self.running:
            self._child.kill()
            self._child.wait()
        raise RecordError(
            f"the bag was not closed within {round(timeout, 1):g} s; what was recorded is in {self.active.name}, try: "
            "hric health --salvage"
        )
