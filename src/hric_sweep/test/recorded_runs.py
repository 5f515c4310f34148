"""Headless runs recorded in memory, for tests of readers of bags."""

from collections.abc import Iterator
from functools import cache

from bag_mutations import RawBag
from mutation_law import Recorded
from std_msgs.msg import String

from hric_assessment.verdict.choices import AssessmentChoices
from hric_bags.memory import MemoryBag
from hric_run import provenance
from hric_run.definition import experiment
from hric_run.definition.experiment import Experiment, to_dict
from hric_run.simulation import Simulation
from hric_sweep.benchmark import definition
from hric_sweep.benchmark.definition import BenchmarkRun
from hric_sweep.records import RunTask
from hric_sweep.task import definition_of

AREA = 4e-4
"""Contact area [m^2]."""


def recorded(name: str, what: Experiment, seed: int = 0, area: float = AREA) -> Recorded:
    """Run an experiment; return its messages and the contents of run.yaml; `area`: contact area [m^2]."""
    bag = MemoryBag()
    with Simulation(what, seed=seed) as simulation:
        bag.write("/robot_description", String(simulation.tree["robot_description"]), 0.0)
        for early in simulation.early:
            bag.write(*early)
        simulation.node.tap(bag.write)
        simulation.run()
        run = {
            "experiment": what.name,
            "definition": to_dict(what),
            "parameters": provenance.parameters(simulation.tree),
            "limits": simulation.limits,
        }
        description = simulation.tree["robot_description"]
    return Recorded(
        name, RawBag(bag.messages(), bag.connections), run, description, AssessmentChoices(contact_area=area)
    )


def shipped(name: str, *overrides: str, seed: int = 0, area: float = AREA) -> Recorded:
    """Record an experiment of this workspace."""
    return recorded(" ".join([name, *overrides]), experiment.load(name, overrides), seed, area)


def benchmark() -> Iterator[Recorded]:
    """Record all runs of the benchmark with its reference controllers, one after the other."""
    yield from map(_of, _runs())


def of_benchmark(collaboration: str, controller: str, body: str, seed: int, area: float = AREA) -> Recorded:
    """Record one run of the benchmark."""
    return _of(BenchmarkRun(controller, collaboration, body, seed), area)


@cache
def _runs() -> dict[BenchmarkRun, RunTask]:
    what, content = definition.load()
    controllers = [definition.controller(name, what) for name in definition.references()]
    return definition.runs(what, content["experiments"], controllers, "")


def _of(run: BenchmarkRun, area: float = AREA) -> Recorded:
    name = f"{run.collaboration}, {run.controller}, {run.body}, seed {run.seed}"
    return recorded(name, definition_of(_runs()[run]), run.seed, area)
