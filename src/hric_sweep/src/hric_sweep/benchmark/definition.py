"""Definition of a benchmark, with its runs and scores, and the file of each controller."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hric_core.errors import HricError, ParameterError, UnknownNameError, message_about
from hric_core.parameters import (
    Mistakes,
    Settings,
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
from hric_sweep.outputs import Output

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
class Score(Output):
    """Number of each run by which controllers are compared."""

    separator = "."
    limit: float | None = number(
        None,
        text="largest value that is accepted, or smallest where larger is better: a finding beyond it is out of "
        "limits, a task beyond it not completed",
    )
    better: str = choice("smaller", "larger", text="which of two values is the better one")

    @property
    def sign(self) -> float:
        """Sign of the score: 1 if smaller is better, else -1."""
        return 1.0 if self.better == "smaller" else -1.0

    def beyond(self, value: float) -> bool:
        """Return True if a value is beyond the limit."""
        return self.limit is not None and self.sign * value > self.sign * self.limit


SCORES: Any = mapping(section(Score), text="scores by name")


@dataclass(frozen=True)
class Collaboration(Settings):
    """Experiment of the benchmark; `name` is its name within the benchmark."""

    separator = "."
    name: str = ""
    extends: str = text(empty=False, text="the experiment: its name, or the path of its YAML file")
    changes: tuple[str, ...] = listing(text(empty=False), default=(), text="overrides of all its runs")
    findings: Mapping[str, Score] = mapping(section(Score), text="scores that have a limit")
    ergonomics: Mapping[str, Score] = mapping(section(Score), text="scores of what it costs the person")
    task: Mapping[str, Score] = mapping(section(Score), text="scores of time and error")

    def scores(self, category: str) -> Mapping[str, Score]:
        """Return the scores of one of CATEGORIES, by name."""
        found: Mapping[str, Score] = getattr(self, category)
        return found

    @property
    def all(self) -> dict[tuple[str, str], Score]:
        """Scores by category and name."""
        return {(category, name): one for category in CATEGORIES for name, one in self.scores(category).items()}


@dataclass(frozen=True)
class Population(Settings):
    """Bodies of the persons in the benchmark."""

    separator = "."
    name: str = text(empty=False, text="of the population")
    source: str = text("", text="where its percentiles are from")
    bodies: Mapping[str, str] = mapping(text(empty=False), text="subject of each body, by a short name such as p50")


@dataclass(frozen=True)
class Benchmark(Settings):
    """Checked definition of a benchmark."""

    separator = "."
    description: str = text("", text="one line for people")
    population: Population = section(Population)
    seeds: tuple[int, ...] = listing(whole(minimum=0), range(1, 1000), different=True, text="one run each")
    changes: tuple[str, ...] = listing(text(empty=False), default=(), text="overrides of all runs")
    tolerance: float = number(
        0.02, minimum=0.0, maximum=1.0, text="share of a value within which two are the same, for ranks and --compare"
    )
    timeout: float = number(
        600.0, above=0.0, unit="s", text="of processor time for one run, and of wall time in which it does nothing"
    )
    collaborations: Mapping[str, Collaboration] = mapping(
        section(Collaboration),
        made=lambda given: {name: replace(one, name=name) for name, one in given.items()},
        text="by name",
    )

    def only(self, collaborations: Sequence[str], bodies: Sequence[str], seeds: int | None) -> "Benchmark":
        """Return a part of the benchmark.

        Args:
            collaborations: names of the collaborations; empty: all.
            bodies: names of the bodies; empty: all.
            seeds: number of seeds, the first ones; None: all.

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


def _chosen(kind: str, names: Sequence[str], known: Mapping[str, Any]) -> dict[str, Any]:
    for name in names:
        if name not in known:
            raise UnknownNameError(kind, name, known, "benchmark")
    return {name: known[name] for name in known if not names or name in names}


@dataclass(frozen=True)
class Prediction(Settings):
    """Rank that a controller's design predicts."""

    separator = "."
    rank: int = whole(minimum=1, text="among the reference controllers")
    text: str = text(empty=False, text="why")


