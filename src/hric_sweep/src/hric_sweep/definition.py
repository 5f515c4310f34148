"""Sweep files: experiment, varied parameters, sampling of the runs, and the outputs stored for each run."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hric_core.errors import HricError, ParameterError, message_about
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
from hric_sweep.outputs import SweepOutput
from hric_sweep.records import PlainData, RunTask
from hric_sweep.registry import FileSettings, file_of, imported
from hric_sweep.samplers.make import SAMPLER, make
from hric_sweep.samplers.sampler import Sampler
from hric_sweep.space import Space
from hric_sweep.variables import Choice, Variable

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
"""Default memory limit of a worker [GB]; project default, unconfirmed (a run with a human, muscles and sensors takes
less than 1 GB)."""


ENDS = ("duration", "contact")
"""Events that can end a run: the experiment's duration has passed, or the first contact with the person has ended."""
ROW = "row"
"""Name of the variable that selects one of the sweep file's `rows` (sets of overrides) by its name."""


@dataclass(frozen=True)
class Exceedance(FileSettings):
    """Event whose probability is estimated: an output exceeds a limit."""

    output: str = text(empty=False, text="name of the output")
    above: float | None = number(None, text="limit that the output exceeds, in its unit")
    below: float | None = number(None, text="limit that the output falls below, in its unit")

    def check(self, where: str) -> None:
        """Raise an error unless exactly one of `above` and `below` is set."""
        if (self.above is None) == (self.below is None):
            raise refused(f"{where}above, {where}below", (self.above, self.below), "exactly one of the two")

    def margin(self, value: float) -> float:
        """Return how far a value is beyond the limit, negative on the safe side [unit of the output]."""
        return value - self.above if self.above is not None else (self.below or 0.0) - value


@dataclass(frozen=True)
class Objective(FileSettings):
    """Objective of a search for the worst or the best case."""

    maximise: str = text("", text="name of the output to maximise; empty: use `minimise`")
    minimise: str = text("", text="name of the output to minimise; empty: use `maximise`")

    def check(self, where: str) -> None:
        """Raise an error unless exactly one of `maximise` and `minimise` is set."""
        if bool(self.maximise) == bool(self.minimise):
            raise refused(f"{where}maximise, {where}minimise", (self.maximise, self.minimise), "exactly one of the two")

    @property
    def output(self) -> str:
        """Name of the output that is optimised."""
        return self.maximise or self.minimise

    @property
    def sign(self) -> float:
        """Sign of the objective: 1 if it is maximised, -1 if it is minimised."""
        return 1.0 if self.maximise else -1.0


@dataclass(frozen=True)
class Keep(FileSettings):
    """Selection of runs that are repeated at the end of the sweep, to store their signals."""

    worst: int = whole(
        10, minimum=0, text="number of worst runs, by objective or else by exceedance, whose signals are stored"
    )
    failed: bool = flag(True, text="also store the signals of failed runs, of at most `worst` of them")


@dataclass(frozen=True)
class Quick(FileSettings):
    """Changes of the sweep for the short form (`--quick`)."""

    runs: int = whole(8, minimum=1, text="number of runs, instead of `runs`")
    changes: tuple[str, ...] = listing(
        text(empty=False), default=(), made=once, text="additional overrides of the experiment in all runs"
    )
    sampler: Any = anything({}, default_text="none", text="keys that replace those of `sampler`")


@dataclass(frozen=True)
class SweepSection(FileSettings):
    """Section `sweep` of a sweep file."""

    vary: Mapping[str, Variable] = mapping(
        section(Variable), default={}, text="variables by name: `paths`, `unit`, `distribution`"
    )
    rows: Any = anything(
        (),
        default_text="none",
        text="overrides of each run, by the run's name, for the sampler `list`; or MODULE:FUNCTION, which returns the "
        "overrides for a seed",
    )
    correlation: Any = anything(
        (), default_text="none", text="correlations, each a list of two variables and the coefficient"
    )
    sampler: Settings = SAMPLER
    runs: int | None = whole(
        None,
        minimum=1,
        maximum=10_000_000,
        text="maximum number of runs; none: the sampler determines it (grid, list)",
    )
    seeds: str = choice(
        "each", "common", text="each: every run has its own seed; common: all runs share one (common random numbers)"
    )
    seed: int = whole(0, minimum=0, text="seed of the sampler; also the seed of the first run")
    until: str = choice(
        *ENDS,
        text="end of a run. duration: that of the experiment. contact: end of the first contact with the person, at "
        "most "
        "1 s after its start; without contact, 1 s before the duration",
    )
    outputs: Mapping[str, SweepOutput] = mapping(section(SweepOutput), text="numbers stored for each run, by name")
    exceedance: Exceedance | None = section(Exceedance, None, text="event whose probability is estimated")
    objective: Objective | None = section(Objective, None, text="objective of a search")
    timeout: float = number(
        60.0,
        above=0.0,
        unit="s",
        text="limit of processor time per run, and of wall time without progress; beyond it the worker is killed",
    )
    memory: float = number(MEMORY, above=0.0, maximum=1000.0, unit="GB", text="memory limit of a worker")
    keep: Keep = section(Keep)
    quick: Quick = section(Quick)

    def check(self, where: str) -> None:
        """Add a variable whose values are the names of the rows. Raises an error for rows that are no overrides."""
        if not self.rows:
            return
        if isinstance(self.rows, str):
            draw = imported(self.rows, f"{where}rows")
            rows = {str(seed): draw(seed) for seed in range(self.seed, self.seed + (self.runs or 1))}
        elif not isinstance(self.rows, Mapping):
            raise refused(f"{where}rows", self.rows, "a mapping of names to overrides, or MODULE:FUNCTION")
        else:
            rows = {name: _overrides(row, f"{where}rows.{name}") for name, row in self.rows.items()}
        variable = Variable(paths=(ROW,), text="name of the row", distribution=Choice(values=tuple(rows)))
        object.__setattr__(self, "rows", rows)
        object.__setattr__(self, "vary", {**self.vary, ROW: variable})


