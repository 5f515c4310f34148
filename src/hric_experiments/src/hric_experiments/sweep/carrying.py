"""Has an engine carry tasks out, one journal beside it: as many at once as it wants, what died again, the rest once."""

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from queue import SimpleQueue

from hric_experiments.sweep.engines.engine import Died, Engine, Response, Task, TimedOut, arrived
from hric_experiments.sweep.journal import Journal

TRIES = 3
"""Of a run that ends its worker, or takes too long; after them it is marked and not tried any more."""
LOOK = 0.5
"""Longest time without a look at Ctrl-C [s]."""

Ended = tuple[Future[Response], Task, int]
"""What came, of which task, in which attempt."""


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
    for pairs in _carried([task for task in tasks if task["index"] not in found], engine, looked):
        with _uninterrupted():
            if journal is not None:
                journal.append([response for _, response in pairs])
            for task, response in pairs:
                end(task, response)
    return [found[task["index"]] for task in tasks]


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C and SIGTERM back to the end of the block, so that the journal and the table have the same runs."""
    if threading.current_thread() is not threading.main_thread():  # it gets no signals
        yield
        return
    held: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _: held.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for caught in held:
            signal.raise_signal(caught)


def _carried(
    tasks: Sequence[Task], engine: Engine, looked: Callable[[], object]
) -> Iterator[list[tuple[Task, Response]]]:
    """Tasks and their responses, as they come; together those that have come by the time of a look."""
    waiting: deque[tuple[Task, int]] = deque((task, 1) for task in tasks)
    ended: SimpleQueue[Ended] = SimpleQueue()
    open_ = 0
    while waiting or open_:
        while waiting and open_ < engine.window:
            _begin(engine, *waiting.popleft(), ended)
            open_ += 1
        if not waiting:
            engine.flush()
        pairs, broken = list[tuple[Task, Response]](), list[BaseException]()
        for future, task, attempt in arrived(ended, LOOK):
            open_ -= 1
            error = future.exception()
            if error is None:
                pairs.append((task, {**future.result(), "attempt": attempt}))
            elif not isinstance(error, Died | TimedOut):
                broken.append(error)
            elif attempt < TRIES:
                waiting.appendleft((task, attempt + 1))
            else:
                pairs.append((task, {**_poison(task, str(error)), "attempt": attempt}))
        if pairs:
            yield pairs
        if broken:
            raise broken[0]
        looked()


def _begin(engine: Engine, task: Task, attempt: int, ended: "SimpleQueue[Ended]") -> None:
    engine.submit(task).add_done_callback(lambda future: ended.put((future, task, attempt)))


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
