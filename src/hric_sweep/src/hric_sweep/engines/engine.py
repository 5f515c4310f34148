"""What an engine of a sweep offers: tasks in, responses out, and nothing of it knows what a run is."""

from collections.abc import Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import Any, Protocol, TypeVar

from hric_core.errors import NOT_GOOD, FailureError, HricError

Task = dict[str, Any]
Response = dict[str, Any]
T = TypeVar("T")


class TimedOut(FailureError):
    """A run took longer than it may; its worker was killed."""


class Died(FailureError):
    """The worker of a run ended without a response."""


class Differs(HricError):
    """A worker has other code, or computes other bits; the message names it."""


class Lost(FailureError):
    """What carries runs out is not there any more: no run failed, and those that are open have no response."""

    exit_code = NOT_GOOD


class Engine(Protocol):
    """Carries tasks out."""

    @property
    def window(self) -> int:
        """How many tasks it wants to have open at once; more of them only wait."""

    @property
    def workers(self) -> int:
        """How many runs it carries out at once."""

    def submit(self, task: Task) -> "Future[Response]":
        """Take a task. An engine may keep tasks back until it has a whole chunk of them.

        Returns:
            has the response, or TimedOut or Died of that run; Lost or Differs, which end the sweep and are no result;
                anything else is a bug.

        Raises:
            Lost: it is known by now.
        """

    def flush(self) -> None:
        """Begin what was kept back: no further task comes before one of these has ended. Raises Lost."""

    def check(self, reference: Task) -> Response:
        """Have every worker, or one of several that cannot differ, carry a reference run out.

        Returns:
            code version and hash, of `task.reference`.

        Raises:
            Differs: names the workers that differ.
        """

    def close(self, *, now: bool) -> None:
        """End all workers; `now`: without waiting for what is open."""


def arrived(queue: "SimpleQueue[T]", patience: float | None = None) -> list[T]:
    """Waits for the first item of a queue; returns it and all that are there by then.

    Args:
        queue: that this thread alone takes from.
        patience: longest wait [s], after which the list may be empty; None: without end.
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
    """Within: what ends because the engine is lost, or has a worker that differs, says how to go on.

    Raises:
        Lost: with the command.
    """
    try:
        yield
    except (Lost, Differs) as error:
        raise Lost(f"{error}\n  what ended is kept; go on: {command}") from None


def same(responses: Iterable[tuple[str, Response]], own: Response) -> Response:
    """The response that all workers gave to the reference run.

    Args:
        responses: (name of a worker, its response).
        own: of the supervisor's machine and code, or of when the sweep began.

    Raises:
        Differs: names the workers that differ.
    """
    told = [f"{name}: {why}" for name, response in responses if (why := difference(own, response))]
    if told:
        raise Differs("workers differ, so that their runs would not be comparable:\n  " + "\n  ".join(told))
    return own


def difference(own: Response, other: Response) -> str:
    """What is different, for people; empty: nothing."""
    if own["code"] != other["code"]:
        return f"code version {other['code'][:12]}, not {own['code'][:12]}; valid: the same revision, built"
    if own["state_sha256"] != other["state_sha256"]:
        return (
            f"the reference run has state_sha256 {other['state_sha256'][:12]}, not {own['state_sha256'][:12]}; valid: "
            "the same kind of processor, and the pinned versions of scripts/requirements.txt"
        )
    return ""
