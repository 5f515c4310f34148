"""Threads and processes of the operating system: their priority, their end, the exit code of a command."""

import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable

from hric_control.errors import HricError

NICE = -10
"""Of the control loop's thread, 0 being everybody's: beside one that others have it gets nine tenths of a processor;
project default, unconfirmed."""


def prefer_this_thread(nice: int = NICE) -> bool:
    """Let the calling thread run at higher priority; threads it starts have the usual one.

    Returns:
        False where the system does not allow it: it takes root, or a line such as `@realtime - nice -10` in
            /etc/security/limits.conf.
    """
    try:
        os.sched_setscheduler(0, os.sched_getscheduler(0) | os.SCHED_RESET_ON_FORK, os.sched_getparam(0))
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), nice)
    except PermissionError:
        return False
    return True


def end_process(process: subprocess.Popen[bytes], timeout: float) -> None:
    """Interrupt a process that leads its own group, as with Ctrl-C; kill the group where that is not enough.

    Args:
        process: started with `start_new_session`; it may have ended already.
        timeout: how long it may take to end [s].
    """
    if process.poll() is not None:
        return
    process.send_signal(signal.SIGINT)
    try:
        process.wait(timeout)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def run_command(work: Callable[[], None], log: logging.Logger) -> int:
    """Do the work; a HricError becomes one line of the log. SIGINT and SIGTERM end it until the work handles them
    itself.

    Returns:
        the exit code: 1 after a HricError.
    """
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        work()
    except HricError as error:
        log.critical("%s", error)
        return 1
    except KeyboardInterrupt:
        return 0
    return 0