def _overrides(row: Any, where: str) -> PlainData:
    if isinstance(row, Mapping):
        return row
    if not isinstance(row, list | tuple) or not all(isinstance(word, str) for word in row):
        raise refused(where, row, 'overrides, as ["key:=value"] or {key: value}')
    return dict(map(overrides.split, row))


@dataclass(frozen=True)
class Sweep(FileSettings):
    """Checked content of a sweep file; `name` is the file name without its ending."""

    name: str = ""
    description: str = text("", text="one-line description")
    extends: str = text(empty=False, text="the experiment: its name, or the path of its YAML file")
    changes: tuple[str, ...] = listing(
        text(empty=False), default=(), made=once, text="overrides of the experiment in all runs"
    )
    sweep: SweepSection = section(SweepSection, REQUIRED)


@dataclass(frozen=True)
class SweepPlan:
    """Checked sweep that is ready to run.

    Attributes:
        sweep: checked content of the sweep file.
        content: content of the sweep file as plain data.
        experiment: content of the experiment file.
        space: variables with their distributions and correlations.
        runs_folder: folder in which each run gets a run folder with its bag; empty: only output numbers are stored.
    """

    sweep: Sweep
    content: PlainData
    experiment: PlainData
    space: Space
    runs_folder: str = ""

    @property
    def name(self) -> str:
        """Name of the sweep."""
        return self.sweep.name

    @property
    def section(self) -> SweepSection:
        """Section `sweep` of the sweep file."""
        return self.sweep.sweep

    def sampler(self) -> Sampler:
        """Return a new sampler. Raises HricError: the sampler does not fit the variables or the number of runs."""
        return make(self.section.sampler, self.space, self.section.runs, self.section.seed)

    def changes(self, values: PlainData) -> PlainData:
        """Return the overrides of a run by key; `values`: values of the variables, empty for the reference run."""
        changes = dict(map(overrides.split, self.sweep.changes))
        for name, variable in self.section.vary.items():
            if name in values:
                row = variable.paths == (ROW,)
                changes |= self.section.rows[values[ROW]] if row else dict.fromkeys(variable.paths, values[name])
        return changes

    def middle(self) -> PlainData:
        """Return the median of each variable's distribution, by name of the variable."""
        return self.space.values(np.full((1, len(self.section.vary)), 0.5))[0]

    def seed(self, index: int) -> int:
        """Return the seed of the run with this index."""
        return self.section.seed + (index if self.section.seeds == "each" else 0)

    def task(self, index: int, values: PlainData, code: str) -> RunTask:
        """Return the task of a run.

        Args:
            index: index of the run.
            values: values of the variables.
            code: version of the code.
        """
        section, changes, seed = self.section, self.changes(values), self.seed(index)
        return RunTask(
            *(index, self.name, self.experiment, changes, seed, section.outputs, section.timeout, code),
            until=section.until,
            runs_folder=self.runs_folder,
        )


def written(changes: PlainData) -> list[str]:
    """Return overrides as command-line arguments, `key:=value`."""
    return [f"{key}:={in_yaml(value)}" for key, value in changes.items()]


def names() -> list[str]:
    """Return the names of the sweeps that come with the workspace."""
    return experiment.names("sweeps")


