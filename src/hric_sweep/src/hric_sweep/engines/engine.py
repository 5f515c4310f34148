"""Interface of an engine of a sweep, which executes tasks and returns responses without knowing what a run is."""

from collections.abc import Iterable
from concurrent.futures import Future
from queue import Empty, SimpleQueue
from typing import Protocol, TypeVar

from hric_core.errors import NOT_GOOD, FailureError, HricError
from hric_sweep.records import ReferenceRun, RunResponse, RunTask

T = TypeVar("T")


class TimedOut(FailureError):
    """Error: a run exceeded its timeout; its worker was killed."""


class Died(FailureError):
    """Error: the worker of a run ended without a response."""


class Differs(HricError):
    """Error: a worker, named in the message, has different code or computes results with different bits."""


class Lost(FailureError):
    """Error: the engine is no longer available; no run failed, and open runs have no response."""

    exit_code = NOT_GOOD


class SweepEngine(Protocol):
    """Executor of tasks."""

    @property
    def window(self) -> int:
        """Number of tasks to keep open at once; more would only wait."""

    @property
    def workers(self) -> int:
        """Number of runs that are executed at once."""

    def submit(self, task: RunTask) -> "Future[RunResponse]":
        """Submit a task. An engine may buffer tasks until it has a complete chunk.

        Returns:
            Future of the response; its error is TimedOut or Died for a failed run, Lost or Differs, which end the sweep
                and are no result; any other error is a bug.

        Raises:
            Lost: the engine is already known to be lost.
        """

    def flush(self) -> None:
        """Send buffered tasks: the caller waits for one of them before it submits another. Raises Lost."""

    def check(self, reference: RunTask) -> ReferenceRun:
        """Have every worker execute a reference run, or one worker if they cannot differ, and return their result.

        Raises:
            Differs: names the workers that differ.
        """

    def close(self, *, now: bool) -> None:
        """End all workers; `now`: do not wait for open tasks."""


def arrived(queue: "SimpleQueue[T]", patience: float | None = None) -> list[T]:
    """Wait for the first item of a queue and return it with all other items that are there by then.

    Args:
        queue: queue from which only this thread takes items.
        patience: longest wait [s], after which the list may be empty; None: no limit.
    """
    try:
        items = [queue.get(timeout=patience)]
    except Empty:
        return []
    while not queue.empty():
        items.append(queue.get_nowait())
    return items


def same(results: Iterable[tuple[str, ReferenceRun]], expected: ReferenceRun) -> ReferenceRun:
    """Return the common result of all workers for the reference run.

    Args:
        results: (name of a worker, its result).
        expected: result of the supervisor's machine and code, or from the start of the sweep.

    Raises:
        Differs: names the workers that differ.
    """
    differing = [f"{name}: {why}" for name, result in results if (why := difference(expected, result))]
    if differing:
        raise Differs("workers differ, so that their runs would not be comparable:\n  " + "\n  ".join(differing))
    return expected


def difference(expected: ReferenceRun, result: ReferenceRun) -> str:
    """Return the difference between two results of the reference run, as text; empty: they agree."""
    if expected.code != result.code:
        return f"code version {result.code[:12]}, not {expected.code[:12]}; valid: the same revision, built"
    if expected.state_sha256 != result.state_sha256:
        return (
            f"the reference run has state_sha256 {result.state_sha256[:12]}, not {expected.state_sha256[:12]}; valid: "
            "the same kind of processor, and the pinned versions of scripts/requirements.txt"
        )
    return ""
