"""Data of a sweep for its page: columns of runs.parquet with their roles and units, and the definition."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from hric_bags.run_folder import RunFolderError
from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_core.parameters import read_yaml
from hric_sweep.samplers.sampler import CrossCheck, Estimate

RUNS, SETTINGS = "runs.parquet", "sweep.yaml"
VARIABLE, OUTPUT = "variable", "output"
FINE, EXCEEDED, FAILED = 0, 1, 2
"""Codes of a run's result: not beyond the limit, beyond the limit, failed."""
KINDS = ("fine", "exceeded", "failed")
"""Names of the results FINE, EXCEEDED and FAILED."""

Column = npt.NDArray[Any]


class ExceedanceRecord(TypedDict, total=False):
    """Entry `exceedance` in the definition of a sweep, with either `above` or `below`."""

    output: str
    above: float
    below: float


class VariableRecord(TypedDict, total=False):
    """Entry of `vary` in the definition of a sweep: one variable."""

    paths: Sequence[str]
    distribution: Mapping[str, object]


class SweepRecord(TypedDict, total=False):
    """Section `sweep` of the definition of a sweep."""

    vary: Mapping[str, VariableRecord]
    correlation: Sequence[tuple[str, str, float]]
    sampler: Mapping[str, object]
    runs: int
    outputs: Mapping[str, Mapping[str, object]]
    seeds: str
    exceedance: ExceedanceRecord
    objective: Mapping[str, str]


class DefinitionRecord(TypedDict, total=False):
    """Definition of a sweep as stored in the metadata of runs.parquet."""

    description: str
    extends: str
    sweep: SweepRecord


@dataclass(frozen=True)
class ColumnDescription:
    """Description of a table column: its role (variable or output), the unit of its numbers, and a text."""

    role: str
    unit: str = ""
    text: str = ""


@dataclass(frozen=True)
class SweepLimit:
    """Exceedance of a sweep: an output above or below a bound."""

    output: str
    bound: float
    above: bool

    @property
    def sign(self) -> str:
        """Comparison sign between the output and the bound."""
        return ">" if self.above else "<"


