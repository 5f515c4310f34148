"""End of a bring-up.

Before the nodes are started, the process ends at once. Later all nodes are requested to end, and the process waits for
them and prints its progress.
"""

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
"""File descriptor of the real standard error: scripts/bringup hides standard error until this module is loaded."""
LOOK = 0.05
"""Period at which EndAtOnce checks whether it is still needed [s]."""
LIMIT = 10.0
"""Time for a node to end before it is killed [s of wall time] (project default, unconfirmed)."""
LONGER = {"recorder": 120.0, "experiment": 120.0}
"""Time to end for nodes that write data, such as a bag of gigabytes on a slow disk [s of wall time]."""
PROGRESS_AFTER, PROGRESS_PERIOD = 1.0, 2.0
"""Time until the first progress message about nodes that have not ended, and between two messages [s]."""


class EndAtOnce(threading.Thread):
    """Thread that ends this process silently on a shutdown request (Ctrl-C, SIGTERM, SIGHUP) before the nodes start.

    In this phase, child processes compute parameters. They would also receive Ctrl-C from the terminal, and a Python
    process that is still starting would print a traceback. So the signals are blocked, also in the child processes,
    which inherit the mask. This thread waits for the signals and kills the child processes.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._over = threading.Event()
        signal.pthread_sigmask(signal.SIG_BLOCK, REQUESTS)
        os.dup2(ERRORS, sys.stderr.fileno())
        os.close(ERRORS)
        self.start()

    def run(self) -> None:
        """Wait for a shutdown request, and end the process."""
        while not self._over.is_set():
            if signal.sigtimedwait(REQUESTS, LOOK) is not None:
                for child in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
                    with contextlib.suppress(ProcessLookupError, ChildProcessError):
                        os.kill(int(child), signal.SIGKILL)
                        os.waitid(os.P_PID, int(child), os.WEXITED | os.WNOWAIT)
                os._exit(INTERRUPTED)  # at once: the main thread would report the command's end

    def over(self) -> None:
        """End the thread and unblock the signals: from now on requests reach their handlers, including pending ones."""
        self._over.set()
        self.join()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, REQUESTS)


def end_nodes(monitor: Any, impatient: Callable[[], bool]) -> None:
    """End all nodes, the newest first; kill those that do not end, with a message.

    Args:
        monitor: process monitor of roslaunch; the nodes are unregistered from it.
        impatient: function that returns True if the user requests to kill the nodes at once.
    """
    with monitor.plock:
        nodes = [process for process in monitor.procs if process not in monitor.core_procs]
    for process in nodes:
        monitor.unregister(process)
    alive = [process for process in reversed(nodes) if process.popen is not None]
    for process in alive:
        # SIGTERM: on SIGINT, a node that is still importing modules would print a traceback. Nodes handle both alike.
        _signal(process, signal.SIGTERM)
        _signal(process, signal.SIGCONT)  # a node that was stopped (Ctrl-Z, SIGSTOP) can end, and closes its bag
    _wait(alive, impatient)


def _wait(alive: Sequence[Any], impatient: Callable[[], bool]) -> None:
    began = time.monotonic()
    due = began + PROGRESS_AFTER
    killed = set[str]()
    while alive := [process for process in alive if process.popen.poll() is None]:
        now = time.monotonic()
        for process in alive:
            overdue = now - began > LONGER.get(_name(process), LIMIT)
            if process.name not in killed and (overdue or impatient()):
                killed.add(process.name)
                _signal(process, signal.SIGKILL)
                reason = "at your request" if impatient() else f"after {now - began:.0f} s"
                lost = "; close its bag by: hric health --salvage"
                _say(f"killed {_name(process)} {reason}" + (lost if _name(process) == "recorder" else ""))
        if now >= due:
            due = now + PROGRESS_PERIOD
            _say(f"ending: waiting for {', '.join(map(_name, alive))} ({now - began:.0f} s; Ctrl-C again kills them)")
        time.sleep(0.02)


def _name(process: Any) -> str:
    """Return the node name of a process, which roslaunch names NAMESPACE/NODE-NUMBER."""
    name: str = process.name.rpartition("-")[0]
    return name.rpartition("/")[2]


def _signal(process: Any, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.popen.pid, number)


def _say(text: str) -> None:
    print(f"scripts/bringup: {text}", file=sys.stderr, flush=True)
