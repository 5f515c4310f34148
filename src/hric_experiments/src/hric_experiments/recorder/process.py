"""Control of the child process `bag_recorder`: start, monitoring, and stop with a complete bag."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from hric_core.errors import FailureError
from hric_core.processes import describe_exit, start_dependent

STOP_TIMEOUT = 10.0
"""Maximum time for bag_recorder to write its buffer and the index of the bag [s]."""
_POLL = 0.02


class RecordError(FailureError):
    """Error: the recording could not start, ended by itself, or did not end in time."""


def find_recorder() -> str:
    """Return the path of the program `bag_recorder`.

    Raises:
        RecordError: the program has not been built.
    """
    import roslib.packages

    paths: list[str] = roslib.packages.find_node("hric_experiments", "bag_recorder") or []
    if not paths:
        raise RecordError("the program bag_recorder of hric_experiments is not built; run scripts/build")
    return paths[0]


def arguments(bag: Path, topics: Sequence[str], exclude: str, node_name: str) -> list[str]:
    """Return the command-line arguments of bag_recorder.

    Args:
        bag: final path of the bag.
        topics: topics to record; empty: all, including topics that appear later.
        exclude: regular expression of topics that are not recorded; empty: none.
        node_name: ROS node name of bag_recorder, relative to the namespace of the environment.
    """
    return [str(bag), *(["--exclude", exclude] if exclude else []), *topics, f"__name:={node_name}"]


class RecorderProcess:
    """Child process `bag_recorder` that writes one bag.

    Ctrl-C on the terminal does not reach the child process; `stop` ends it. The operating system ends it if this
    process is killed or the thread that created this object ends.

    Args:
        bag: final path of the bag.
        command: program and arguments.

    Attributes:
        bag: final path of the bag; changed if the closed bag is renamed.
        pid: process id of the child.
    """

    def __init__(self, bag: Path, command: Sequence[str]) -> None:
        self.bag = bag
        # stdout is discarded: it has one line per topic. Errors appear on stderr.
        self._child = start_dependent(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        self.pid = self._child.pid

    @property
    def active(self) -> Path:
        """Path of the bag while bag_recorder writes it."""
        return self.bag.with_name(self.bag.name + ".active")

    @property
    def running(self) -> bool:
        """True if the child process is running."""
        return self._child.poll() is None

    @property
    def exit_text(self) -> str:
        """Text that says how the child process exited, for messages."""
        return describe_exit(f"bag_recorder (pid {self.pid})", self._child.returncode or 0)

    def wait_open(self, timeout: float, give_up: Callable[[], bool] = lambda: False) -> None:
        """Wait until the child process has opened the bag.

        Args:
            timeout: maximum waiting time [s].
            give_up: function that returns True to end the wait early.

        Raises:
            RecordError: the child process exited, or the timeout has passed.
        """
        deadline = time.monotonic() + timeout
        while not self.active.exists() and not give_up():
            if not self.running:
                raise RecordError(f"{self.exit_text} before it began to record; see its messages above")
            if time.monotonic() > deadline:
                raise RecordError(f"bag_recorder did not open {self.active.name} within {timeout:g} s")
            time.sleep(_POLL)

    def interrupt(self) -> None:
        """Send SIGINT to the child process; `stop` waits for its end."""
        if self.running:
            os.kill(self._child.pid, signal.SIGINT)

    def stop(self, timeout: float = STOP_TIMEOUT) -> Path:
        """End the recording, wait until the bag has its final name, return its path; repeated calls are allowed.

        Raises:
            RecordError: the bag is not complete after `timeout` [s].
        """
        deadline = time.monotonic() + timeout
        self.interrupt()
        while self.running or self.active.exists():
            left = deadline - time.monotonic()
            if left <= 0.0 or (not self.running and left < timeout / 2):
                self._give_up(timeout)
            time.sleep(_POLL)
        if not self.bag.exists():
            raise RecordError(f"{self.exit_text} and there is no bag {self.bag.name}")
        return self.bag

    def _give_up(self, timeout: float) -> None:
        if self.running:
            self._child.kill()
            self._child.wait()
        raise RecordError(
            f"the bag was not closed within {round(timeout, 1):g} s; the recorded messages are in {self.active.name}; "
            "recover them with: hric health --salvage"
        )