@dataclass(frozen=True)
class RecordedSweep:
    """Sweep as read from its run folder.

    Attributes:
        folder: run folder of the sweep.
        columns: columns by name, each of shape (runs,), in order of index.
        about: description of each column.
        definition: content of the whole sweep file in canonical form; its section `sweep` defines the variables.
        estimate: estimate of the sampler; None: the sampler has none, or none yet.
        made: content of sweep.yaml.
    """

    folder: Path
    columns: Mapping[str, Column]
    about: Mapping[str, ColumnDescription]
    definition: DefinitionRecord
    estimate: Estimate | None = None
    made: Mapping[str, object] = field(default_factory=dict)

    @property
    def section(self) -> SweepRecord:
        """Section `sweep` of the definition."""
        return self.definition.get("sweep") or {}

    @property
    def sampler(self) -> str:
        """Kind of the sampler, such as random or grid."""
        return str((self.section.get("sampler") or {}).get("kind", ""))

    @property
    def runs(self) -> int:
        """Number of runs in the table."""
        return len(self.columns["id"])

    @property
    def planned(self) -> int | None:
        """Maximum number of runs; None: the definition has none."""
        runs = self.section.get("runs")
        return None if runs is None else int(runs)

    @property
    def variables(self) -> list[str]:
        """Names of the columns of variables, in their order."""
        return [name for name, about in self.about.items() if about.role == VARIABLE and name in self.columns]

    @property
    def outputs(self) -> list[str]:
        """Names of the columns of outputs, in their order."""
        return [name for name, about in self.about.items() if about.role == OUTPUT and name in self.columns]

    def label(self, name: str) -> str:
        """Return a column's name with its unit, which is 1 for a number without unit."""
        unit = self.about[name].unit or ("1" if self.columns[name].dtype.kind in "iuf" else "")
        return f"{name} [{unit}]" if unit else name

    @cached_property
    def limit(self) -> SweepLimit | None:
        """Limit whose exceedance is counted; None: the sweep has none."""
        counted = self.section.get("exceedance")
        if not counted:
            return None
        above = counted.get("above")
        bound = counted["below"] if above is None else above
        return SweepLimit(str(counted["output"]), float(bound), above is not None)

    @cached_property
    def kinds(self) -> npt.NDArray[np.uint32]:
        """Result of each run, FINE, EXCEEDED or FAILED, shape (runs,)."""
        kinds = np.full(self.runs, FINE, dtype=np.uint32)
        kinds[[bool(exceeded) for exceeded in self.columns["exceeded"]]] = EXCEEDED
        kinds[self.columns["failure"] != ""] = FAILED
        return kinds

    def count(self, kind: str) -> int:
        """Return the number of runs with a result, fine, exceeded or failed."""
        return int((self.kinds == KINDS.index(kind)).sum())

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of the runs (likelihood ratios), shape (runs,); 1: drawn from the distributions themselves."""
        return np.asarray(self.columns["weight"], dtype=float)

    @property
    def weighted(self) -> bool:
        """True if a run has a weight other than 1."""
        return bool(np.any(self.weights != 1.0))

    def numbers(self, name: str) -> tuple[FloatArray, list[str]]:
        """Return the numbers of a column and its labels; words have number k for label k, numbers have no labels."""
        values = self.columns[name]
        if values.dtype.kind in "iuf":
            return values.astype(float), []
        words = [str(value) for value in values]
        labels = sorted(set(words))
        known = {word: number for number, word in enumerate(labels)}
        return np.array([known[word] for word in words], dtype=float), labels

    def constant(self, name: str) -> bool:
        """Return True if a column has more than one value and all of them are equal."""
        values = self.numbers(name)[0]
        known = values[~np.isnan(values)]
        return len(known) > 1 and bool(np.all(known == known[0]))

    @cached_property
    def order_of_worst(self) -> tuple[npt.NDArray[np.intp], str]:
        """Table rows of the runs that did not fail, the worst first, and the criterion in words.

        The criterion is the objective, else the output with the limit, else the largest value of the first output.
        """
        aim = self.section.get("objective") or {}
        outputs = self.outputs
        if aim:
            largest = bool(aim.get("maximise"))
            name = str(aim["maximise" if largest else "minimise"])
        elif self.limit is not None:
            name, largest = self.limit.output, self.limit.above
        elif outputs:
            name, largest = outputs[0], True
        else:
            return np.zeros(0, dtype=np.intp), ""
        values = np.asarray(self.columns[name], dtype=float)
        order = np.argsort(-values if largest else values, kind="stable")
        return order[~np.isnan(values[order])], f"{'largest' if largest else 'smallest'} {name}"


def load(folder: Path) -> RecordedSweep:
    """Read a sweep from its run folder.

    Raises:
        HricError: the folder has no table, or one that was not written by a sweep.
    """
    import pyarrow
    from pyarrow import parquet

    path = folder / RUNS
    try:
        rows = parquet.read_table(path)
        content = json.loads(rows.schema.metadata[b"hric"])
        about = {name: ColumnDescription(**column) for name, column in content["columns"].items()}
        estimate = _estimate(content.get("estimate"))
    except (OSError, KeyError, TypeError, ValueError, pyarrow.ArrowException) as error:
        raise RunFolderError(f"cannot read {path}: {error}; valid: the run folder of a sweep") from error
    columns = {name: rows.column(name).to_numpy() for name in rows.column_names}
    return RecordedSweep(folder, columns, about, content["sweep"], estimate, _made(folder / SETTINGS))


def _estimate(record: Any) -> Estimate | None:
    if record is None:
        return None
    check = record.get("check")
    return Estimate(**{**record, "check": None if check is None else CrossCheck(**check)})


def _made(path: Path) -> Mapping[str, object]:
    try:
        content = read_yaml(path)
    except ParameterError as error:
        raise RunFolderError(f"{error}; valid: the run folder of a sweep") from None
    return content if isinstance(content, Mapping) else {}
