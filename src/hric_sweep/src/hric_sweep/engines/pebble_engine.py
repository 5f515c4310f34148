"""Processes of this machine: each keeps what it has loaded, and is killed when a run takes too long."""

import ctypes
import os
import resource
import signal
import time
from concurrent.futures import Future
from concurrent.futures import TimeoutError as Late
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from pebble import ProcessExpired, ProcessPool

from hric_sweep import task as runs
from hric_sweep.engines.engine import Died, Response, Task, TimedOut, same

OPEN_EACH = 2
"""Tasks that each worker has open: one that runs, one that waits."""
STARTING = 300.0
"""For a worker to load all that it needs, and to carry a reference run out [s]."""
FIRST_TO_GO = 1000
"""Of /proc/self/oom_score_adj: where memory ends the kernel kills a worker, not the supervisor."""
MIN_PROGRESS = 0.02
"""Processor time that a run which waits for a busy processor still gains within its timeout [s]; project default,
unconfirmed: two ticks of the kernel's clock."""
_PR_SET_PDEATHSIG = 1


class PebbleEngine:
    """A pool of processes.

    Args:
        jobs: how many.
        memory: that a worker may take [bytes].
    """

    def __init__(self, jobs: int, memory: float) -> None:
        self.workers, self.window = jobs, OPEN_EACH * jobs
        self._pool = ProcessPool(
            max_workers=jobs,
            context=get_context("spawn"),
            initializer=begin_worker,
            initargs=(os.getpid(), int(memory)),
        )
        self._pool._pool_manager.task_manager.timeout = Patience().exhausted

    def submit(self, task: Task) -> "Future[Response]":
        """Take a task."""
        response: Future[Response] = Future()
        inner = self._pool.schedule(runs.run, args=[task], timeout=task["timeout"])
        inner.add_done_callback(lambda done: _pass_on(done, response, task))
        return response

    def flush(self) -> None:
        """Nothing is kept back."""

    def check(self, reference: Task) -> Response:
        """All workers are of this machine and code: one of them carries the reference run out."""
        found: Response = self._pool.schedule(runs.reference, args=[reference], timeout=STARTING).result()
        return same([("worker of this machine", found)], {**found, "code": runs.code_version()})

    def close(self, *, now: bool) -> None:
        """End all workers."""
        if now:
            self._pool.stop()
        else:
            self._pool.close()
        self._pool.join()


class Patience:
    """Which runs hang: by their processor time, not by wall time, which a busy machine takes from healthy ones."""

    def __init__(self) -> None:
        self._progress: dict[int, _Progress] = {}

    def exhausted(self, task: Any) -> bool:
        """Say if a task of pebble, in place of its own rule, has taken more than its timeout of processor time [s], or
        has gained no more than `MIN_PROGRESS` in as much wall time."""
        if not task.started:
            return False
        now, used = time.monotonic(), processor_time(task.worker_id)
        begun = self._progress.get(task.id)
        if begun is None:
            self._progress = {key: kept for key, kept in self._progress.items() if not kept.future.done()}
            begun = self._progress[task.id] = _Progress(task.future, used, used, now)
        if used - begun.last > MIN_PROGRESS:
            begun.last, begun.at = used, now
        return bool(used - begun.first > task.timeout or now - begun.at > task.timeout)


@dataclass
class _Progress:
    """Processor time of a run's process at its begin and when it last gained some [s], and when that was [s]."""

    future: "Future[Response]"
    first: float
    last: float
    at: float


def processor_time(pid: int) -> float:
    """Return what all threads of a process have used [s]; 0: it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _pass_on(done: "Future[Response]", response: "Future[Response]", task: Task) -> None:
    if done.cancelled():
        response.cancel()
        return
    error = done.exception()
    if error is None:
        response.set_result(done.result())
    elif isinstance(error, Late):
        response.set_exception(
            TimedOut(f"took more than {task['timeout']:g} s of processor time, or did nothing so long")
        )
    elif isinstance(error, ProcessExpired):
        response.set_exception(Died(f"ended its worker ({_how(error.exitcode)})"))
    else:
        response.set_exception(error)


def _how(code: int | None) -> str:
    if code is not None and code < 0:
        with suppress(ValueError):
            return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"


def begin_worker(supervisor: int, memory: int) -> None:
    """In a new worker: end with the supervisor, leave Ctrl-C to it, and go before it where memory ends.

    Args:
        supervisor: its process.
        memory: that this one may take [bytes].
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != supervisor:  # it ended before that
        os._exit(1)
    os.setpgid(0, 0)
    Path("/proc/self/oom_score_adj").write_text(str(FIRST_TO_GO))
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    runs.prepare()
