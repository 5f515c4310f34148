"""Files of a benchmark: its definition with collaborations and scores, and one file per controller; their runs."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, TypeVar

from hric_core.errors import HricError, ParameterError, UnknownNameError, message_about
from hric_core.parameters import (
    Mistakes,
    choice,
    listing,
    mapping,
    number,
    read_yaml,
    section,
    text,
    unknown,
    whole,
)
from hric_run import simulation
from hric_run.definition import experiment, overrides
from hric_run.definition.experiment import ExperimentError
from hric_sweep.outputs import SweepOutput
from hric_sweep.records import PlainData, RunTask
from hric_sweep.registry import FileSettings, file_of

T = TypeVar("T")
NAME = "collaborations"
"""Name of the definition that comes with the workspace."""
FINDINGS, ERGONOMICS, TASK = "findings", "ergonomics", "task"
CATEGORIES = (FINDINGS, ERGONOMICS, TASK)
"""Categories that have scores; robustness follows from all of them."""
EXAMPLE = """\
description: my controller
changes:
  hand_guidance: ["parameters.cartesian_impedance_controller.translational_stiffness:=150"]
  contact: ["kp:=80", "kd:=15"]
"""
OVERRIDES: Any = listing(text(empty=False), default=(), different=True)


@dataclass(frozen=True)
class Score(SweepOutput):
    """Quantity that is computed for each run and by which controllers are compared."""

    limit: float | None = number(
        None,
        text="largest accepted value, or smallest if larger is better; beyond it, a finding is out of limits and a "
        "task "
        "is not completed",
    )
    better: str = choice("smaller", "larger", text="values that are better: smaller or larger ones")

    @property
    def sign(self) -> float:
        """Sign of the score: 1 if smaller is better, else -1."""
        return 1.0 if self.better == "smaller" else -1.0

    def beyond(self, value: float) -> bool:
        """Return True if there is a limit and the value is on its bad side."""
        return self.limit is not None and self.sign * value > self.sign * self.limit


SCORES: Any = mapping(section(Score), text="scores by name")


@dataclass(frozen=True)
class Collaboration(FileSettings):
    """Collaborative task of the benchmark: an experiment with scores; `name` is its name within the benchmark."""

    name: str = ""
    extends: str = text(empty=False, text="the experiment: its name, or the path of its YAML file")
    changes: tuple[str, ...] = listing(
        text(empty=False), default=(), text="overrides of the experiment in all its runs"
    )
    findings: Mapping[str, Score] = mapping(section(Score), text="scores that have a limit")
    ergonomics: Mapping[str, Score] = mapping(section(Score), text="scores of the person's physical load")
    task: Mapping[str, Score] = mapping(section(Score), text="scores of task time and error")

    def scores(self, category: str) -> Mapping[str, Score]:
        """Return the scores of one of CATEGORIES, by name."""
        scores: Mapping[str, Score] = getattr(self, category)
        return scores

    @property
    def all(self) -> dict[str, Score]:
        """Scores by `CATEGORY.NAME`."""
        return {f"{category}.{name}": s for category in CATEGORIES for name, s in self.scores(category).items()}


@dataclass(frozen=True)
class BenchmarkPopulation(FileSettings):
    """Population of the benchmark: the bodies of its simulated persons."""

    name: str = text(empty=False, text="name of the population")
    source: str = text("", text="source of the body percentiles")
    bodies: Mapping[str, str] = mapping(
        text(empty=False), text="subject file of each body, by a short name such as p50"
    )


@dataclass(frozen=True)
class Benchmark(FileSettings):
    """Checked definition of a benchmark."""

    description: str = text("", text="one-line description")
    population: BenchmarkPopulation = section(BenchmarkPopulation)
    seeds: tuple[int, ...] = listing(whole(minimum=0), range(1, 1000), different=True, text="seeds; each gives one run")
    changes: tuple[str, ...] = listing(text(empty=False), default=(), text="overrides of the experiments in all runs")
    tolerance: float = number(
        0.02,
        minimum=0.0,
        maximum=1.0,
        text="relative difference up to which two values count as equal, for ranks and --compare",
    )
    timeout: float = number(
        600.0, above=0.0, unit="s", text="limit of processor time per run, and of wall time without progress"
    )
    collaborations: Mapping[str, Collaboration] = mapping(
        section(Collaboration),
        made=lambda items: {name: replace(item, name=name) for name, item in items.items()},
        text="collaborations by name",
    )

    def only(self, collaborations: Sequence[str], bodies: Sequence[str], seeds: int | None) -> "Benchmark":
        """Return the benchmark, restricted to some collaborations, bodies and seeds.

        Args:
            collaborations: names of the collaborations; empty: all.
            bodies: names of the bodies; empty: all.
            seeds: number of seeds to use, from the first on; None: all.

        Raises:
            UnknownNameError: a name is not in the benchmark.
        """
        people = self.population
        return replace(
            self,
            collaborations=_chosen("collaboration", collaborations, self.collaborations),
            population=replace(people, bodies=_chosen("body", bodies, people.bodies)),
            seeds=self.seeds[:seeds],
        )


def _chosen(kind: str, names: Sequence[str], known: Mapping[str, T]) -> dict[str, T]:
    for name in names:
        if name not in known:
            raise UnknownNameError(kind, name, known, "benchmark")
    return {name: known[name] for name in known if not names or name in names}


@dataclass(frozen=True)
class Prediction(FileSettings):
    """Rank of a controller that its author predicts from its design."""

    rank: int = whole(
        minimum=1,
        text="rank that you expect among the controllers with a prediction; results show it next to the actual rank",
    )
    text: str = text(empty=False, text="reason for the prediction")


@dataclass(frozen=True)
class BenchmarkController(FileSettings):
    """Checked file of a controller; `name` is the file name without its ending."""

    name: str = ""
    description: str = text("", text="one-line description")
    prediction: Prediction | None = section(
        Prediction, None, text="rank predicted from its design; none: no prediction"
    )
    changes: Mapping[str, tuple[str, ...]] = mapping(
        OVERRIDES,
        text="overrides by name of the collaboration: which controllers run, of which type and with which gains",
    )


def load(path: Path | None = None) -> tuple[Benchmark, PlainData]:
    """Read and check the definition of a benchmark.

    Args:
        path: path of a YAML file; None: the definition that comes with the workspace.

    Returns:
        The definition, and the content of its file and of the experiment files as plain data.

    Raises:
        HricError: the file has mistakes; the message lists all of them.
    """
    path = path or folder() / f"{NAME}.yaml"
    content = read_yaml(path)
    try:
        benchmark = Benchmark.of(content, "")
    except ParameterError as error:
        raise ExperimentError(message_about(f"benchmark {path.stem}", error)) from error
    experiments = {item.extends: experiment.read(item.extends) for item in benchmark.collaborations.values()}
    return benchmark, plain({"benchmark": content, "experiments": experiments})


def folder() -> Path:
    """Return the folder with the benchmark's definition and reference controllers."""
    return experiment.config_path("benchmark")


