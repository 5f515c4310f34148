"""Threads and processes of the operating system: their priority, their garbage, their end, the exit code of a
command."""

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
"""Exit code of a command that Ctrl-C ended, as shells have it."""
UNREAD_CODE = 141
"""Exit code of a command whose output nobody reads any more (`| head`), as shells have it after SIGPIPE."""
NICE = -10
"""Of the control loop's thread, 0 being everybody's: beside one that others have it gets nine tenths of a processor;
project default, unconfirmed."""
_PR_SET_PDEATHSIG = 1


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


@contextmanager
def quiet_collector() -> Iterator[None]:
    """Keep the garbage collector from walking over everything that was loaded, in the middle of a cycle; and from
    looking at each thirty cycles' lists, which takes a thirtieth of a cycle, and of drawing a tenth."""
    thresholds = gc.get_threshold()
    gc.set_threshold(50_000, 20, 20)
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


def end_with_parent(number: signal.Signals) -> Callable[[], object]:
    """Return what a child calls between fork and exec, so that the system sends it a signal when the thread ends that
    started it, by whatever. It is looked up before the fork: only async-safe work may happen after it."""
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    return lambda: prctl(_PR_SET_PDEATHSIG, number)


def start_dependent(command: Sequence[str], **streams: Any) -> subprocess.Popen[bytes]:
    """Start a process that leads a group of its own, so that the terminal's Ctrl-C does not reach it, and that the
    system interrupts when the thread ends that started it, by whatever.

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
    """Interrupt a process that leads its own group, as with Ctrl-C, and wait for all of the group, since it may end
    before what it passes the signal on to; kill what is left.

    Args:
        process: started with `start_new_session`; it may have ended already.
        timeout: how long they may take to end [s].
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
    """Return how a process ended, from its exit code or, negative, the signal that killed it."""
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
    """Do the work of a command or a node; a HricError, or what the system refuses, becomes a message, not a traceback.

    Args:
        name: of the command, in front of the message.
        work: returns the exit code, None for 0.
        report: takes the message; None: it goes to stderr.
        interrupted: exit code after Ctrl-C.

    Returns:
        the exit code: of the work, or of the HricError; FAILURE where the system refused a file or a socket.
    """
    try:
        try:
            code = work() or 0
            _flush()
            return code
        except BrokenPipeError:
            if not _unread(output := sys.stdout.fileno()):
                raise  # another pipe
            os.dup2(os.open(os.devnull, os.O_WRONLY), output)  # for the interpreter's own flush
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
    """Write what was printed. Where that cannot be, Python does not try it once more at the end of the process."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise


def _unread(output: int) -> bool:
    """Return True if nobody can read what a descriptor of a pipe takes."""
    poll = select.poll()
    poll.register(output, 0)
    return any(event & select.POLLERR for _, event in poll.poll(0))


def run_server(name: str, work: Callable[[], None], report: Callable[[str], object] | None = None) -> int:
    """`run_command` of what ends well with Ctrl-C and SIGTERM, from its start until the work handles them itself."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    return run_command(name, work, report, interrupted=0)
