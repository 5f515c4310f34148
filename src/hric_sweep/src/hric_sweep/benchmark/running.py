"""Runs of a benchmark, as tasks of a sweep."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hric_run.definition import overrides
from hric_sweep.benchmark.definition import Benchmark, Controller, arguments
from hric_sweep.engines.engine import Task
from hric_sweep.task import identity


@dataclass(frozen=True)
class Run:
    """Run of a controller in a collaboration with a body and a seed, and its task."""

    controller: str
    collaboration: str
    body: str
    seed: int
    task: Task


def runs(
    benchmark: Benchmark, experiments: Mapping[str, Any], controllers: Sequence[Controller], code: str
) -> list[Run]:
    """Return all runs; the controllers alternate, so that the first runs already allow a comparison.

    Args:
        benchmark: definition of the benchmark.
        experiments: content of the experiment files, by name.
        controllers: controllers to compare.
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
