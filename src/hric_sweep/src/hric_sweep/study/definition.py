"""Study files: experiments in several variants, with the maximum accepted differences between their runs."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hric_core.errors import ParameterError, UnknownNameError, message_about
from hric_core.parameters import Settings, listing, mapping, number, read_yaml, refused, section, text
from hric_core.parameters import names as names_
from hric_run.definition import experiment
from hric_run.definition.experiment import Experiment, ExperimentError
from hric_run.definition.overrides import once
from hric_sweep.registry import file_of

EXAMPLE = """\
description: how stiffness changes the step
forms:
  step:
    experiment: pd_step
    runs: {soft: ["kp:=50", "kd:=10"], stiff: ["kp:=200", "kd:=100"]}   # overrides of each run
    compared:
      - {runs: [soft, stiff]}
"""

RENAMED = {"opensim_vs_pybullet": "engines"}
"""Current name of each renamed study, by its former name."""
_NUMERIC = re.compile(r"-?\d+(\.\d+)?")
OVERRIDES: Any = listing(text(empty=False), default=(), different=True, made=once)


@dataclass(frozen=True)
class ComparedPair(Settings):
    """Pair of runs of one experiment that are compared, with the accepted differences."""

    runs: tuple[str, str] = names_(2, text="names of the two runs")
    at_most: float | None = number(
        None,
        above=0.0,
        unit="rad",
        text="largest accepted difference of a joint position, of the robot or a human; none: differences are reported "
        "only",
    )
    force_bound: float | None = number(
        None, above=0.0, unit="N", text="largest accepted difference of a grip force; none: reported only"
    )


@dataclass(frozen=True)
class Form(Settings):
    """Form of a study: one experiment, run in several variants; `name` is its name within the study."""

    name: str = ""
    experiment: str = text(empty=False, text="name of the experiment, or path of its YAML file")
    changes: tuple[str, ...] = listing(
        text(empty=False), default=(), different=True, made=once, text="overrides of the experiment in all runs"
    )
    runs: Mapping[str, tuple[str, ...]] = mapping(
        OVERRIDES, text="overrides of each variant, by name of its run, in the order of execution"
    )
    abscissa: str = text("", text="quantity and unit of the run names, if these are numbers; abscissa of the figures")
    compared: tuple[ComparedPair, ...] = listing(
        section(ComparedPair), range(1, 100), text="pairs of runs to compare; figures show the first pair"
    )

    def check(self, where: str) -> None:
        """Raise an error for a pair with an unknown run, or an abscissa with names of runs that are not numbers."""
        if self.abscissa and not all(map(_NUMERIC.fullmatch, self.runs)):
            raise refused(f"{where}runs", ", ".join(self.runs), f"names that are numbers, values of {self.abscissa}")
        for i, pair in enumerate(self.compared):
            if unknown := [name for name in pair.runs if name not in self.runs]:
                raise refused(f"{where}compared[{i}].runs", ", ".join(unknown), f"two of {', '.join(self.runs)}")

    def arguments(self, run: str, last: Iterable[str]) -> list[str]:
        """Return the overrides of one run; `last`: overrides of the user, which take precedence."""
        return [*self.changes, *self.runs[run], *last]

    def definition(self, run: str, last: Iterable[str]) -> Experiment:
        """Return the experiment of one run; `last`: overrides of the user.

        Raises:
            HricError: an override is invalid.
        """
        return experiment.load(self.experiment, self.arguments(run, last))


@dataclass(frozen=True)
class Study(Settings):
    """Checked study file; `name` is the file name without its ending, `content` the content of the file."""

    name: str = ""
    content: Any = None
    description: str = text(text="one-line description")
    forms: Mapping[str, Form] = mapping(
        section(Form), made=lambda forms: {name: replace(form, name=name) for name, form in forms.items()}
    )

    def check(self, where: str) -> None:
        """Raise an error for a study without forms."""
        if not self.forms:
            raise refused(f"{where}forms", {}, "at least one form")

    def chosen(self, names: Iterable[str]) -> list[Form]:
        """Return the forms with these names, or all forms without names.

        Raises:
            UnknownNameError: there is no such form.
        """
        requested = list(names) or list(self.forms)
        for name in requested:
            if name not in self.forms:
                raise UnknownNameError("form", name, self.forms, f"study {self.name}")
        return [self.forms[name] for name in requested]


def names() -> list[str]:
    """Return the names of the studies that come with the workspace."""
    return experiment.names("studies")


def is_study(name: str) -> bool:
    """Return True if a name is that of a study, or of a YAML file with a study.

    Raises:
        ParameterError: the file cannot be read or is not YAML.
    """
    if not name.endswith((".yaml", ".yml")) or not Path(name).expanduser().is_file():
        return name in (*names(), *RENAMED)
    content = read_yaml(Path(name).expanduser())
    return isinstance(content, Mapping) and "forms" in content


def load(name: str) -> Study:
    """Read and check a study.

    Args:
        name: name of a study of the workspace, or path of a YAML file.

    Raises:
        HricError: the study does not exist or has mistakes; the message lists their keys and the valid values.
    """
    path = file_of(RENAMED.get(name, name), "study", experiment.config_path("studies"))
    return parse(path.stem, read_yaml(path))


def parse(name: str, raw: Any) -> Study:
    """Check the content of a study file.

    Raises:
        ExperimentError: the content has mistakes; the message lists all of them.
    """
    try:
        return replace(Study.of(raw, ""), name=name, content=raw)
    except ParameterError as error:
        raise ExperimentError(message_about(f"study {name}", error)) from error
