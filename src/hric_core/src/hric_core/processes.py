"""Threads and processes: priority, garbage collection, starting and ending child processes, exit codes."""

import atexit
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
"""Exit code of a command that writes to a closed pipe (e.g. `| head`), as in shells after SIGPIPE."""
NICE = -10
"""Niceness of the control loop's thread; 0 is normal (project default, unconfirmed).

If one thread of normal niceness competes for the same processor, the loop gets nine tenths of the time."""
_PR_SET_PDEATHSIG = 1


def prefer_this_thread(nice: int = NICE) -> bool:
    """Give the calling thread a higher priority; the threads it starts have normal priority.

    Returns:
        False if the system does not allow it: the process needs root, or a line such as `@realtime - nice -10` in
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
    """Let Python's garbage collector run less often within the block.

    Otherwise it visits all loaded objects in the middle of a control cycle, and new objects about every thirty cycles,
    which takes a thirtieth of a cycle's time, and a tenth of the time for drawing."""
    thresholds = gc.get_threshold()
    gc.set_threshold(50_000, 20, 20)
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Delay Ctrl-C and SIGTERM to the end of the block, which leaves something half-made otherwise."""
    if threading.current_thread() is not threading.main_thread():  # only the main thread receives signals
        yield
        return
    held: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _: held.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for caught in held:
            signal.raise_signal(caught)


def end_with_parent(number: signal.Signals) -> Callable[[], object]:
    """Return a `preexec_fn` for subprocess.Popen that sends the child a signal when the thread that started it ends.

    The C function is looked up here, before the fork, as only async-signal-safe calls are allowed after it."""
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    return lambda: prctl(_PR_SET_PDEATHSIG, number)


def start_dependent(command: Sequence[str], **streams: Any) -> subprocess.Popen[bytes]:
    """Start a process in its own process group; it gets SIGINT when the thread that started it ends.

    Ctrl-C in the terminal does not reach the process.

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
    """Send SIGINT to the leader of a process group, wait for the whole group, and kill processes that remain.

    The whole group is waited for, as the leader may end before the processes to which it passes the signal.

    Args:
        process: leader of the group, started with `start_new_session`; it may have ended already.
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
    """Return a text on how a process ended; `code`: its exit code or, if negative, minus the signal that killed it."""
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
        name: name of the command, with which the message begins.
        work: function that does the work and returns the exit code, None for 0.
        report: function that prints the message; None: to stderr.
        interrupted: exit code after Ctrl-C.

    Returns:
        the exit code that `work` returned, or that of the HricError; FAILURE after an OSError.
    """
    atexit.register(gc.freeze)  # the interpreter would visit all objects again before it ends
    try:
        try:
            with quiet_collector():  # also for imports: they create many objects, and no garbage
                code = work() or 0
            _flush()
            return code
        except BrokenPipeError:
            if not _unread(output := sys.stdout.fileno()):
                raise  # the broken pipe is not stdout
            os.dup2(os.open(os.devnull, os.O_WRONLY), output)  # the interpreter flushes stdout once more at exit
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
    """Flush stdout. After an error, redirect it to /dev/null, so that Python's flush at exit does not fail again."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise


def _unread(output: int) -> bool:
    """Return True if no process has the other end of a pipe open for reading; `output`: file descriptor."""
    poll = select.poll()
    poll.register(output, 0)
    return any(event & select.POLLERR for _, event in poll.poll(0))


def run_server(name: str, work: Callable[[], None], report: Callable[[str], object] | None = None) -> int:
    """Run a server like `run_command`; Ctrl-C or SIGTERM ends it with exit code 0, also while it is still starting."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    return run_command(name, work, report, interrupted=0)
