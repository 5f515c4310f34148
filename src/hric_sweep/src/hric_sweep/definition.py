"""Sweep files: experiment, varied parameters, sampling of the runs, and the outputs stored for each run."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hric_core.errors import HricError, ParameterError, UnknownNameError, message_about
from hric_core.node import REQUIRED
from hric_core.parameters import (
    Mistakes,
    Settings,
    anything,
    choice,
    flag,
    listing,
    mapping,
    number,
    read_yaml,
    refused,
    section,
    text,
    unknown,
    whole,
)
from hric_run.definition import experiment, overrides
from hric_run.definition.experiment import ExperimentError
from hric_run.definition.overrides import in_yaml, once
from hric_sweep.outputs import Output
from hric_sweep.samplers.make import SAMPLER, make
from hric_sweep.samplers.sampler import Sampler
from hric_sweep.space import Space
from hric_sweep.variables import Variable

EXAMPLE = """\
description: how gain and payload change the step
extends: pd_step                     # an experiment
changes: ["simulator:=mujoco"]       # of all runs
sweep:
  vary:
    kp: {paths: [parameters.joint_pd_controller.kp], unit: N m/rad, distribution: {kind: uniform, low: 50, high: 200}}
  sampler: {kind: random}
  runs: 100
  outputs:
    error: {path: "setpoints.*.final_error_max", unit: rad, text: error at the end}
"""
MEMORY = 4.0
"""Default memory limit of a worker [GB]; project default, unconfirmed: a run with a human, muscles and sensors takes
less than 1."""


@dataclass(frozen=True)
class Exceedance(Settings):
    """Event whose probability is estimated: an output exceeds a limit."""

    separator = "."
    output: str = text(empty=False, text="name of the output")
    above: float | None = number(None, text="limit that it passes upwards, in its unit")
    below: float | None = number(None, text="limit that it passes downwards, in its unit")

    def check(self, where: str) -> None:
        """Refuse an exceedance with no limit or with two."""
        if (self.above is None) == (self.below is None):
            raise refused(f"{where}above, {where}below", (self.above, self.below), "one of both")

    def margin(self, value: float) -> float:
        """Return the distance of a value beyond the limit, negative on the safe side [unit of the output]."""
        return value - self.above if self.above is not None else (self.below or 0.0) - value


@dataclass(frozen=True)
class Objective(Settings):
    """Objective of a search for the worst or the best case."""

    separator = "."
    maximise: str = text("", text="name of the output; empty: minimise")
    minimise: str = text("", text="name of the output; empty: maximise")

    def check(self, where: str) -> None:
        """Refuse an objective with neither or both of `maximise` and `minimise`."""
        if bool(self.maximise) == bool(self.minimise):
            raise refused(f"{where}maximise, {where}minimise", (self.maximise, self.minimise), "one of both")

    @property
    def output(self) -> str:
        """Name of the output that is optimised."""
        return self.maximise or self.minimise

    @property
    def sign(self) -> float:
        """Sign of the objective: 1 if it is maximised, -1 if it is minimised."""
        return 1.0 if self.maximise else -1.0


@dataclass(frozen=True)
class Keep(Settings):
    """Selection of the runs whose signals are stored; each of them is repeated at the end of the sweep."""

    separator = "."
    worst: int = whole(10, minimum=0, text="runs with the most of the objective, else of the exceedance")
    failed: bool = flag(True, text="up to as many runs that failed")


@dataclass(frozen=True)
class Quick(Settings):
    """Changes of the sweep for `--quick`: fewer runs."""

    separator = "."
    runs: int = whole(8, minimum=1, text="in place of `runs`")
    changes: tuple[str, ...] = listing(text(empty=False), default=(), made=once, text="further overrides of all runs")
    sampler: Any = anything({}, default_text="none", text="keys that replace those of `sampler`")


@dataclass(frozen=True)
class SweepSection(Settings):
    """Section `sweep` of a sweep file."""

    separator = "."
    vary: Mapping[str, Variable] = mapping(section(Variable), text="variables by name: `paths`, `unit`, `distribution`")
    correlation: Any = anything((), default_text="none", text="lists of two variables and their correlation")
    sampler: Settings = SAMPLER
    runs: int | None = whole(
        None, minimum=1, maximum=10_000_000, text="how many, at most; none: the sampler knows it, as grid and list do"
    )
    seeds: str = choice(
        "each", "common", text="each: a seed for every run; common: one for all (common random numbers)"
    )
    seed: int = whole(0, minimum=0, text="of the sampler, and first of the runs")
    outputs: Mapping[str, Output] = mapping(section(Output), text="numbers of each run, by name")
    exceedance: Exceedance | None = section(Exceedance, None, text="what is counted")
    objective: Objective | None = section(Objective, None, text="what a search goes for")
    timeout: float = number(
        60.0,
        above=0.0,
        unit="s",
        text="of processor time for one run, and of wall time in which it does nothing; its worker is killed then",
    )
    memory: float = number(MEMORY, above=0.0, maximum=1000.0, unit="GB", text="that a worker may take")
    keep: Keep = section(Keep)
    quick: Quick = section(Quick)


@dataclass(frozen=True)
class Sweep(Settings):
    """Checked content of a sweep file; `name` is the file name without its ending."""

    separator = "."
    name: str = ""
    description: str = text("", text="one line for people")
    extends: str = text(empty=False, text="the experiment: its name, or the path of its YAML file")
    changes: tuple[str, ...] = listing(text(empty=False), default=(), made=once, text="overrides of all runs")
    sweep: SweepSection = section(SweepSection, REQUIRED)


@dataclass(frozen=True)
class Plan:
    """Checked sweep that is ready to run.

    Attributes:
        sweep: checked content of the sweep file.
        content: content of the sweep file as plain data.
        experiment: content of the experiment file.
        space: space of the variables.
    """

    sweep: Sweep
    content: Mapping[str, Any]
    experiment: Mapping[str, Any]
    space: Space

    @property
    def name(self) -> str:
        """Name of the sweep."""
        return self.sweep.name

    @property
    def section(self) -> SweepSection:
        """Section `sweep` of the sweep file."""
        return self.sweep.sweep

    def sampler(self) -> Sampler:
        """Return a new sampler. Raises HricError: it does not fit the variables or the number of runs."""
        return make(self.section.sampler, self.space, self.section.runs, self.section.seed)

    def changes(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the overrides of a run, by key; `values` are those of the variables, empty for the reference run."""
        found = dict(map(overrides.split, self.sweep.changes))
        for name, variable in self.section.vary.items():
            if name in values:
                found |= dict.fromkeys(variable.paths, values[name])
        return found

    def middle(self) -> dict[str, Any]:
        """Return the medians of all variables, by name."""
        return self.space.values(np.full((1, len(self.section.vary)), 0.5))[0]

    def seed(self, index: int) -> int:
        """Return the seed of the run with this index."""
        return self.section.seed + (index if self.section.seeds == "each" else 0)


