"""What a cluster costs beside its runs: two real workers, and two hundred whose runs only take time. Prints the figures
of docs/howto/cluster.md."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from dask_cluster import ENOUGH, Cluster, started
from distributed import Client

from hric_sweep import definition
from hric_sweep.engines import dask_engine
from hric_sweep.engines.dask_engine import CHUNK, DaskEngine
from hric_sweep.execution import execute
from hric_sweep.journal import Journal
from hric_sweep.records import RunResponse, RunTask
from hric_sweep.task import code_version

pytestmark = [pytest.mark.slow, pytest.mark.alone]
RUNS = 160
"""Number of runs for a few real workers."""
WORKERS, PROCESSES, SLEEPING = 200, 4, 20_000
"""Number of sleeping workers, of the processes that contain them, and of their runs."""
SLEEPS = (0.1, 0.5)
"""Durations of a run [s]; 200 workers with runs of 0.1 s load a scheduler like 1000 with runs of 0.5 s."""
MEMORY = 4e9
"""Memory limit of a worker [bytes]."""


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    yield from started(tmp_path / "cluster")


def tasks(count: int, **more: Any) -> list[RunTask]:
    """Return tasks of the sweep `peak_force`."""
    plan = definition.load("peak_force", quick=False)
    drawn = np.random.default_rng(0).uniform(size=(count, len(plan.section.vary)))
    values = plan.space.values(drawn)
    return [replace(plan.task(index, row, code_version()), **more) for index, row in enumerate(values)]


@dataclass(frozen=True)
class Timed:
    """Execution of a sweep's tasks on a cluster, with its cost.

    Attributes:
        wall: wall time [s].
        own, scheduler: processor time of the sweep itself and of the scheduler [s].
        responses: responses in the order of the tasks.
    """

    wall: float
    own: float
    scheduler: float
    responses: list[RunResponse]

    def __str__(self) -> str:
        runs = len(self.responses)
        return (
            f"{runs / self.wall:.1f} runs a second; for each {1e3 * self.own / runs:.2f} ms of the sweep's own "
            f"processor, {1e3 * self.scheduler / runs:.2f} ms of the scheduler's"
        )


def timed(cluster: Cluster, workers: int, given: list[RunTask], folder: Path) -> Timed:
    """Execute tasks with a journal and measure the cost, without the handshake."""
    scheduler = psutil.Process(cluster.scheduler.pid)
    with Client(cluster.address, timeout=ENOUGH) as client:
        client.wait_for_workers(workers, timeout=ENOUGH)
    folder.mkdir()
    engine = DaskEngine(cluster.address, MEMORY)
    with Journal(folder) as journal:
        engine.check(given[0])
        assert engine.workers == workers
        spent, own, begun = sum(scheduler.cpu_times()[:2]), time.process_time(), time.monotonic()
        responses = execute(given, engine, journal)
        wall, own, spent = (
            time.monotonic() - begun,
            time.process_time() - own,
            sum(scheduler.cpu_times()[:2]) - spent,
        )
    engine.close(now=False)
    assert [one.index for one in responses] == list(range(len(given)))
    return Timed(wall, own, spent, responses)


def test_workers_are_busy_with_runs_nearly_all_the_time(tmp_path: Path, cluster: Cluster) -> None:
    for workers in (1, 2):
        cluster.start_worker()
        found = timed(cluster, workers, tasks(RUNS * workers), tmp_path / f"{workers}")
        busy = sum(one.wall or 0.0 for one in found.responses) / (workers * found.wall)
        print(f"\n{workers} real workers: {found}; {100.0 * busy:.0f} % of their time in runs")
        assert busy > 0.8


def test_two_hundred_workers_are_busy_where_tasks_travel_by_twenty(
    tmp_path: Path, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _ in range(PROCESSES):
        cluster.start_sleeping(WORKERS // PROCESSES)
    for chunk in (1, 5, CHUNK):
        monkeypatch.setattr(dask_engine, "CHUNK", chunk)
        most = timed(cluster, WORKERS, tasks(500 * chunk, timeout=0.0), tmp_path / f"most_{chunk}")
        print(f"\nchunks of {chunk}: at most {most}")
        for each in SLEEPS:
            found = timed(cluster, WORKERS, tasks(SLEEPING, timeout=each), tmp_path / f"{each}_{chunk}")
            busy = SLEEPING * each / (WORKERS * found.wall)
            print(f"runs of {each:g} s: {found}; {WORKERS} workers sleep in {100.0 * busy:.0f} % of the time")
    assert busy > 0.8  # the longest runs, in the largest chunks