@dataclass(frozen=True)
class Controller(Settings):
    """Checked file of a controller; `name` is the file name without its ending."""

    separator = "."
    name: str = ""
    description: str = text("", text="one line for people")
    prediction: Prediction | None = section(Prediction, None, text="what its design says of the result; none: nothing")
    changes: Mapping[str, tuple[str, ...]] = mapping(
        OVERRIDES,
        text="overrides of each collaboration, by its name: which controllers, of which type and with which gains",
    )


def load(path: Path | None = None) -> tuple[Benchmark, dict[str, Any]]:
    """Read and check a definition.

    Args:
        path: path of a YAML file; None: the definition that comes with the workspace.

    Returns:
        The definition, and its content as plain data, including that of its experiments.

    Raises:
        HricError: mistakes, all of them at once.
    """
    path = path or folder() / f"{NAME}.yaml"
    content = read_yaml(path)
    try:
        found = Benchmark.of(content, "")
    except ParameterError as error:
        raise ExperimentError(message_about(f"benchmark {path.stem}", error)) from error
    experiments = {one.extends: experiment.read(one.extends) for one in found.collaborations.values()}
    return found, plain({"benchmark": content, "experiments": experiments})


def folder() -> Path:
    """Return the folder of the definition and the reference controllers."""
    return experiment.config_path("benchmark")


def references() -> list[str]:
    """Return the names of the reference controllers."""
    return sorted(path.stem for path in (folder() / "controllers").glob("*.yaml"))


def controller(name: str, benchmark: Benchmark) -> Controller:
    """Read and check the file of a controller, including each run that it changes.

    Args:
        name: name of a reference controller, or path of a YAML file.
        benchmark: benchmark whose collaborations it changes.

    Raises:
        HricError: the controller does not exist, or its file has mistakes, all of them listed at once.
    """
    if name.endswith((".yaml", ".yml")):
        path = Path(name).expanduser()
    elif name in references():
        path = folder() / "controllers" / f"{name}.yaml"
    else:
        raise UnknownNameError("controller", name, references(), "benchmark; or the path of a YAML file")
    try:
        found = replace(Controller.of(read_yaml(path), ""), name=path.stem)
        _check(found, benchmark)
    except HricError as error:
        example = "\n".join(f"  {line}" for line in EXAMPLE.splitlines())
        own = "" if name in references() else f"\na controller's file, for example:\n{example}"
        raise ExperimentError(f"{message_about(f'controller {path.stem}', error)}{own}") from error
    return found


def _check(found: Controller, benchmark: Benchmark) -> None:
    mistakes, body = Mistakes(), next(iter(benchmark.population.bodies.values()))
    known = {**load()[0].collaborations, **benchmark.collaborations}
    for name in found.changes:
        with mistakes.noted():
            if name not in known:
                raise unknown("collaboration", name, known, f"changes.{name}")
            one = benchmark.collaborations.get(name, known[name])
            try:
                words = arguments(benchmark, one, found, body)
                simulation.check(experiment.parse(name, overrides.apply(experiment.read(one.extends), words)))
            except HricError as error:
                raise ParameterError(f"changes.{name}: {error}") from error
    mistakes.raise_all()


def arguments(benchmark: Benchmark, one: Collaboration, by: Controller, subject: str) -> list[str]:
    """Return the overrides of a run: of the benchmark, the collaboration and the body, and last of the controller."""
    return [*benchmark.changes, *one.changes, f"human.subject:={subject}", *by.changes.get(one.name, ())]


def plain(content: Any) -> dict[str, Any]:
    """Return content as JSON represents it."""
    found: dict[str, Any] = json.loads(json.dumps(content, default=str))
    return found


def digest(content: Any) -> str:
    """Return the hash of plain data."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def limits_digest() -> str:
    """Return the hash of the tables with the limits for findings."""
    found = hashlib.sha256()
    for path in sorted((experiment.package_path("hric_assessment") / "config" / "tables").glob("*.yaml")):
        found.update(path.name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()
