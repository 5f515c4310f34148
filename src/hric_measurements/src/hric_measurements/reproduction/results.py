"""Results of reproduced experiments: comparison of simulated with measured values, their file, table and HTML page."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from hric_bags import files
from hric_core.errors import HricError
from hric_measurements.reproduction.definition import DataSet, MeasuredValue, PublishedExperiment
from hric_report.html import templates
from hric_report.html.chart import Axis
from hric_report.html.table import PageTable, number

HEAD = ("experiment", "quantity", "n", "measured", "simulated", "ratio", "0 to 2 times the mean", "result", "source")
ASSETS = Path(__file__).parent / "assets"
LEFT, RIGHT = 20, 770
"""Horizontal ends of the axis of a page's chart [px]."""
WIDTH = 20
"""Number of steps of a bar, from 0 to twice the measured mean."""


class ReproductionOutcome(Enum):
    """Outcome of one quantity: the simulated value compared with the published spread."""

    WITHIN = "within"
    OUTSIDE = "outside"
    NO_SPREAD = "no published spread"
    NO_DATA = "no data set"


LOOKS = {ReproductionOutcome.WITHIN: "good", ReproductionOutcome.OUTSIDE: "bad"}
"""Style of an outcome on a page; all other outcomes have that of a warning."""


@dataclass(frozen=True)
class ReproducedValue:
    """One quantity, measured and simulated.

    Attributes:
        name: name of the quantity in its experiment.
        measured: measured value.
        simulated: simulated value, in the same unit; None: not simulated, since the data set is missing.
    """

    name: str
    measured: MeasuredValue
    simulated: float | None

    @property
    def ratio(self) -> float | None:
        """Ratio of the simulated to the measured value; None: not known."""
        middle = self.measured.middle
        return None if self.simulated is None or not middle else self.simulated / middle

    @property
    def outcome(self) -> ReproductionOutcome:
        """Outcome of the comparison with the published spread."""
        spread = self.measured.spread
        if self.simulated is None or self.measured.middle is None:
            return ReproductionOutcome.NO_DATA
        if spread is None:
            return ReproductionOutcome.NO_SPREAD
        low, high = spread
        return ReproductionOutcome.WITHIN if low <= self.simulated <= high else ReproductionOutcome.OUTSIDE


@dataclass(frozen=True)
class Reproduction:
    """A published experiment with its simulated values.

    Attributes:
        name: name of the experiment.
        experiment: published experiment.
        simulated: simulated values by quantity; empty: the data set is missing.
    """

    name: str
    experiment: PublishedExperiment
    simulated: Mapping[str, float]

    @property
    def values(self) -> list[ReproducedValue]:
        """All quantities of the experiment, measured and simulated."""
        quantities = self.experiment.quantities
        return [ReproducedValue(name, value, self.simulated.get(name)) for name, value in quantities.items()]


def simulate(name: str, experiment: PublishedExperiment, data: DataSet) -> Reproduction:
    """Simulate a published experiment. Raises HricError: the simulation fails, or a value is missing or not finite."""
    simulated = dict(experiment.simulation(data))
    if simulated.keys() != experiment.quantities.keys():
        raise HricError(
            f"{name}: the simulation returns {', '.join(simulated)}; valid: {', '.join(experiment.quantities)}"
        )
    wrong = [key for key, value in simulated.items() if not math.isfinite(value)]
    if wrong:
        raise HricError(f"{name}: the simulated {', '.join(wrong)} is not finite; valid: finite numbers")
    return Reproduction(name, experiment, simulated)


def restore(path: Path, key: str) -> Mapping[str, float] | None:
    """Return the simulated values of a finished experiment; None: not finished, or `key` (code, data) has changed."""
    try:
        content = json.loads(path.read_text())
        return content["simulated"] if content["key"] == key else None
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise HricError(f"cannot read {path}: {error!r}; remove it to simulate the experiment again") from error


def store(path: Path, key: str, reproduction: Reproduction) -> None:
    """Write the simulated values of a finished experiment to a JSON file."""
    files.write_text(path, json.dumps({"key": key, "simulated": dict(reproduction.simulated)}, indent=1) + "\n")


def rows(reproductions: list[Reproduction]) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table, one for each quantity, in the order of HEAD."""
    for item in reproductions:
        mark = "" if item.experiment.mark == "confirmed" else f" ({item.experiment.mark})"
        for value in item.values:
            measured = value.measured
            yield (
                item.name,
                measured.text,
                number(measured.n),
                _measured(measured),
                number(value.simulated, 3),
                number(value.ratio, 3),
                bar(value),
                value.outcome.value,
                item.experiment.source + mark,
            )


def _measured(value: MeasuredValue) -> str:
    if value.middle is None:
        return "-"
    unit = "" if value.unit == "1" else f" {value.unit}"
    if value.low is not None:
        mean = "" if value.mean is None else f"{number(value.mean)}, "
        return f"{mean}{number(value.low)} to {number(value.high)}{unit}"
    return f"{number(value.mean)}{'' if value.sd is None else f' +- {number(value.sd)}'}{unit}"


def bar(value: ReproducedValue) -> str:
    """Return a bar of text: [ and ] are the ends of the published spread, + the mean, o the simulated value."""
    middle, cells = value.measured.middle, ["."] * (WIDTH + 1)
    if not middle:
        return "-"
    marks = [("+", middle)]
    if value.measured.spread is not None:
        marks = [("[", value.measured.spread[0]), ("]", value.measured.spread[1]), *marks]
    if value.simulated is not None:
        marks.append(("o", value.simulated))
    for mark, at in marks:
        cells[max(0, min(WIDTH, round(0.5 * WIDTH * at / middle)))] = mark
    return "".join(cells)


def markdown(reproductions: list[Reproduction]) -> str:
    """Return the table in Markdown, with the reasons for deviations below it."""
    lines = [HEAD, tuple("---" for _ in HEAD), *((*row[:6], f"`{row[6]}`", *row[7:]) for row in rows(reproductions))]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    notes = [
        f"- `{item.name}`, {value.measured.text}: {value.measured.note}"
        for item in reproductions
        for value in item.values
        if value.measured.note
    ]
    return "\n\n".join([table, counted(reproductions), "\n".join(notes)]) + "\n"


def counted(reproductions: list[Reproduction]) -> str:
    """Return the number of quantities by outcome in one sentence."""
    outcomes = [value.outcome for item in reproductions for value in item.values]
    counts = [f"{outcomes.count(outcome)} {outcome.value}" for outcome in ReproductionOutcome if outcome in outcomes]
    return f"{len(outcomes)} quantities of {len(reproductions)} experiments: {', '.join(counts)}."


def page(reproduction: Reproduction) -> str:
    """Return the HTML page of a reproduced experiment."""
    values = reproduction.values
    ends = [1.0, *(value.ratio for value in values if value.ratio is not None)]
    for value in values:
        spread, middle = value.measured.spread, value.measured.middle
        ends += [end / middle for end in spread] if spread is not None and middle else []
    columns = tuple(index for index, name in enumerate(HEAD) if name not in ("experiment", "source", HEAD[6]))
    table = PageTable("", [HEAD[k] for k in columns], [[row[k] for k in columns] for row in rows([reproduction])])
    template = templates.environment(ASSETS).get_template("reproduction.html")
    return template.render(
        reproduction=reproduction,
        chart_axis=Axis(min(0.0, *ends), 1.05 * max(ends), LEFT, RIGHT),
        table_of_values=table,
        verdicts=[(LOOKS.get(value.outcome, "warning"), f"{value.name}: {value.outcome.value}") for value in values],
    )
