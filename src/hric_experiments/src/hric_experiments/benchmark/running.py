"""Carries the runs of a benchmark out: those that the journal has not, on an engine of sweeps."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Any

from hric_experiments.benchmark.definition import Benchmark, Controller, arguments
from hric_experiments.definition import overrides
from hric_experiments.sweep.engines.engine import Died, Engine, Response, Task, TimedOut
from hric_experiments.sweep.journal import Journal
from hric_experiments.sweep.task import identity

TRIES = 3
"""Of a run that ends its worker, or takes too long."""
LOOK = 0.5
"""Longest time without a look at Ctrl-C [s]."""


@dataclass(frozen=True)
class Run:
    """One run: whose controller, which collaboration, body and seed, and its task."""

    controller: str
    collaboration: str
    body: str
    seed: int
    task: Task


def runs(
    benchmark: Benchmark, experiments: Mapping[str, Any], controllers: Sequence[Controller], code: str
) -> list[Run]:
    """All runs. The first of them are of all controllers, so that a part of them compares.

    Args:
        benchmark: what is run.
        experiments: contents of the experiment files, by name.
        controllers: whose.
        code: version of the code.
    """
    found: list[Run] = []
    for seed in benchmark.seeds:
        for body, subject in benchmark.population.bodies.items():
            for one in benchmark.collaborations.values():
                for by in controllers:
                    task: Task = {
                        "index": len(found),
                        "experiment": {"name": one.extends, "content": experiments[one.extends]},
                        "changes": dict(map(overrides.split, arguments(benchmark, one, by, subject))),
                        "seed": seed,
                        "outputs": {
                            f"{category}.{name}": {key: getattr(score, key) for key in ("path", "reduce", "otherwise")}
                            for (category, name), score in one.all.items()
                        },
                        "timeout": benchmark.timeout,
                    }
                    found.append(Run(by.name, one.name, body, seed, {"id": identity(task, code), **task}))
    return found


def carry_out(
    todo: Sequence[Run], engine: Engine, journal: Journal, ended: Callable[[], object] = lambda: None
) -> list[dict[str, Any]]:
    """The responses of all runs, in their order; those that the journal has are not run again.

    Args:
        todo: the runs.
        engine: carries them out.
        journal: keeps each response as it comes.
        ended: called with each run that has ended, and for those of before.

    Raises:
        JournalError: what ended cannot be kept.
        KeyboardInterrupt: all that ended is kept.
    """
    responses = {entry["id"]: entry for entry in journal.entries}
    waiting: deque[tuple[Run, int]] = deque()
    for one in todo:
        if one.task["id"] in responses:
            ended()
        else:
            waiting.append((one, 1))
    open_: dict[Future[Response], tuple[Run, int]] = {}
    while waiting or open_:
        while waiting and len(open_) < engine.window:
            one, attempt = waiting.popleft()
            open_[engine.submit(one.task)] = one, attempt
        for future in wait(open_, LOOK, FIRST_COMPLETED).done:
            one, attempt = open_.pop(future)
            try:
                response = future.result()
            except (Died, TimedOut) as error:
                if attempt < TRIES:
                    waiting.appendleft((one, attempt + 1))
                    continue
                response = _lost(one, str(error))
            journal.append(response)
            responses[one.task["id"]] = response
            ended()
    return [responses[one.task["id"]] for one in todo]


def _lost(one: Run, why: str) -> Response:
    return {
        "id": one.task["id"],
        "index": one.task["index"],
        "outputs": dict.fromkeys(one.task["outputs"]),
        "failure": f"{why} in each of {TRIES} tries",
        "state_sha256": "",
        "processor": None,
        "wall": None,
        "host": "",
    }
