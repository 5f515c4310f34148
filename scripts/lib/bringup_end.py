"""End of a bring-up: at once before a node runs; later all nodes are requested to end, and waited for.

Each gets the time that it needs, with progress."""

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

REQUESTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
INTERRUPTED = 130
ERRORS = 3
"""File descriptor to which scripts/bringup redirects the errors of this process until it can take a request."""
LOOK = 0.05
"""Period at which the thread checks for the end of the early part [s]."""
LIMIT = 10.0
"""Longest end of a node before it is killed [s of wall time] (project default, unconfirmed)."""
LONGER = {"recorder": 120.0, "experiment": 120.0}
"""Longest end of nodes that write data: a bag of gigabytes on a slow disk [s of wall time]."""
PROGRESS_AFTER, PROGRESS_PERIOD = 1.0, 2.0
"""Time to the first line about nodes that are waited for, and between two of them [s]."""


class EndAtOnce(threading.Thread):
    """Thread that ends this process silently on a request before the nodes start.

    Commands that read parameters run meanwhile. They get Ctrl-C in a terminal, too, and a Python that still starts
    would end with a traceback: so requests are blocked here, which the commands inherit, and a thread takes them and
    ends the commands.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._over = threading.Event()
        signal.pthread_sigmask(signal.SIG_BLOCK, REQUESTS)
        os.dup2(ERRORS, sys.stderr.fileno())
        os.close(ERRORS)
        self.start()

    def run(self) -> None:
        """Wait for a request."""
        while not self._over.is_set():
            if signal.sigtimedwait(REQUESTS, LOOK) is not None:
                for child in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(int(child), signal.SIGKILL)
                os._exit(INTERRUPTED)  # at once: the main thread would report the command's end

    def over(self) -> None:
        """Let requests go to their handlers from now on, including those that have just come."""
        self._over.set()
        self.join()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, REQUESTS)


def end_nodes(monitor: Any, impatient: Callable[[], bool]) -> None:
    """End all nodes, the newest first; kill those that do not end, with a message.

    Args:
        monitor: roslaunch's process monitor, which no longer watches them.
        impatient: returns True if the user requests the end at once.
    """
    with monitor.plock:
        nodes = [process for process in monitor.procs if process not in monitor.core_procs]
    for process in nodes:
        monitor.unregister(process)
    alive = [process for process in reversed(nodes) if process.popen is not None]
    for process in alive:
        # SIGTERM, as a node that is still importing would print a traceback on SIGINT; nodes treat both alike.
        _signal(process, signal.SIGTERM)
    _wait(alive, impatient)


def _wait(alive: Sequence[Any], impatient: Callable[[], bool]) -> None:
    began = time.monotonic()
    due = began + PROGRESS_AFTER
    while alive := [process for process in alive if process.popen.poll() is None]:
        now = time.monotonic()
        for process in alive:
            if impatient() or now - began > LONGER.get(_name(process), LIMIT):
                _signal(process, signal.SIGKILL)
                reason = "at your request" if impatient() else f"after {now - began:.0f} s"
                lost = "; its bag is closed by: hric health --salvage"
                _say(f"killed {_name(process)} {reason}" + (lost if _name(process) == "recorder" else ""))
        if now >= due:
            due = now + PROGRESS_PERIOD
            _say(f"ending: waiting for {', '.join(map(_name, alive))} ({now - began:.0f} s; Ctrl-C again: at once)")
        time.sleep(0.02)


def _name(process: Any) -> str:
    """Return the name of the node; roslaunch calls the process NODE-NUMBER, with the namespace before it."""
    name: str = process.name.rpartition("-")[0]
    return name.rpartition("-")[2]


def _signal(process: Any, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.popen.pid, number)


def _say(text: str) -> None:
    print(f"scripts/bringup: {text}", file=sys.stderr, flush=True)
