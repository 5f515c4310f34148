"""What a Dask worker does: carries a chunk of tasks out, each run in a process of its own that is kept warm.

A run that hangs, that ends its process or takes all memory costs itself alone there, as on one machine; the Dask worker
goes on. Nothing here imports Dask, but for the question whether somebody still waits for the chunk.
"""

import multiprocessing
import pickle
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import wait
from dataclasses import dataclass
from typing import Any

from hric_sweep.engines.engine import Response, Task, difference
from hric_sweep.engines.pebble_engine import PebbleEngine

LOOK = 1.0
"""Longest time without a look whether somebody still waits for the chunk [s]."""


@dataclass(frozen=True)
class Handshake:
    """What a worker must be before it gets work.

    Args:
        session: name of the supervisor's connection.
        memory: that a run may take [bytes].
        reference: task of the reference run.
        expected: the response to it; None: not yet known.
    """

    session: str
    memory: float
    reference: Task
    expected: Response | None = None


@dataclass(frozen=True)
class Chunk:
    """Tasks that travel together, and the handshake for a worker that joined later."""

    tasks: Sequence[Task]
    handshake: Handshake


@dataclass(frozen=True)
class Carried:
    """What became of a chunk.

    Attributes:
        worker: its address.
        outcomes: in the order of the tasks: a response, or the TimedOut or Died of that run (anything else is a bug).
        differs: why the worker may not carry it out; empty: it may.
    """

    worker: str
    outcomes: Sequence[Response | BaseException]
    differs: str = ""


class _Kept:
    """What this process keeps between chunks."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._memory = 0.0
        self._engine: PebbleEngine | None = None
        self._responses: dict[str, Response] = {}

    def engine(self, memory: float) -> PebbleEngine:
        """The process of runs, which may take so much memory [bytes]."""
        with self._lock:
            if self._engine is None or self._memory != memory:
                self._drop()
                # A daemon may not have processes; these end with it by themselves.
                multiprocessing.current_process().daemon = False
                self._engine, self._memory = PebbleEngine(1, memory), memory
            return self._engine

    def response(self, handshake: Handshake) -> Response:
        """To the reference run. Raises Differs: the process of runs has other code than this one."""
        found = self._responses.get(handshake.session)
        if found is None:
            found = self.engine(handshake.memory).check(handshake.reference)
            self._responses[handshake.session] = found
        return found

    def drop(self) -> None:
        """End the process of runs, whatever it does."""
        with self._lock:
            self._drop()

    def _drop(self) -> None:
        if self._engine is not None:
            self._engine.close(now=True)
            self._engine = None


_kept = _Kept()


def reference(packed: bytes) -> Response:
    """Carry a reference run out.

    Args:
        packed: a Handshake.

    Raises:
        Differs: code has changed since this worker began.
    """
    return _kept.response(pickle.loads(packed))


def carry_out(packed: bytes) -> Carried:
    """Carry a chunk out; without those that are left when nobody waits for it any more.

    Args:
        packed: a Chunk.
    """
    chunk: Chunk = pickle.loads(packed)
    address, needed = _asked()
    handshake = chunk.handshake
    if handshake.expected is not None:
        differs = difference(handshake.expected, _kept.response(handshake))
        if differs:
            return Carried(address, [], differs)
    engine = _kept.engine(handshake.memory)
    futures = [engine.submit(task) for task in chunk.tasks]
    while wait(futures, LOOK).not_done:
        if not needed():
            _kept.drop()
            return Carried(address, [])
    return Carried(address, [future.exception() or future.result() for future in futures])


def _asked() -> tuple[str, Callable[[], bool]]:
    """Address of this worker, and whether the task of this thread is still needed: a supervisor that ended or was
    interrupted wants none."""
    from distributed import get_worker

    worker: Any = get_worker()
    key = worker.get_current_task()

    def needed() -> bool:
        state = worker.state.tasks.get(key)
        return state is not None and state.state not in ("cancelled", "released", "forgotten")

    return str(worker.address), needed