def written(changes: Mapping[str, Any]) -> list[str]:
    """Return overrides as command-line arguments, `key:=value`."""
    return [f"{key}:={in_yaml(value)}" for key, value in changes.items()]


def names() -> list[str]:
    """Return the names of the sweeps that come with the workspace."""
    return experiment.names("sweeps")


def load(name: str, *, quick: bool = False) -> Plan:
    """Read and check a sweep, including everything that its runs need.

    Args:
        name: name of a sweep of the workspace, or path of a YAML file.
        quick: use the form with few runs.

    Raises:
        HricError: the sweep does not exist, or has mistakes; all of them are listed at once.
    """
    path = find(name)
    content = read_yaml(path)
    if not isinstance(content, Mapping):
        raise ExperimentError(f"{path.name} must be a mapping with description, extends, changes and sweep")
    given = dict(content)
    extends = given.get("extends")
    if isinstance(extends, str) and extends.endswith((".yaml", ".yml")):
        given["extends"] = str(path.parent / Path(extends).expanduser())
    return plan(path.stem, given, quick=quick)


def find(name: str) -> Path:
    """Return the path of a sweep file. Raises HricError: there is no such file."""
    if name.endswith((".yaml", ".yml")):
        path = Path(name).expanduser().absolute()
        if not path.is_file():
            raise ExperimentError(f"no sweep file {name}; sweeps by name: {', '.join(names())}")
        return path
    if name not in names():
        raise UnknownNameError("sweep", name, names(), "sweeps")
    return experiment.config_path("sweeps") / f"{name}.yaml"


