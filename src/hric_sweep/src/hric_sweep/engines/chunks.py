"""Code that a Dask worker executes: it runs a chunk of tasks in one child process, which is reused.

A run that hangs, ends its process or takes all memory fails alone, as on one machine; the Dask worker continues.
Only the check whether the chunk is still needed imports Dask.
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
    """Data by which a worker proves, before it gets work, that its runs give the expected results.

    Args:
        session: name of the supervisor's connection.
        memory: memory limit of a run [bytes].
        reference: task of the reference run, which every worker executes for comparison.
        expected: expected response to the reference run; None: not yet known.
    """

    session: str
    memory: float
    reference: RunTask
    expected: ReferenceRun | None = None


@dataclass(frozen=True)
class TaskChunk:
    """Tasks that are sent to a worker together, with the handshake for a worker that joined after the start."""

    tasks: Sequence[RunTask]
    handshake: Handshake


@dataclass(frozen=True)
class ChunkResult:
    """Result of a chunk.

    Attributes:
        worker: address of the worker.
        outcomes: response to each task in order, or its error: TimedOut or Died if the run failed, else a bug.
        differs: reason why the worker may not execute runs of this sweep; empty: it may.
    """

    worker: str
    outcomes: Sequence[RunResponse | BaseException]
    differs: str = ""


class _WorkerState:
    """State of the Dask worker's process between chunks: the engine and the results of reference runs."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._memory = 0.0
        self._engine: PebbleEngine | None = None
        self._references: dict[str, ReferenceRun] = {}

    def engine(self, memory: float) -> PebbleEngine:
        """Return the engine with the child process that executes runs; `memory`: its memory limit [bytes]."""
        with self._lock:
            if self._engine is None or self._memory != memory:
                self._drop()
                # A daemon may not have child processes; these end with it anyway.
                multiprocessing.current_process().daemon = False
                self._engine, self._memory = PebbleEngine(1, memory), memory
            return self._engine

    def reference(self, handshake: Handshake) -> ReferenceRun:
        """Return the result of the reference run. Raises Differs: the child process has different code."""
        if handshake.session not in self._references:
            self._references[handshake.session] = self.engine(handshake.memory).check(handshake.reference)
        return self._references[handshake.session]

    def drop(self) -> None:
        """Kill the child process that executes runs, even during a run."""
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
    """Execute a chunk of tasks; return its result, without outcomes if the chunk is no longer needed.

    Args:
        packed: pickled TaskChunk.
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
    """Return this worker's address, and a function that returns True while the current Dask task is needed.

    A task is no longer needed if the sweep has ended or was interrupted.
    """
    from distributed import get_worker

    worker: Any = get_worker()
    key = worker.get_current_task()

    def needed() -> bool:
        state = worker.state.tasks.get(key)
        return state is not None and state.state not in ("cancelled", "released", "forgotten")

    return str(worker.address), needed
