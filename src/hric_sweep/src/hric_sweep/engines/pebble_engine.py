"""Engines on this machine: a pool of processes, killed if a run exceeds its timeout; and the current process."""

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
from multiprocessing import get_context, resource_tracker
from pathlib import Path
from typing import Any

from pebble import ProcessExpired, ProcessPool

from hric_core.errors import FailureError
from hric_sweep import task as runs
from hric_sweep.engines.engine import Died, Lost, TimedOut, same
from hric_sweep.records import ReferenceRun, RunResponse, RunTask

OPEN_EACH = 2
"""Number of open tasks per worker: one runs, one waits."""
IDLE_DEATHS = 5
"""Maximum number of workers, per worker of the pool, that may end without a task before a run succeeds; beyond it
the pool counts as broken. Project default, unconfirmed."""
STARTING = 300.0
"""Timeout for a worker to load its code and execute a reference run [s]."""
FIRST_TO_GO = 1000
"""Value for /proc/self/oom_score_adj: if memory runs out, the kernel kills a worker, not the supervisor."""
MIN_PROGRESS = 0.02
"""Processor time within the timeout above which a run counts as progressing [s]; a run that waits for a busy
processor still gets as much. Two ticks of the kernel's clock; project default, unconfirmed."""
LOCKED = 5.0
"""Time after which the lock of the workers' channel counts as lost with a dead worker [s]; live workers hold it for
milliseconds. Project default, unconfirmed."""
_PR_SET_PDEATHSIG = 1


class PebbleEngine:
    """Engine that executes runs in a pool of processes on this machine.

    Args:
        jobs: number of processes.
        memory: memory limit of a worker [bytes].
    """

    def __init__(self, jobs: int, memory: float) -> None:
        self.workers, self.window = jobs, OPEN_EACH * jobs
        self._pool = worker_pool(jobs, memory)
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
            LookupError: the worker had no task; the pool starts another worker.
            BrokenProcessPool: too many workers end before they execute a run.
        """
        self._renew_lost_channel()
        for task in list(self._manager.task_manager.tasks.values()):
            if task.worker_id == worker:
                return task
        self._idle_deaths += 1
        if self._idle_deaths > IDLE_DEATHS * self.workers:
            raise BrokenProcessPool
        raise LookupError

    def _renew_lost_channel(self) -> None:
        """Replace the channel to the workers if a worker has died while it held the channel's lock.

        The other workers end with the old channel, and their runs fail; tasks that had not begun are sent again.
        """
        workers = self._manager.worker_manager
        with workers.workers_channel.lock(timeout=LOCKED) as locked:
            if locked:
                return
        workers.create_channels()
        for process in list(workers.workers.values()):
            process.kill()
        for task in list(self._manager.task_manager.tasks.values()):
            if not task.started:
                workers.dispatch(task)

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
        """Have one worker execute the reference run: all workers have the same machine and code."""
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
    """Engine that executes runs in the current process, for few runs: without limits of time and memory."""

    window = workers = 1

    def submit(self, task: RunTask) -> "Future[RunResponse]":
        """Execute a task before returning its future."""
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
    """Detector of hanging runs by processor time; by wall time, slow runs on a busy machine would count as hanging."""

    def __init__(self) -> None:
        self._progress: dict[int, _Progress] = {}

    def exhausted(self, task: Any) -> bool:
        """Return True if a run has used its timeout of processor time or made no progress for that time.

        This replaces pebble's own rule. No progress means that the run has used at most `MIN_PROGRESS` seconds of
        processor time in a wall time equal to its timeout.
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
    """Processor time of a run's process at the run's start and at its last progress [s]; time of that progress [s]."""

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


def worker_pool(jobs: int, memory: float) -> ProcessPool:
    """Return a pool of `jobs` processes, which start at once; Ctrl-C does not reach them. See `begin_worker`.

    Raises:
        FailureError: the system refuses what the processes need.
    """
    initial = os.getpid(), int(memory)
    pool = ProcessPool(max_workers=jobs, context=get_context("spawn"), initializer=begin_worker, initargs=initial)
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        resource_tracker.ensure_running()  # it would remove the signal from the mask when it starts
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        _ = pool.active  # starts the workers, and the threads that replace them, all with this signal blocked
    except OSError as error:
        needs = "they need semaphores, in /dev/shm, and pipes"
        raise FailureError(f"the processes of the runs cannot start, {needs}: {error.strerror}") from error
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
    return pool


def begin_worker(supervisor: int, memory: int) -> None:
    """Prepare a worker process: it ends when its parent (the supervisor) ends, and is in its own process group.

    If memory runs out, the kernel kills this process before the supervisor.

    Args:
        supervisor: process id of the parent process.
        memory: memory limit of this process [bytes].
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != supervisor:  # the supervisor ended before the call above
        os._exit(1)
    os.setpgid(0, 0)
    Path("/proc/self/oom_score_adj").write_text(str(FIRST_TO_GO))
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    runs.prepare()
