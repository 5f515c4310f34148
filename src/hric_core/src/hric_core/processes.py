"""Threads and processes of the operating system: priority, garbage collection, end, exit codes."""

import ctypes
import gc
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

from hric_core.errors import HricError, refused_by_system

INTERRUPTED_CODE = 130
"""Exit code of a command ended by Ctrl-C, as in shells."""
UNREAD_CODE = 141
"""Exit code of a command whose output is no longer read (`| head`), as in shells after SIGPIPE."""
NICE = -10
"""Niceness of the control loop's thread; 0 is the usual one (project default, unconfirmed).

Next to one usual thread it gets nine tenths of a processor."""
_PR_SET_PDEATHSIG = 1


def prefer_this_thread(nice: int = NICE) -> bool:
    """Let the calling thread run at higher priority; threads it starts have the usual one.

    Returns:
        False if the system does not allow it: it takes root, or a line such as `@realtime - nice -10` in
            /etc/security/limits.conf.
    """
    try:
        os.sched_setscheduler(0, os.sched_getscheduler(0) | os.SCHED_RESET_ON_FORK, os.sched_getparam(0))
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), nice)
    except PermissionError:
        return False
    return True


@contextmanager
def quiet_collector() -> Iterator[None]:
    """Make the garbage collector rarer within the block.

    It otherwise walks over all loaded objects in the middle of a cycle, and checks the lists of every thirty cycles,
    which takes a thirtieth of a cycle, and a tenth of drawing."""
    thresholds = gc.get_threshold()
    gc.set_threshold(50_000, 20, 20)
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


def end_with_parent(number: signal.Signals) -> Callable[[], object]:
    """Return the function for a child between fork and exec that requests a signal when its parent thread ends.

    It is looked up before the fork: only async-safe work may happen after it."""
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    return lambda: prctl(_PR_SET_PDEATHSIG, number)


def start_dependent(command: Sequence[str], **streams: Any) -> subprocess.Popen[bytes]:
    """Start a process in its own group, which is interrupted when the thread that started it ends.

    The terminal's Ctrl-C does not reach it.

    Args:
        command: program and arguments.
        streams: stdin, stdout and stderr as `subprocess.Popen` takes them.
    """
    return subprocess.Popen(
        list(command),
        start_new_session=True,
        preexec_fn=end_with_parent(signal.SIGINT),
        **streams,
    )


def end_process(process: subprocess.Popen[bytes], timeout: float) -> None:
    """Interrupt the leader of a process group, as with Ctrl-C; wait for the whole group, and kill the rest.

    The leader may end before the processes to which it passes the signal.

    Args:
        process: started with `start_new_session`; it may have ended already.
        timeout: longest wait for the group [s].
    """
    if process.poll() is not None:
        return
    deadline = time.monotonic() + timeout
    process.send_signal(signal.SIGINT)
    with suppress(ProcessLookupError):  # no group is left
        while time.monotonic() < deadline:
            process.poll()
            os.killpg(process.pid, 0)
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def describe_exit(name: str, code: int) -> str:
    """Return a text about the end of a process, from its exit code or, negative, the signal that killed it."""
    if code >= 0:
        return f"{name} ended with code {code}"
    known = -code in [number.value for number in signal.Signals]
    return f"{name} was killed by {signal.Signals(-code).name if known else f'signal {-code}'}"


def run_command(
    name: str,
    work: Callable[[], int | None],
    report: Callable[[str], object] | None = None,
    interrupted: int = INTERRUPTED_CODE,
) -> int:
    """Run a command or node; a HricError or an error of the operating system becomes a message without traceback.

    Args:
        name: name of the command, in front of the message.
        work: returns the exit code, None for 0.
        report: takes the message; None: it goes to stderr.
        interrupted: exit code after Ctrl-C.

    Returns:
        the exit code: of the work, or of the HricError; FAILURE if the system refused a file or a socket.
    """
    try:
        try:
            code = work() or 0
            _flush()
            return code
        except BrokenPipeError:
            if not _unread(output := sys.stdout.fileno()):
                raise  # a pipe other than stdout
            os.dup2(os.open(os.devnull, os.O_WRONLY), output)  # target of the interpreter's flush at exit
            return UNREAD_CODE
        except OSError as error:
            if error.errno is None:
                raise
            raise refused_by_system(error) from error
    except HricError as error:
        (report or partial(print, file=sys.stderr))(f"{name}: {error}")
        return error.exit_code
    except KeyboardInterrupt:
        return interrupted


def _flush() -> None:
    """Flush stdout. After a failure, keep Python from trying again at the end of the process."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise


def _unread(output: int) -> bool:
    """Return True if no process can read from the other end of a pipe."""
    poll = select.poll()
    poll.register(output, 0)
    return any(event & select.POLLERR for _, event in poll.poll(0))


def run_server(name: str, work: Callable[[], None], report: Callable[[str], object] | None = None) -> int:
    """Run `run_command` for work that Ctrl-C or SIGTERM ends normally, also before it handles them itself."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    return run_command(name, work, report, interrupted=0)