def plan(name: str, content: Mapping[str, Any], *, quick: bool = False, base: Mapping[str, Any] | None = None) -> Plan:
    """Check the content of a sweep file, its experiment, and one run with all variables at their medians.

    Args:
        name: name of the sweep.
        content: content of the sweep file.
        quick: use the form with few runs.
        base: content of the experiment file when the sweep was started; None: read the current file.

    Raises:
        ExperimentError: mistakes, all of them at once.
    """
    mistakes = Mistakes()
    found: Plan | None = None
    try:
        with _noted(mistakes):
            sweep = replace(Sweep.of(content, ""), name=name)
            if quick:
                content = _quick(content, sweep.sweep.quick)
                sweep = replace(Sweep.of(content, ""), name=name)
            base = experiment.read(sweep.extends) if base is None else base
            space = Space(sweep.sweep.vary, sweep.sweep.correlation)
            found = Plan(sweep, _plain({**content}), _plain(base), space)
        _check_names(content, mistakes)
        fits = _check_paths(content, base, mistakes)
        if found is not None:
            with _noted(mistakes, "sweep.sampler: "):
                found.sampler()
            if fits:
                _check_run(found, mistakes)
        mistakes.raise_all()
    except HricError as error:
        raise ExperimentError(message_about(f"sweep {name}", error)) from error
    assert found is not None, "else there were mistakes"
    return found


@contextmanager
def _noted(mistakes: Mistakes, where: str = "") -> Iterator[None]:
    """Note any user error in the block, also one that is no parameter error; `where` is put in front of its message."""
    with mistakes.noted():
        try:
            yield
        except ParameterError:
            raise
        except HricError as error:
            raise ParameterError(f"{where}{error}") from error


def _part(content: Any, key: str) -> Mapping[str, Any]:
    """Return the mapping under a key of unchecked content; empty if there is no mapping."""
    part = content.get(key) if isinstance(content, Mapping) else None
    return part if isinstance(part, Mapping) else {}


def _check_names(content: Mapping[str, Any], mistakes: Mistakes) -> None:
    """Refuse output names that are missing, unknown or equal to that of a variable, even with other mistakes."""
    given = _part(content, "sweep")
    outputs = _part(given, "outputs")
    with mistakes.noted():
        if not outputs:
            raise refused("sweep.outputs", {}, "at least one output")
    with mistakes.noted():
        if twice := sorted(set(_part(given, "vary")) & set(outputs)):
            raise refused("sweep.outputs", ", ".join(twice), "names that no variable has")
    named = [("exceedance.output", _part(given, "exceedance").get("output"))]
    named += [(f"objective.{key}", value) for key, value in _part(given, "objective").items()]
    for key, name in named:
        with mistakes.noted():
            if isinstance(name, str) and name and outputs and name not in outputs:
                raise unknown("output", name, outputs, f"sweep.{key}")


def _check_paths(content: Mapping[str, Any], base: Mapping[str, Any] | None, mistakes: Mistakes) -> bool:
    """Refuse variables whose path is not in the experiment, even with other mistakes; return True if all paths fit."""
    extends, fits = content.get("extends"), True
    if base is None and isinstance(extends, str):
        with suppress(HricError):  # reported already
            base = experiment.read(extends)
    for name, variable in _part(_part(content, "sweep"), "vary").items():
        paths = variable.get("paths") if isinstance(variable, Mapping) else None
        for key in [paths] if isinstance(paths, str) else paths if isinstance(paths, list) else []:
            fits_before, fits = fits, False
            with _noted(mistakes, f"sweep.vary.{name}.paths: "):
                if base is not None and isinstance(key, str):
                    overrides.resolve(key, base)
                fits = fits_before
    return fits


def _check_run(found: Plan, mistakes: Mistakes) -> None:
    """Refuse an experiment that is invalid with all variables at their medians."""
    with _noted(mistakes, "a run with all variables at their medians: "):
        changes = written(found.changes(found.middle()))
        experiment.parse(found.name, overrides.apply(found.experiment, changes))


def _quick(content: Mapping[str, Any], quick: Quick) -> dict[str, Any]:
    """Return the content of the sweep file with the changes for `--quick`."""
    section = dict(content["sweep"])
    section["runs"] = quick.runs
    if quick.sampler:
        section["sampler"] = {**(section.get("sampler") or {}), **quick.sampler}
    changes = {word.partition(":=")[0]: word for word in (*(content.get("changes") or ()), *quick.changes)}
    return {**content, "changes": list(changes.values()), "sweep": section}


def _plain(content: Any) -> Any:
    """Return content as JSON represents it, so that it does not change when it is written to a file and read again."""
    return json.loads(json.dumps(content, default=str))
