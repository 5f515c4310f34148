"""Engines of this machine: processes that are reused, and killed if a run exceeds its timeout; and this process."""

import ctypes
import os
import resource
import signal
import time
from concurrent.futures import Future
from concurrent.futures import TimeoutError as Late
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from pebble import ProcessExpired, ProcessPool

from hric_sweep import task as runs
from hric_sweep.engines.engine import Died, Lost, TimedOut, same
from hric_sweep.records import ReferenceRun, RunResponse, RunTask

OPEN_EACH = 2
"""Open tasks per worker: one that runs, one that waits."""
IDLE_DEATHS = 5
"""Number of workers, per worker of the pool, that may end without a task before a run succeeds; project default,
unconfirmed."""
STARTING = 300.0
"""Timeout for a worker to load its code and execute a reference run [s]."""
FIRST_TO_GO = 1000
"""Value for /proc/self/oom_score_adj: if memory runs out, the kernel kills a worker, not the supervisor."""
MIN_PROGRESS = 0.02
"""Processor time that a run waiting for a busy processor still gets within its timeout [s]; project default,
unconfirmed: two ticks of the kernel's clock."""
_PR_SET_PDEATHSIG = 1


class PebbleEngine:
    """Engine with a pool of processes.

    Args:
        jobs: number of processes.
        memory: memory limit of a worker [bytes].
    """

    def __init__(self, jobs: int, memory: float) -> None:
        self.workers, self.window = jobs, OPEN_EACH * jobs
        self._pool = ProcessPool(
            max_workers=jobs,
            context=get_context("spawn"),
            initializer=begin_worker,
            initargs=(os.getpid(), int(memory)),
        )
        self._manager = self._pool._pool_manager
        self._manager.task_manager.timeout = Patience().exhausted
        self._manager.find_expired_task = self._task_of
        self._idle_deaths = 0

    def submit(self, task: RunTask) -> "Future[RunResponse]":
        """Submit a task to the pool."""
        response: Future[RunResponse] = Future()
        inner = self._pool.schedule(runs.run, args=[task], timeout=task.timeout)
        inner.add_done_callback(lambda done: self._pass_on(done, response, task))
        return response

    def _task_of(self, worker: int) -> Any:
        """Return the task of a worker that ended.

        This replaces pebble's own rule, by which a worker that is killed between two tasks ends the pool.

        Raises:
            LookupError: it had none; the pool starts another worker.
            BrokenProcessPool: workers end before they run anything.
        """
        for task in list(self._manager.task_manager.tasks.values()):
            if task.worker_id == worker:
                return task
        self._idle_deaths += 1
        if self._idle_deaths > IDLE_DEATHS * self.workers:
            raise BrokenProcessPool
        raise LookupError

    def _pass_on(self, done: "Future[RunResponse]", response: "Future[RunResponse]", task: RunTask) -> None:
        if done.cancelled():
            response.cancel()
            return
        error = done.exception()
        if error is None:
            self._idle_deaths = 0
            response.set_result(done.result())
        elif isinstance(error, Late):
            patience = f"took more than {task.timeout:g} s of processor time, or made no progress for as long"
            response.set_exception(TimedOut(patience))
        elif isinstance(error, ProcessExpired):
            response.set_exception(Died(f"ended its worker ({_how(error.exitcode)})"))
        elif isinstance(error, BrokenProcessPool):
            response.set_exception(Lost("the workers of this machine end before they run anything"))
        else:
            response.set_exception(error)

    def flush(self) -> None:
        """Do nothing: this engine has no buffer."""

    def check(self, reference: RunTask) -> ReferenceRun:
        """Have one worker execute the reference run: all workers have this machine and code."""
        result: ReferenceRun = self._pool.schedule(runs.reference, args=[reference], timeout=STARTING).result()
        return same([("worker of this machine", result)], replace(result, code=runs.code_version()))

    def close(self, *, now: bool) -> None:
        """End all workers; `now`: do not wait for open tasks."""
        if now:
            self._pool.stop()
        else:
            self._pool.close()
        self._pool.join()


class InProcessEngine:
    """Engine without workers, for few runs: a run has no limits of time and memory."""

    window = workers = 1

    def submit(self, task: RunTask) -> "Future[RunResponse]":
        """Execute a task."""
        response: Future[RunResponse] = Future()
        response.set_result(runs.run(task))
        return response

    def flush(self) -> None:
        """Do nothing: this engine has no buffer."""

    def check(self, reference: RunTask) -> ReferenceRun:
        """Execute the reference run."""
        return runs.reference(reference)

    def close(self, *, now: bool) -> None:
        """Do nothing: this engine has no workers."""


class Patience:
    """Detection of hanging runs by processor time: wall time would condemn healthy runs on a busy machine."""

    def __init__(self) -> None:
        self._progress: dict[int, _Progress] = {}

    def exhausted(self, task: Any) -> bool:
        """Return True if a run has used its timeout of processor time or made no progress for that time.

        This replaces pebble's own rule. No progress means at most `MIN_PROGRESS` of processor time [s] in as much wall
        time as the timeout [s].
        """
        if not task.started:
            return False
        now, used = time.monotonic(), processor_time(task.worker_id)
        progress = self._progress.get(task.id)
        if progress is None:
            self._progress = {key: entry for key, entry in self._progress.items() if not entry.future.done()}
            progress = self._progress[task.id] = _Progress(task.future, used, used, now)
        if used - progress.last > MIN_PROGRESS:
            progress.last, progress.at = used, now
        return bool(used - progress.first > task.timeout or now - progress.at > task.timeout)


@dataclass
class _Progress:
    """Processor time of a run's process at its start and at its last progress [s], and the time of the latter [s]."""

    future: "Future[RunResponse]"
    first: float
    last: float
    at: float


def processor_time(pid: int) -> float:
    """Return the processor time that all threads of a process have used [s]; 0: it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _how(code: int | None) -> str:
    if code is not None and code < 0:
        with suppress(ValueError):
            return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"


def begin_worker(supervisor: int, memory: int) -> None:
    """Prepare a worker process, which ends with the supervisor and does not get its Ctrl-C.

    If memory runs out, the kernel kills this process before the supervisor.

    Args:
        supervisor: process id of the supervisor.
        memory: memory limit of this process [bytes].
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != supervisor:  # the supervisor ended before the call above
        os._exit(1)
    os.setpgid(0, 0)
    Path("/proc/self/oom_score_adj").write_text(str(FIRST_TO_GO))
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    runs.prepare()
