"""Study files: one experiment run in several ways, and how far apart the runs may be."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from hric_control.errors import UnknownNameError
from hric_experiments import config, experiment
from hric_experiments.checks import fields, mapping, names_list, number
from hric_experiments.experiment import Experiment, ExperimentError

STUDY_KEYS = ("description", "forms")
FORM_KEYS = ("changes", "compared", "experiment", "runs")
PAIR_KEYS = ("at_most", "runs")


@dataclass(frozen=True)
class Pair:
    """Two runs of a form that are laid over each other.

    Attributes:
        a, b: names of the runs.
        at_most: largest difference of a joint position that the study accepts [rad]; None: reported only.
    """

    a: str
    b: str
    at_most: float | None


@dataclass(frozen=True)
class Form:
    """One experiment in several ways.

    Attributes:
        name: name within the study.
        experiment: name of the experiment.
        changes: overrides of all runs.
        runs: name of each run and its own overrides, in the order in which they are run.
        compared: which runs are laid over each other; figures show the first pair.
    """

    name: str
    experiment: str
    changes: tuple[str, ...]
    runs: Mapping[str, tuple[str, ...]]
    compared: tuple[Pair, ...]

    def arguments(self, run: str, given: Iterable[str]) -> list[str]:
        """Overrides of one run; given: the user's, which come last."""
        return [*self.changes, *self.runs[run], *given]

    def definition(self, run: str, given: Iterable[str]) -> Experiment:
        """The experiment of one run.

        Raises:
            HricError: a mistake in an override.
        """
        return experiment.load(self.experiment, self.arguments(run, given))


@dataclass(frozen=True)
class Study:
    """A study, checked: its name, one line for people, and its forms by name."""

    name: str
    description: str
    forms: Mapping[str, Form]

    def chosen(self, names: Iterable[str]) -> list[Form]:
        """The forms of these names, all if there are none.

        Raises:
            UnknownNameError: no such form.
        """
        wanted = list(names) or list(self.forms)
        for name in wanted:
            if name not in self.forms:
                raise UnknownNameError("form", name, self.forms, f"study {self.name}")
        return [self.forms[name] for name in wanted]


def names() -> list[str]:
    """Names of the studies that come with the workspace."""
    return sorted(path.stem for path in config.studies_path().glob("*.yaml"))


def load(name: str) -> Study:
    """Read a study and check it.

    Raises:
        HricError: no such study, or a mistake in its file; the message gives the key and what is valid.
    """
    if name not in names():
        raise UnknownNameError("study", name, names(), config.studies_path().name)
    try:
        return parse(name, yaml.safe_load((config.studies_path() / f"{name}.yaml").read_text()))
    except yaml.YAMLError as error:
        raise ExperimentError(f"study {name} is not valid YAML: {error}") from error


def parse(name: str, raw: Any) -> Study:
    """Check the contents of a study file.

    Raises:
        ExperimentError: an unknown or missing key, or a pair that names no run.
    """
    try:
        data = mapping(raw, "the file")
        fields(data, STUDY_KEYS, STUDY_KEYS, "")
        forms = {key: _form(key, mapping(value, f"forms.{key}")) for key, value in mapping(data["forms"], "forms").items()}
        if not forms:
            raise ValueError("forms must name at least one")
    except ValueError as error:
        raise ExperimentError(f"study {name}: {error}") from error
    return Study(name, str(data["description"]), forms)


def _form(name: str, raw: Mapping[str, Any]) -> Form:
    where = f"forms.{name}"
    fields(raw, FORM_KEYS, ("experiment", "runs", "compared"), where)
    runs = {key: _overrides(value, f"{where}.runs.{key}") for key, value in mapping(raw["runs"], f"{where}.runs").items()}
    items = raw["compared"]
    if not isinstance(items, list) or not items:
        raise ValueError(f"{where}.compared must be a list of {{runs: [A, B], at_most: [rad]}}; got {items!r}")
    compared = tuple(_pair(mapping(item, f"{where}.compared[{i}]"), runs, f"{where}.compared[{i}]") for i, item in enumerate(items))
    return Form(name, str(raw["experiment"]), _overrides(raw.get("changes"), f"{where}.changes"), runs, compared)


def _overrides(raw: Any, where: str) -> tuple[str, ...]:
    return names_list(raw, where) if raw else ()


def _pair(raw: Mapping[str, Any], runs: Mapping[str, Any], where: str) -> Pair:
    fields(raw, PAIR_KEYS, ("runs",), where)
    both = names_list(raw["runs"], f"{where}.runs")
    unknown = [name for name in both if name not in runs]
    if len(both) != 2 or unknown:
        raise ValueError(f"{where}.runs must name two of {', '.join(runs)}; got {', '.join(both)}")
    at_most = None if raw.get("at_most") is None else number(raw["at_most"], f"{where}.at_most", minimum=0.0, exclusive=True)
    return Pair(both[0], both[1], at_most)
