"""Code of a Dask worker: executes a chunk of tasks, each run in a separate process that is reused.

A run that hangs, ends its process or takes all memory fails alone, as on one machine; the Dask worker continues.
Nothing here imports Dask, except the check whether the chunk is still needed.
"""

import multiprocessing
import pickle
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import wait
from dataclasses import dataclass
from typing import Any

from hric_sweep.engines.engine import difference
from hric_sweep.engines.pebble_engine import PebbleEngine
from hric_sweep.records import ReferenceRun, RunResponse, RunTask

LOOK = 1.0
"""Longest time between two checks whether the chunk is still needed [s]."""


@dataclass(frozen=True)
class Handshake:
    """Requirements that a worker must meet before it gets work.

    Args:
        session: name of the supervisor's connection.
        memory: memory limit of a run [bytes].
        reference: task of the reference run.
        expected: expected response to the reference run; None: not yet known.
    """

    session: str
    memory: float
    reference: RunTask
    expected: ReferenceRun | None = None


@dataclass(frozen=True)
class TaskChunk:
    """Tasks that are sent together, with the handshake for a worker that joined later."""

    tasks: Sequence[RunTask]
    handshake: Handshake


@dataclass(frozen=True)
class ChunkResult:
    """Result of a chunk.

    Attributes:
        worker: address of the worker.
        outcomes: response to each task in order, or the TimedOut or Died of its run (any other error is a bug).
        differs: reason why the worker must not execute the chunk; empty: it may.
    """

    worker: str
    outcomes: Sequence[RunResponse | BaseException]
    differs: str = ""


class _WorkerState:
    """State that this process keeps between chunks."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._memory = 0.0
        self._engine: PebbleEngine | None = None
        self._references: dict[str, ReferenceRun] = {}

    def engine(self, memory: float) -> PebbleEngine:
        """Return the engine with the process for runs, whose memory limit is `memory` [bytes]."""
        with self._lock:
            if self._engine is None or self._memory != memory:
                self._drop()
                # A daemon may not have child processes; these end with it anyway.
                multiprocessing.current_process().daemon = False
                self._engine, self._memory = PebbleEngine(1, memory), memory
            return self._engine

    def reference(self, handshake: Handshake) -> ReferenceRun:
        """Return the result of the reference run. Raises Differs: the process for runs has different code."""
        if handshake.session not in self._references:
            self._references[handshake.session] = self.engine(handshake.memory).check(handshake.reference)
        return self._references[handshake.session]

    def drop(self) -> None:
        """Kill the process for runs, whatever it is doing."""
        with self._lock:
            self._drop()

    def _drop(self) -> None:
        if self._engine is not None:
            self._engine.close(now=True)
            self._engine = None


_cached = _WorkerState()


def reference(packed: bytes) -> ReferenceRun:
    """Execute the reference run and return its result.

    Args:
        packed: pickled Handshake.

    Raises:
        Differs: the code has changed since this worker was started.
    """
    return _cached.reference(pickle.loads(packed))


def execute(packed: bytes) -> ChunkResult:
    """Execute a chunk and return its result, without outcomes if the chunk is no longer needed.

    Args:
        packed: pickled Chunk.
    """
    chunk: TaskChunk = pickle.loads(packed)
    address, needed = _current_task()
    handshake = chunk.handshake
    if handshake.expected is not None:
        differs = difference(handshake.expected, _cached.reference(handshake))
        if differs:
            return ChunkResult(address, [], differs)
    engine = _cached.engine(handshake.memory)
    futures = [engine.submit(task) for task in chunk.tasks]
    while wait(futures, LOOK).not_done:
        if not needed():
            _cached.drop()
            return ChunkResult(address, [])
    return ChunkResult(address, [future.exception() or future.result() for future in futures])


def _current_task() -> tuple[str, Callable[[], bool]]:
    """Return the address of this worker, and a function that is True while the task of this thread is needed.

    It is not needed any more if the supervisor has ended or was interrupted.
    """
    from distributed import get_worker

    worker: Any = get_worker()
    key = worker.get_current_task()

    def needed() -> bool:
        state = worker.state.tasks.get(key)
        return state is not None and state.state not in ("cancelled", "released", "forgotten")

    return str(worker.address), needed
