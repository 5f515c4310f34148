"""Processes of this machine: each keeps what it has loaded, and is killed when a run takes too long."""

import ctypes
import os
import resource
import signal
from concurrent.futures import Future
from concurrent.futures import TimeoutError as Late
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

from pebble import ProcessExpired, ProcessPool

from hric_experiments.sweep import task as runs
from hric_experiments.sweep.engines.engine import Died, Response, Task, TimedOut, same

OPEN_EACH = 2
"""Tasks that each worker has open: one that runs, one that waits."""
STARTING = 300.0
"""For a worker to load all that it needs, and to carry a reference run out [s]."""
FIRST_TO_GO = 1000
"""Of /proc/self/oom_score_adj: where memory ends the kernel kills a worker, not the supervisor."""
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


def _pass_on(done: "Future[Response]", response: "Future[Response]", task: Task) -> None:
    if done.cancelled():
        response.cancel()
        return
    error = done.exception()
    if error is None:
        response.set_result(done.result())
    elif isinstance(error, Late):
        response.set_exception(TimedOut(f"took longer than {task['timeout']:g} s"))
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
