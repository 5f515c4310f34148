"""Execution of tasks by an engine, with a journal; tasks whose worker died or timed out are tried again."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import replace
from queue import SimpleQueue

from hric_core.processes import uninterrupted
from hric_sweep.engines.engine import Died, SweepEngine, TimedOut, arrived
from hric_sweep.journal import Journal
from hric_sweep.records import RunResponse, RunTask

TRIES = 3
"""Maximum number of attempts for a run that ends its worker or exceeds its timeout; then it counts as failed."""
LOOK = 0.5
"""Longest time between two checks for Ctrl-C [s]."""

Ended = tuple[Future[RunResponse], RunTask, int]
"""Future of a finished task, the task, and the number of the attempt."""


def execute(
    tasks: Sequence[RunTask],
    engine: SweepEngine,
    journal: Journal | None,
    on_response: Callable[[RunResponse], object] = lambda response: None,
    on_check: Callable[[], object] = lambda: None,
) -> list[RunResponse]:
    """Execute all tasks; return their responses in the order of the tasks, each with the number of its attempt.

    Args:
        tasks: tasks with unique indices; ids may repeat if the same point is sampled more than once.
        engine: engine that executes the tasks.
        journal: file for the responses; tasks whose response it already contains are not run. None: no file.
        on_response: callback for each response, those from the journal first.
        on_check: callback after each check for finished tasks, at least every `LOOK` seconds.

    Raises:
        JournalError: the responses cannot be stored.
        KeyboardInterrupt: Ctrl-C; all finished responses are stored.
        Exception: the engine cannot continue; the error is not stored in the journal.
    """
    known = {} if journal is None else {entry.id: entry for entry in journal.entries}
    responses: dict[int, RunResponse] = {}

    def end(task: RunTask, response: RunResponse) -> None:
        responses[task.index] = replace(response, index=task.index)
        on_response(responses[task.index])

    for task in tasks:
        if task.id in known:
            end(task, known[task.id])
    for pairs in _executed([task for task in tasks if task.index not in responses], engine, on_check):
        with uninterrupted():  # the journal and the table then contain the same runs
            if journal is not None:
                journal.append([response for _, response in pairs])
            for task, response in pairs:
                end(task, response)
    return [responses[task.index] for task in tasks]


def _executed(
    tasks: Sequence[RunTask], engine: SweepEngine, on_check: Callable[[], object]
) -> Iterator[list[tuple[RunTask, RunResponse]]]:
    """Yield finished tasks with their responses, in one list per check of the queue."""
    waiting: deque[tuple[RunTask, int]] = deque((task, 1) for task in tasks)
    ended: SimpleQueue[Ended] = SimpleQueue()
    running = 0
    while waiting or running:
        while waiting and running < engine.window:
            _begin(engine, *waiting.popleft(), ended)
            running += 1
        if not waiting:
            engine.flush()
        pairs, broken = list[tuple[RunTask, RunResponse]](), list[BaseException]()
        for future, task, attempt in arrived(ended, LOOK):
            running -= 1
            error = future.exception()
            if error is None:
                pairs.append((task, replace(future.result(), attempt=attempt)))
            elif not isinstance(error, Died | TimedOut):
                broken.append(error)
            elif attempt < TRIES:
                waiting.appendleft((task, attempt + 1))
            else:
                failure = f"failed in each of {TRIES} attempts: {error}"
                poison = RunResponse(task.id, task.index, dict.fromkeys(task.outputs), failure, attempt=attempt)
                pairs.append((task, poison))
        if pairs:
            yield pairs
        if broken:
            raise broken[0]
        on_check()


def _begin(engine: SweepEngine, task: RunTask, attempt: int, ended: "SimpleQueue[Ended]") -> None:
    engine.submit(task).add_done_callback(lambda future: ended.put((future, task, attempt)))
