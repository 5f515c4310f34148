"""Watchdog that ends this process if its control loop is stuck inside libfranka.

libfranka waits without limit for responses on TCP, and its bindings hold the interpreter's lock meanwhile: if a
control box freezes, no thread and no signal handler of this process runs again. So a child process watches a counter
in shared memory, which the loop increments in each cycle. If the counter stops, the child prints the reason and kills
its parent.
"""

import mmap
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

SIZE = mmap.PAGESIZE
POLL = 0.05
"""Time between two readings of the counter [s]."""


class Watchdog:
    """Watchdog as seen by the process that it watches; the constructor starts the child process.

    Args:
        timeout: maximum time without a cycle of the loop; then this process is killed [s].
        patience: maximum duration of a call within `patiently` [s].
        what: name of the arm, for the message.
    """

    def __init__(self, timeout: float, patience: float, what: str) -> None:
        descriptor = os.memfd_create("franka_real_watchdog")
        try:
            os.truncate(descriptor, SIZE)
            self._memory = mmap.mmap(descriptor, SIZE)
            command = [sys.executable, "-S", "-E", __file__, str(descriptor), str(os.getpid()), what]
            # A separate session, so that Ctrl-C in the terminal does not reach it. It ends with its parent.
            self._child = subprocess.Popen(
                command, pass_fds=[descriptor], stdin=subprocess.DEVNULL, start_new_session=True
            )
        finally:
            os.close(descriptor)
        self._words = memoryview(self._memory).cast("Q")  # counter, allowed silence [ms] (0: not watched)
        self._limits = round(1e3 * timeout), round(1e3 * patience)

    @property
    def pid(self) -> int:
        """Process id of the child process that watches."""
        return self._child.pid

    def beat(self) -> None:
        """Report that the loop is alive; call this in each cycle."""
        self._words[0] += 1

    def arm(self) -> None:
        """Start watching."""
        self._words[0] += 1
        self._words[1] = self._limits[0]

    def disarm(self) -> None:
        """Stop watching, because the loop is not running."""
        self._words[1] = 0

    @contextmanager
    def patiently(self, limit: float | None = None) -> Iterator[None]:
        """Allow the calls in this context to take up to `limit` [s]; None: up to the constructor's `patience`."""
        words, before = self._words, self._words[1]
        words[0] += 1
        words[1] = self._limits[1] if limit is None else round(1e3 * limit)
        try:
            yield
        finally:
            words[0] += 1
            words[1] = before

    def close(self) -> None:
        """End the child process."""
        self._words[1] = 0
        self._child.kill()
        self._child.wait()


def watch(descriptor: int, parent: int, what: str) -> None:
    """Watch the counter, in the child process, until the parent ends or has to be killed.

    Args:
        descriptor: file descriptor of the shared memory.
        parent: process id of the parent.
        what: name of the arm, for the message.
    """
    words = memoryview(mmap.mmap(descriptor, SIZE)).cast("Q")
    last, since = (words[0], words[1]), time.monotonic()
    while os.getppid() == parent:
        time.sleep(POLL)
        now = (words[0], words[1])
        if now != last or now[1] == 0:
            last, since = now, time.monotonic()
        elif time.monotonic() - since > 1e-3 * now[1]:
            text = (
                f"{what} has not responded for {1e-3 * now[1]:g} s and libfranka cannot be interrupted: the robot "
                f"process (pid {parent}) is killed. Check the control box, then restart."
            )
            print(f"[FATAL] {text}", file=sys.stderr, flush=True)
            os.kill(parent, signal.SIGKILL)
            return


if __name__ == "__main__":
    watch(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