def references() -> list[str]:
    """Return the names of the reference controllers."""
    return sorted(path.stem for path in (folder() / "controllers").glob("*.yaml"))


def controller(name: str, benchmark: Benchmark) -> BenchmarkController:
    """Read and check the file of a controller; also check the experiments with its overrides.

    Args:
        name: name of a reference controller, or path of a YAML file.
        benchmark: benchmark whose collaborations the controller overrides.

    Raises:
        HricError: the controller does not exist, or its file has mistakes, all of them listed at once.
    """
    path = file_of(name, "controller", folder() / "controllers")
    try:
        checked = replace(BenchmarkController.of(read_yaml(path), ""), name=path.stem)
        _check(checked, benchmark)
    except HricError as error:
        example = "\n".join(f"  {line}" for line in EXAMPLE.splitlines())
        hint = "" if name in references() else f"\nexample of a controller's file:\n{example}"
        raise ExperimentError(f"{message_about(f'controller {path.stem}', error)}{hint}") from error
    return checked


def _check(controller: BenchmarkController, benchmark: Benchmark) -> None:
    mistakes, body = Mistakes(), next(iter(benchmark.population.bodies.values()))
    known = {**load()[0].collaborations, **benchmark.collaborations}
    for name in controller.changes:
        with mistakes.noted():
            if name not in known:
                raise unknown("collaboration", name, known, f"changes.{name}")
            words = arguments(benchmark, known[name], controller, body)
            try:
                content = overrides.apply(experiment.read(known[name].extends), words)
                simulation.check(experiment.parse(name, content))
            except HricError as error:
                raise ParameterError(f"changes.{name}: {error}") from error
    mistakes.raise_all()


def arguments(benchmark: Benchmark, collaboration: Collaboration, by: BenchmarkController, subject: str) -> list[str]:
    """Return the overrides of a run in order: benchmark, collaboration, body, controller; the last one wins."""
    body = f"human.subject:={subject}"
    return [*benchmark.changes, *collaboration.changes, body, *by.changes.get(collaboration.name, ())]


@dataclass(frozen=True)
class BenchmarkRun:
    """Key of one run: a controller in a collaboration, with a body and a seed."""

    controller: str
    collaboration: str
    body: str
    seed: int


def runs(
    benchmark: Benchmark, experiments: PlainData, controllers: Sequence[BenchmarkController], code: str
) -> dict[BenchmarkRun, RunTask]:
    """Return the task of each run; controllers alternate, so that the first runs already allow a comparison.

    Args:
        benchmark: definition of the benchmark.
        experiments: content of the experiment files, by name.
        controllers: controllers to compare.
        code: version of the code.
    """
    tasks: dict[BenchmarkRun, RunTask] = {}
    items = product(
        benchmark.seeds, benchmark.population.bodies.items(), benchmark.collaborations.values(), controllers
    )
    for index, (seed, (body, subject), item, by) in enumerate(items):
        changes = dict(map(overrides.split, arguments(benchmark, item, by, subject)))
        about = (index, item.extends, experiments[item.extends], changes, seed)
        tasks[BenchmarkRun(by.name, item.name, body, seed)] = RunTask(*about, item.all, benchmark.timeout, code)
    return tasks


def plain(content: Any) -> PlainData:
    """Return content with JSON types only: tuples become lists, unknown objects become text."""
    represented: PlainData = json.loads(json.dumps(content, default=str))
    return represented


def digest(content: Any) -> str:
    """Return the SHA-256 of plain data, in hexadecimal."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def limits_digest() -> str:
    """Return the SHA-256 of all tables of limits in hric_assessment, in hexadecimal."""
    digest = hashlib.sha256()
    for path in sorted((experiment.package_path("hric_assessment") / "config" / "tables").glob("*.yaml")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()
