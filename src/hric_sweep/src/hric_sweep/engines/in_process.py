"""Engine that executes one task after the other in this process."""

from concurrent.futures import Future

from hric_sweep import task as runs
from hric_sweep.records import ReferenceRun, RunResponse, RunTask


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
