"""HTML page of a reproduced experiment."""

from pathlib import Path

from hric_report.html import templates
from hric_report.html.chart import Axis
from hric_report.html.table import PageTable
from hric_sweep.reproduction.results import HEAD, Reproduction, ReproductionOutcome, rows

ASSETS = Path(__file__).parent / "assets"
LEFT, RIGHT = 20, 770
"""Horizontal ends of the chart's axis [px]."""
KINDS = {ReproductionOutcome.WITHIN: "good", ReproductionOutcome.OUTSIDE: "bad"}
"""Look of an outcome; all others are neutral."""


def build(reproduction: Reproduction) -> str:
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
        verdicts=[(KINDS.get(value.outcome, "warning"), f"{value.name}: {value.outcome.value}") for value in values],
    )
