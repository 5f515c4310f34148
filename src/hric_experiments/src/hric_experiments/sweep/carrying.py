"""Has an engine carry tasks out, one journal beside it: as many at once as it wants, what died again, the rest once."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait

from hric_experiments.sweep.engines.engine import Died, Engine, Response, Task, TimedOut
from hric_experiments.sweep.journal import Journal

TRIES = 3
"""Of a run that ends its worker, or takes too long; after them it is marked and not tried any more."""
LOOK = 0.5
"""Longest time without a look at Ctrl-C [s]."""


def carry_out(
    tasks: Sequence[Task],
    engine: Engine,
    journal: Journal | None,
    ended: Callable[[Response], object] = lambda entry: None,
    looked: Callable[[], object] = lambda: None,
) -> list[Response]:
    """The responses to all tasks, in their order, each with the attempt in which it came.

    Args:
        tasks: each with an index of its own; ids may repeat, where a point does.
        engine: carries them out.
        journal: keeps each response as it comes; what it has is not run again. None: nothing is kept.
        ended: called with each response, those of the journal first.
        looked: called each time that something may have ended.

    Raises:
        JournalError: what ended cannot be kept.
        KeyboardInterrupt: all that ended is kept.
        Exception: of an engine that cannot go on; it is no response, and not in the journal.
    """
    known = {} if journal is None else {entry["id"]: entry for entry in journal.entries}
    found: dict[int, Response] = {}

    def end(task: Task, response: Response) -> None:
        found[task["index"]] = entry = {**response, "index": task["index"]}
        ended(entry)

    for task in tasks:
        if task["id"] in known:
            end(task, known[task["id"]])
    for task, response in _carried([task for task in tasks if task["index"] not in found], engine, looked):
        if journal is not None:
            journal.append(response)
        end(task, response)
    return [found[task["index"]] for task in tasks]


def _carried(tasks: Sequence[Task], engine: Engine, looked: Callable[[], object]) -> Iterator[tuple[Task, Response]]:
    """Tasks and their responses, as they come."""
    waiting: deque[tuple[Task, int]] = deque((task, 1) for task in tasks)
    open_: dict[Future[Response], tuple[Task, int]] = {}
    while waiting or open_:
        while waiting and len(open_) < engine.window:
            task, attempt = waiting.popleft()
            open_[engine.submit(task)] = task, attempt
        if not waiting:
            engine.flush()
        for future in wait(open_, LOOK, FIRST_COMPLETED).done:
            task, attempt = open_.pop(future)
            response = _response(future, task, attempt)
            if response is None:
                waiting.appendleft((task, attempt + 1))
            else:
                yield task, response
        looked()


def _response(future: "Future[Response]", task: Task, attempt: int) -> Response | None:
    """What came of a task; None: it is tried again."""
    try:
        return {**future.result(), "attempt": attempt}
    except (Died, TimedOut) as error:
        return None if attempt < TRIES else {**_poison(task, str(error)), "attempt": attempt}


def _poison(task: Task, why: str) -> Response:
    return {
        "id": task["id"],
        "index": task["index"],
        "outputs": dict.fromkeys(task["outputs"]),
        "failure": f"poison: {why} in each of {TRIES} tries",
        "state_sha256": "",
        "processor": None,
        "wall": None,
        "host": "",
    }
