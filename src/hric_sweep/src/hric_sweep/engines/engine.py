"""Interface of an execution engine: it executes the tasks of a sweep on workers and returns their responses."""

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
    """Error: a worker, named in the message, has different code or does not compute bitwise equal results."""


class Lost(FailureError):
    """Error: the engine is no longer available (e.g. its scheduler ended); open runs have no response."""

    exit_code = NOT_GOOD


class SweepEngine(Protocol):
    """Execution engine: executes the tasks of a sweep on its workers."""

    @property
    def window(self) -> int:
        """Number of tasks to submit without waiting for responses; more tasks would only wait in the engine."""

    @property
    def workers(self) -> int:
        """Number of runs that are executed at once."""

    def submit(self, task: RunTask) -> "Future[RunResponse]":
        """Submit a task; an engine may buffer tasks until it has a complete chunk.

        Returns:
            Future of the response. Its error is TimedOut or Died if the run failed, and Lost or Differs if the sweep
                has to end; any other error is a bug.

        Raises:
            Lost: the engine is already known to be lost.
        """

    def flush(self) -> None:
        """Send buffered tasks to the workers, before the caller waits for their responses. Raises Lost."""

    def check(self, reference: RunTask) -> ReferenceRun:
        """Have every worker execute the reference run, or one worker if they cannot differ; return the common result.

        Raises:
            Differs: workers have different results; the message names them.
        """

    def close(self, *, now: bool) -> None:
        """End all workers; `now`: do not wait for open tasks."""


def arrived(queue: "SimpleQueue[T]", patience: float | None = None) -> list[T]:
    """Wait for the first item of a queue; return it and all other items that are in the queue by then.

    Args:
        queue: queue from which only this thread takes items.
        patience: timeout [s], after which an empty list is returned; None: no timeout.
    """
    try:
        items = [queue.get(timeout=patience)]
    except Empty:
        return []
    while not queue.empty():
        items.append(queue.get_nowait())
    return items


def same(results: Iterable[tuple[str, ReferenceRun]], expected: ReferenceRun) -> ReferenceRun:
    """Check that all workers have the expected result of the reference run; return it.

    Args:
        results: (name of a worker, its result).
        expected: result with the code of this process, or result that was stored at the start of the sweep.

    Raises:
        Differs: workers have different results; the message names them.
    """
    differing = [f"{name}: {why}" for name, result in results if (why := difference(expected, result))]
    if differing:
        raise Differs(
            "workers have different code or results, so that their runs would not be comparable:\n  "
            + "\n  ".join(differing)
        )
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