def load(name: str, *, quick: bool = False) -> SweepPlan:
    """Read and check a sweep, including everything that its runs need.

    Args:
        name: name of a sweep of the workspace, or path of a YAML file.
        quick: use the form with few runs.

    Raises:
        HricError: the sweep does not exist, or has mistakes; the message lists all of them.
    """
    path = find(name)
    content = read_yaml(path)
    if not isinstance(content, Mapping):
        raise ExperimentError(f"{path.name} must be a mapping with description, extends, changes and sweep")
    extends = content.get("extends")
    if isinstance(extends, str) and extends.endswith((".yaml", ".yml")):
        content = {**content, "extends": str(path.parent / Path(extends).expanduser())}
    return plan(path.stem, content, quick=quick)


def find(name: str) -> Path:
    """Return the path of a sweep file. Raises HricError: there is no such file."""
    return file_of(name, "sweep", experiment.config_path("sweeps"))


def plan(name: str, content: PlainData, *, quick: bool = False, base: PlainData | None = None) -> SweepPlan:
    """Check the content of a sweep file, its experiment, and one run with all variables at their medians.

    Args:
        name: name of the sweep.
        content: content of the sweep file.
        quick: use the form with few runs.
        base: content of the experiment file when the sweep was started; None: read the current file.

    Raises:
        ExperimentError: the content has mistakes; the message lists all of them.
    """
    mistakes = Mistakes()
    made: SweepPlan | None = None
    try:
        with _noted(mistakes):
            sweep = replace(Sweep.of(content, ""), name=name)
            if quick:
                content = _quick(content, sweep.sweep.quick)
                sweep = replace(Sweep.of(content, ""), name=name)
            base = experiment.read(sweep.extends) if base is None else base
            space = Space(sweep.sweep.vary, sweep.sweep.correlation)
            made = SweepPlan(sweep, _plain({**content}), _plain(base), space)
        _check_names(content, mistakes)
        fits = _check_paths(content, base, mistakes)
        if made is not None:
            with _noted(mistakes, "sweep.sampler: "):
                made.sampler()
            if fits:
                _check_run(made, mistakes)
        mistakes.raise_all()
    except HricError as error:
        raise ExperimentError(message_about(f"sweep {name}", error)) from error
    assert made is not None, "else there were mistakes"
    return made


@contextmanager
def _noted(mistakes: Mistakes, where: str = "") -> Iterator[None]:
    """Collect any user error raised in the block; `where` precedes the message of one that is no ParameterError."""
    with mistakes.noted():
        try:
            yield
        except ParameterError:
            raise
        except HricError as error:
            raise ParameterError(f"{where}{error}") from error


def _part(content: Any, key: str) -> PlainData:
    """Return the mapping under a key of unchecked content; empty if there is no mapping."""
    part = content.get(key) if isinstance(content, Mapping) else None
    return part if isinstance(part, Mapping) else {}


def _check_names(content: PlainData, mistakes: Mistakes) -> None:
    """Report missing outputs, unknown output names, and outputs with the name of a variable.

    The check also works on content with other mistakes.
    """
    sweep = _part(content, "sweep")
    outputs = _part(sweep, "outputs")
    with mistakes.noted():
        if not outputs:
            raise refused("sweep.outputs", {}, "at least one output")
    with mistakes.noted():
        if twice := sorted(set(_part(sweep, "vary")) & set(outputs)):
            raise refused("sweep.outputs", ", ".join(twice), "names that no variable has")
    named = [("exceedance.output", _part(sweep, "exceedance").get("output"))]
    named += [(f"objective.{key}", value) for key, value in _part(sweep, "objective").items()]
    for key, name in named:
        with mistakes.noted():
            if isinstance(name, str) and name and outputs and name not in outputs:
                raise unknown("output", name, outputs, f"sweep.{key}")


def _check_paths(content: PlainData, base: PlainData | None, mistakes: Mistakes) -> bool:
    """Report variables whose path is not in the experiment; return True if there are none.

    The check also works on content with other mistakes.
    """
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


def _check_run(checked: SweepPlan, mistakes: Mistakes) -> None:
    """Report an experiment that is invalid with all variables at their medians."""
    with _noted(mistakes, "a run with all variables at their medians: "):
        changes = written(checked.changes(checked.middle()))
        experiment.parse(checked.name, overrides.apply(checked.experiment, changes))


def _quick(content: PlainData, quick: Quick) -> PlainData:
    """Return the content of the sweep file with the changes for `--quick`."""
    section = dict(content["sweep"])
    section["runs"] = quick.runs
    if quick.sampler:
        section["sampler"] = {**(section.get("sampler") or {}), **quick.sampler}
    changes = {word.partition(":=")[0]: word for word in (*(content.get("changes") or ()), *quick.changes)}
    return {**content, "changes": list(changes.values()), "sweep": section}


def _plain(content: Any) -> Any:
    """Return content with JSON types only, so that writing it to a file and reading it again does not change it."""
    return json.loads(json.dumps(content, default=str))
