"""Files of published experiments: source, measured values with their spread, and the function that simulates them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_core.node import REQUIRED
from hric_core.parameters import choice, mapping, number, read_yaml, refused, section, text, whole
from hric_sweep.populations import MARKS
from hric_sweep.registry import FileSettings, file_of, imported

FOLDER = Path(__file__).parent / "experiments"
"""Folder of the published experiments of this workspace."""
DataSet = Mapping[str, FloatArray]
"""Columns of a data set by name, shape (n,) each; empty for an experiment without a data set."""


@dataclass(frozen=True)
class MeasuredValue(FileSettings):
    """Published value of one quantity; its mean and spread come from the publication or from a column of a data set."""

    unit: str = text("1", text="unit of all values")
    mean: float | None = number(None, text="published mean; none: the middle of low and high, or from the data set")
    sd: float | None = number(None, above=0.0, text="published standard deviation between subjects or trials")
    low: float | None = number(None, text="lower end of the published range")
    high: float | None = number(None, text="upper end of the published range")
    n: int | None = whole(None, minimum=1, text="number of subjects, or of trials where `text` says so")
    column: str = text("", text="column of the data set that has the measured values; empty: published values")
    note: str = text("", text="reason for a deviation of the simulation, or a limit of the comparison")
    text: str = text(empty=False, text="the quantity in words")

    def check(self, where: str) -> None:
        """Refuse a range with one end, a range with a standard deviation, and a quantity without any value."""
        if (self.low is None) != (self.high is None) or (self.low is not None and self.sd is not None):
            raise refused(f"{where}low, {where}high", (self.low, self.high), "both, without sd; or neither")
        if not self.column and self.mean is None and self.low is None:
            raise refused(f"{where}mean", None, "a number, or low and high, or a column of the data set")

    @property
    def spread(self) -> tuple[float, float] | None:
        """Published range, or mean minus and plus one standard deviation; None: no spread was published."""
        if self.low is not None and self.high is not None:
            return self.low, self.high
        return None if self.sd is None or self.mean is None else (self.mean - self.sd, self.mean + self.sd)

    @property
    def middle(self) -> float | None:
        """Published mean, or the middle of the published range; None: the data set is missing."""
        spread = self.spread
        return self.mean if self.mean is not None or spread is None else 0.5 * sum(spread)

    def with_values(self, values: FloatArray) -> "MeasuredValue":
        """Return this quantity with mean, standard deviation and number of the values of a data set, shape (n,)."""
        sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
        return replace(self, mean=float(np.mean(values)), sd=sd or None, n=len(values))


@dataclass(frozen=True)
class PublishedExperiment(FileSettings):
    """Settings of a published experiment."""

    title: str = text(empty=False, text="title of the page")
    source: str = text(empty=False, text="publication")
    mark: str = choice(
        *MARKS, default=REQUIRED, text="confirmed: the values were read in the publication or its abstract"
    )
    measured: str = text(empty=False, text="how the values were measured, in words")
    simulated: str = text(empty=False, text="how the simulation repeats it, in words")
    simulate: str = text(empty=False, text="MODULE:FUNCTION of the simulation: data set to values by quantity")
    data: str = text("", text="data set that the experiment needs, in words; empty: none")
    quantities: Mapping[str, MeasuredValue] = mapping(section(MeasuredValue), text="published values by quantity")

    @property
    def simulation(self) -> Callable[[DataSet], Mapping[str, float]]:
        """Function that simulates the experiment and returns a value for each quantity."""
        return imported(self.simulate, "simulate")  # type: ignore[no-any-return]

    def with_data(self, data: DataSet, where: str) -> "PublishedExperiment":
        """Return the experiment with the measured values of a data set; `where`: file, for errors."""
        changed = dict(self.quantities)
        for name, quantity in self.quantities.items():
            if quantity.column:
                if quantity.column not in data:
                    raise ParameterError(f"{where}: no column {quantity.column}; it has: {', '.join(data)}")
                changed[name] = quantity.with_values(data[quantity.column])
        return replace(self, quantities=changed)


def names() -> list[str]:
    """Return the names of all published experiments of this workspace."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def load(name: str) -> PublishedExperiment:
    """Return the experiment of a name, or of the path of a YAML file. Raises ParameterError."""
    path = file_of(name, "experiment", FOLDER)
    return PublishedExperiment.of(read_yaml(path), f"{path.name}:")
