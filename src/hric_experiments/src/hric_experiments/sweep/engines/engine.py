"""What an engine of a sweep offers: tasks in, responses out, and nothing of it knows what a run is."""

from collections.abc import Iterable
from concurrent.futures import Future
from typing import Any, Protocol

from hric_control.errors import FailureError, HricError

Task = dict[str, Any]
Response = dict[str, Any]


class TimedOut(FailureError):
    """A run took longer than it may; its worker was killed."""


class Died(FailureError):
    """The worker of a run ended without an response."""


class Differs(HricError):
    """A worker has other code, or computes other bits; the message names it."""


class Engine(Protocol):
    """Carries tasks out.

    Attributes:
        window: how many tasks it wants to have open at once; more of them only wait.
        workers: how many runs it carries out at once.
    """

    window: int
    workers: int

    def submit(self, task: Task) -> "Future[Response]":
        """Take a task. The future has the response, or TimedOut or Died; anything else is a bug."""

    def check(self, reference: Task) -> Response:
        """Have every worker, or one of several that cannot differ, carry a reference run out.

        Returns:
            code version and hash, of `task.reference`.

        Raises:
            Differs: names the workers that differ.
        """

    def close(self, *, now: bool) -> None:
        """End all workers; `now`: without waiting for what is open."""


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
