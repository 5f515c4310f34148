"""Text with the estimated probability that an output exceeds its limit, its confidence interval and method."""

import numpy as np
import numpy.typing as npt

from hric_report.html.table import PageTable, number
from hric_sweep.page.study import EXCEEDED, FAILED, RecordedSweep
from hric_sweep.page.words import CROSS_ENTROPY, GRID, LIST, RANDOM, SALTELLI, SPREAD, TPE
from hric_sweep.samplers.sampler import CrossCheck, Estimate
from hric_sweep.statistics.intervals import LEVEL, clopper_pearson

APART = 6
"""Maximum number of words a variable may have for a table of the probability by word. Project default,
unconfirmed."""
KIND = (
    "Clopper-Pearson interval.",
    "Clopper-Pearson interval for independent points; the points are spread evenly, so it is usually too wide.",
)
TRUSTED = 20.0
"""Minimum effective number of exceeding runs for an importance sampling interval with nominal coverage
(docs/concepts/rare_events.md)."""
DESIGNED = {
    GRID: "The points were chosen, not drawn",
    LIST: "The points were chosen, not drawn",
    TPE: "The points were searched for the worst case, not drawn",
    SALTELLI: "Runs of this design share values with each other",
}
"""Reason why the runs of a sampler give no probability, by sampler."""


def condition(study: RecordedSweep) -> str:
    """Return the condition that counts as exceedance, e.g. "peak > 140 N"; "exceeded" if the sweep has none."""
    limit = study.limit
    if limit is None:
        return "exceeded"
    unit = study.about[limit.output].unit if limit.output in study.about else ""
    return f"{limit.output} {limit.sign} {limit.bound:g}{' ' + unit if unit else ''}"


def lines(study: RecordedSweep, assumption: str) -> list[str]:
    """Return the estimated probability as text, followed by notes, some empty; empty if the sweep has no limit.

    `assumption`: condition of the probability, such as "given the distributions below".
    """
    if study.limit is None:
        return []
    exceeded, failed = study.count("exceeded"), study.count("failed")
    if study.sampler in DESIGNED:
        why = f"{DESIGNED[study.sampler]}: this share is not a probability and has no interval."
        return [f"{condition(study)} in {exceeded} of {study.runs - failed} runs", why]
    of = f"P({condition(study)} {assumption})"
    estimate = study.estimate or _counted(study, exceeded, failed)
    if estimate is None:
        return [
            f"{of}: not known yet",
            "The estimate follows when the first runs (for subset simulation: all levels) are finished.",
        ]
    level = f"{100.0 * estimate.level:g} % interval"
    low, high = number(estimate.low, 3), number(estimate.high, 3)
    value = f" = {number(estimate.probability, 3)}" if estimate.probability > 0.0 else ": no run exceeded"
    line = f"{of}{value}, {level} {low} to {high}"
    return [line, _method(study, estimate), _failed(estimate.failed), _check(estimate.check)]


def _counted(study: RecordedSweep, exceeded: int, failed: int) -> Estimate | None:
    """Return an estimate from the counts of unweighted runs; None: no run finished, or the runs have weights."""
    if study.sampler not in (RANDOM, *SPREAD) or study.runs == failed:
        return None
    low, high = clopper_pearson(exceeded, study.runs).low, clopper_pearson(exceeded + failed, study.runs).high
    share, size = exceeded / (study.runs - failed), float(exceeded)
    return Estimate(share, low, high, LEVEL, study.runs, exceeded, failed, size, "Clopper-Pearson")


def by_value(study: RecordedSweep) -> list[PageTable]:
    """Return, for each variable with words as values, a table of the exceedance probability by word."""
    if study.limit is None or study.sampler not in (RANDOM, *SPREAD):
        return []
    interval = f"{100.0 * LEVEL:g} % interval, including failed runs"
    head = ("runs that did not fail", "exceeded", "probability", interval)
    tables = []
    for name in study.variables:
        codes, labels = study.numbers(name)
        if 1 < len(labels) <= APART:
            rows = tuple((label, *_of_one(study, codes == code)) for code, label in enumerate(labels))
            tables.append(PageTable(f"By {name}", (name, *head), rows, KIND[study.sampler in SPREAD]))
    return tables


def _of_one(study: RecordedSweep, chosen: npt.NDArray[np.bool_]) -> tuple[str, ...]:
    """Return the cells of a row of `by_value`, for the chosen runs."""
    runs, kinds = int(chosen.sum()), study.kinds[chosen]
    exceeded, failed = int((kinds == EXCEEDED).sum()), int((kinds == FAILED).sum())
    low, high = clopper_pearson(exceeded, runs).low, clopper_pearson(exceeded + failed, runs).high
    share = number(exceeded / (runs - failed), 3) if runs > failed else "-"
    return str(runs - failed), str(exceeded), share, f"{number(low, 3)} to {number(high, 3)}"


def _method(study: RecordedSweep, estimate: Estimate) -> str:
    runs = f"{estimate.exceeded} of {estimate.runs - estimate.failed} runs exceeded"
    sentences = f"{estimate.method[:1].upper()}{estimate.method[1:]}; {runs}."
    if study.weighted:
        sentences += f" Runs have weights: effective number of exceeding runs {number(estimate.ess, 3)}."
        if study.sampler == CROSS_ENTROPY and estimate.ess < TRUSTED:
            sentences += f" Below about {TRUSTED:g} the interval is not reliable: more runs are needed."
    if study.sampler in SPREAD:
        sentences += (
            " The points are spread evenly, not drawn independently, so this interval for independent points is "
            "usually "
            "too wide."
        )
    return sentences


def _failed(failed: int) -> str:
    if not failed:
        return ""
    return f"Failed runs: {failed}. The interval's lower end counts them as not exceeding, its upper end as exceeding."


def _check(check: CrossCheck | None) -> str:
    if not check:
        return ""
    ends = f"{number(check.low, 3)} to {number(check.high, 3)}"
    agrees = "agrees" if check.agrees else "DOES NOT AGREE"
    return f"Check with unweighted runs: {check.exceeded} of {check.runs} runs, {ends}; it {agrees}."
