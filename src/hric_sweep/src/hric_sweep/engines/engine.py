"""Interface of an engine of a sweep, which executes tasks and returns responses without knowing what a run is."""

from collections.abc import Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import Any, Protocol, TypeVar

from hric_core.errors import FailureError, HricError
from hric_sweep.journal import UNFINISHED_CODE

Task = dict[str, Any]
Response = dict[str, Any]
T = TypeVar("T")


class TimedOut(FailureError):
    """Error: a run exceeded its timeout; its worker was killed."""


class Died(FailureError):
    """Error: the worker of a run ended without a response."""


class Differs(HricError):
    """Error: a worker, named in the message, has different code or computes results with different bits."""


class Lost(FailureError):
    """Error: the engine is no longer available; no run failed, and open runs have no response."""

    exit_code = UNFINISHED_CODE


class Engine(Protocol):
    """Executor of tasks."""

    @property
    def window(self) -> int:
        """Number of tasks to keep open at once; more would only wait."""

    @property
    def workers(self) -> int:
        """Number of runs that are executed at once."""

    def submit(self, task: Task) -> "Future[Response]":
        """Submit a task. An engine may buffer tasks until it has a complete chunk.

        Returns:
            Future of the response; its error is TimedOut or Died for a failed run, Lost or Differs, which end the sweep
                and are no result; any other error is a bug.

        Raises:
            Lost: the engine is already known to be lost.
        """

    def flush(self) -> None:
        """Send buffered tasks: the caller waits for one of them before it submits another. Raises Lost."""

    def check(self, reference: Task) -> Response:
        """Have every worker execute a reference run, or one worker if they cannot differ.

        Returns:
            Code version and hash, from `task.reference`.

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
        found = [queue.get(timeout=patience)]
    except Empty:
        return []
    while not queue.empty():
        found.append(queue.get_nowait())
    return found


@contextmanager
def going_on_with(command: str) -> Iterator[None]:
    """Add the command that resumes the sweep to errors of a lost engine or a differing worker in the block.

    Raises:
        Lost: with the command in its message.
    """
    try:
        yield
    except (Lost, Differs) as error:
        raise Lost(f"{error}\n  what ended is kept; go on: {command}") from None


def same(responses: Iterable[tuple[str, Response]], own: Response) -> Response:
    """Return the common response of all workers to the reference run.

    Args:
        responses: (name of a worker, its response).
        own: response of the supervisor's machine and code, or from the start of the sweep.

    Raises:
        Differs: names the workers that differ.
    """
    told = [f"{name}: {why}" for name, response in responses if (why := difference(own, response))]
    if told:
        raise Differs("workers differ, so that their runs would not be comparable:\n  " + "\n  ".join(told))
    return own


def difference(own: Response, other: Response) -> str:
    """Return what differs between two responses to the reference run, as text; empty: they agree."""
    if own["code"] != other["code"]:
        return f"code version {other['code'][:12]}, not {own['code'][:12]}; valid: the same revision, built"
    if own["state_sha256"] != other["state_sha256"]:
        return (
            f"the reference run has state_sha256 {other['state_sha256'][:12]}, not {own['state_sha256'][:12]}; valid: "
            "the same kind of processor, and the pinned versions of scripts/requirements.txt"
        )
    return ""
