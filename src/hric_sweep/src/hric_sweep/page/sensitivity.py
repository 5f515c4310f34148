"""Dependence of the outputs: rank correlations of all pairs of columns, and of each output with each variable."""

import contextlib

import numpy as np

from hric_core.errors import HricError
from hric_report.html.tables import escape
from hric_sweep.page.sample import Sample
from hric_sweep.page.study import OUTPUT, VARIABLE, Study
from hric_sweep.page.words import SALTELLI
from hric_sweep.statistics.intervals import effective_size
from hric_sweep.statistics.sensitivity import rank_correlation

FEWEST = 10.0
"""Effective number of runs below which a rank correlation is not shown. Project default, unconfirmed."""
LIKELY = 0.05
"""Threshold of the p-value above which a correlation is shown faint. Project default, unconfirmed."""
Ranks = dict[str, dict[str, tuple[float, float]]]
"""Spearman's rank correlation of a column with another, and its p-value."""


def ranks(study: Study, sample: Sample) -> Ranks:
    """Return rank correlations of all pairs of ordered columns, over the runs that have both values.

    A column of words is ordered if it has two different words. The result is empty if the runs are no sample of the
    distributions.
    """
    if sample.refused:
        return {}
    values = {}
    for name in (*study.named(VARIABLE), *study.named(OUTPUT)):
        numbers, labels = study.numbers(name)
        if len(labels) <= 2:
            values[name] = numbers
    found: Ranks = {name: {} for name in values}
    names = list(values)
    for k, first in enumerate(names):
        for second in names[k + 1 :]:
            a, b = values[first], values[second]
            if effective_size(sample.counts[~np.isnan(a) & ~np.isnan(b)]) < FEWEST - 1e-9:
                continue
            with contextlib.suppress(HricError):  # one of the two is constant
                found[first][second] = found[second][first] = rank_correlation(a, b, sample.counts)
    return found


def part(study: Study, sample: Sample, found: Ranks) -> str:
    """Return the HTML table of each output with each variable; "" if no correlation is known."""
    variables, outputs = study.named(VARIABLE), study.named(OUTPUT)
    if sample.refused and study.runs:
        return f"<p class=note>No rank correlations. {escape(sample.refused)}</p>"
    if not any(found.get(name, {}).get(output) for name in variables for output in outputs):
        return ""
    head = "".join(f"<th class=num>{escape(study.label(output))}</th>" for output in outputs)
    body = "".join(
        f"<tr><td>{escape(study.label(name))}</td>"
        + "".join(_cell(found.get(name, {}).get(output)) for output in outputs)
        + "</tr>"
        for name in variables
    )
    note = (
        "Spearman's rank correlation: 1 where the output rises with the variable, -1 where it falls, whatever the "
        "curve; near 0 also where it rises and falls. Faint: chance alone reaches as much in one of twenty sweeps. "
        f"-: words have no order, one of both is the same in all runs, or fewer than {FEWEST:g} runs have both. "
        f"{escape(sample.note)}"
    )
    if study.sampler == SALTELLI:
        note += " Runs of this design share values with each other, so chance reaches more than it says."
    return (
        f"<h3>Rank correlations</h3><p class=note>{note}</p><div class=wide><table>"
        f"<thead><tr><th>variable</th>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _cell(found: tuple[float, float] | None) -> str:
    if found is None:
        return "<td class=rank>-</td>"
    value, chance = round(found[0], 2) + 0.0, found[1]  # + 0.0: avoids -0.00
    if chance > LIKELY:
        return f'<td class="rank faint">{value:.2f}</td>'
    colour = "--s1" if value > 0.0 else "--s6"
    shade = f"background:color-mix(in srgb, var({colour}) {100.0 * abs(value):.0f}%, transparent)"
    return f'<td class=rank style="{shade}">{value:.2f}</td>'
