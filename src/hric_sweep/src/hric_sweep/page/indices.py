"""First-order and total indices of each output, for runs of Saltelli's design."""

from collections.abc import Iterator, Mapping

import numpy as np

from hric_core.errors import HricError
from hric_report.html.tables import escape
from hric_sweep.page import chart
from hric_sweep.page.study import OUTPUT, Study
from hric_sweep.page.words import SALTELLI
from hric_sweep.space import Space
from hric_sweep.statistics.sensitivity import Index, indices
from hric_sweep.variables import Variable

WIDTH, LEFT, RIGHT, ROW, TOP, APART = 440.0, 110.0, 368.0, 28.0, 8.0, 6.0
"""Layout of a chart: its width, left and right end of the axis, row height, top margin, and distance of the two indices
from the middle of the row [units of the picture]."""


def part(study: Study) -> str:
    """Return the HTML with a chart for each output; "" if the design is different or incomplete."""
    if study.sampler != SALTELLI or study.runs != (study.planned or study.runs):
        return ""
    vary = study.section["vary"]
    space = Space({name: Variable.of(given, f"vary.{name}") for name, given in vary.items()}, ())
    figures = "".join(_figure(study, space, name) for name in study.named(OUTPUT))
    note = (
        "Shares of the output's variance. Blue: what the variable explains alone (first-order); orange: with all its "
        "interactions (total). Lines: bootstrap intervals of 95 %. Rows of the design with a failed run are left out."
    )
    return f"<h3>Sobol indices</h3><p class=note>{note}</p><div class=spread>{figures}</div>"


def _figure(study: Study, space: Space, name: str) -> str:
    if study.constant(name):
        return ""  # a constant output has no variance
    try:
        content = _chart(name, indices(space, np.asarray(study.columns[name], dtype=float)))
    except HricError as error:
        content = f"<p class=note>{escape(error)}</p>"
    return f"<figure><figcaption>{escape(study.label(name))}</figcaption>{content}</figure>"


def _chart(output: str, found: Mapping[str, Index]) -> str:
    ends = [end for one in found.values() for end in (*one.first_interval, *one.total_interval)]
    axis = chart.Axis(min(0.0, *ends), max(1.0, *ends), LEFT, RIGHT)
    bottom = TOP + ROW * len(found)
    parts = list(axis.drawn(bottom, "share of the variance [1]", TOP))
    for row, (name, one) in enumerate(sorted(found.items(), key=lambda item: -item[1].total)):
        middle = TOP + ROW * (row + 0.5)
        parts.append(chart.text(LEFT - 8.0, middle + 4.0, name, "", "end"))
        parts += _index(axis, "first", middle - APART, one.first, one.first_interval, name)
        parts += _index(axis, "total", middle + APART, one.total, one.total_interval, name)
    said = ", ".join(f"{name} {one.first:.2f} and {one.total:.2f}" for name, one in found.items())
    return chart.svg(WIDTH, bottom + 34.0, f"first-order and total indices of {output}: {said}", parts)


def _index(axis: chart.Axis, look: str, y: float, value: float, ends: tuple[float, float], name: str) -> Iterator[str]:
    words = f"{name}, {look}: {value:.3f} ({ends[0]:.3f} to {ends[1]:.3f})"
    yield chart.line(look, axis.x(ends[0]), y, axis.x(ends[1]), y)
    yield chart.text(WIDTH, y + 4.0, f"{round(value, 2) + 0.0:.2f}", "", "end")
    yield chart.rectangle(look, axis.x(value) - 3.5, y - 3.5, 7.0, 7.0, words)
