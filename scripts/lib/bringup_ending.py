"""How a bring-up ends: all nodes are requested to end at once, and get the time that they need, with progress."""

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

LIMIT = 10.0
"""How long a node may take to end before it is killed [s of wall time]; project default, unconfirmed."""
LONGER = {"recorder": 120.0, "experiment": 120.0}
"""Of nodes that write data: a bag of gigabytes on a slow disk."""
TELL_AFTER, TELL_EVERY = 1.0, 2.0
"""Progress is told after and every [s]."""


def end_nodes(monitor: Any, impatient: Callable[[], bool]) -> None:
    """End all nodes, the newest first requested; those that do not end are killed, which is told.

    Args:
        monitor: roslaunch's, which no longer looks after them.
        impatient: whether the user wants the end now.
    """
    with monitor.plock:
        nodes = [process for process in monitor.procs if process not in monitor.core_procs]
    for process in nodes:
        monitor.unregister(process)
    alive = [process for process in reversed(nodes) if process.popen is not None]
    for process in alive:
        # SIGTERM, since one that still imports what it needs would take SIGINT with a traceback; nodes take both alike.
        _signal(process, signal.SIGTERM)
    _wait(alive, impatient)


def _wait(alive: Sequence[Any], impatient: Callable[[], bool]) -> None:
    began = time.monotonic()
    tell = began + TELL_AFTER
    while alive := [process for process in alive if process.popen.poll() is None]:
        now = time.monotonic()
        for process in alive:
            if impatient() or now - began > LONGER.get(_name(process), LIMIT):
                _signal(process, signal.SIGKILL)
                reason = "at your request" if impatient() else f"after {now - began:.0f} s"
                lost = "; its bag is closed by: rosrun hric_experiments health --salvage"
                _tell(f"killed {_name(process)} {reason}" + (lost if _name(process) == "recorder" else ""))
        if now >= tell:
            tell = now + TELL_EVERY
            _tell(f"ending: waiting for {', '.join(map(_name, alive))} ({now - began:.0f} s; Ctrl-C again: at once)")
        time.sleep(0.02)


def _name(process: Any) -> str:
    """Of the node; roslaunch calls the process NODE-NUMBER, with the namespace before it."""
    name: str = process.name.rpartition("-")[0]
    return name.rpartition("-")[2]


def _signal(process: Any, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.popen.pid, number)


def _tell(text: str) -> None:
    print(f"scripts/bringup: {text}", file=sys.stderr, flush=True)
