"""Descriptions of a sweep's sampler, variables and distributions, in words and as a table."""

import math
from collections.abc import Mapping
from typing import Any

from hric_report.html.table import PageTable, number
from hric_sweep.page.study import RecordedSweep

RANDOM, GRID, LIST, TPE, SALTELLI = "random", "grid", "list", "tpe", "saltelli"
CROSS_ENTROPY, SUBSET = "cross_entropy", "subset"
SPREAD = ("sobol", "lhs")
SAMPLERS: Mapping[str, str] = {
    RANDOM: "points drawn at random and independently",
    "sobol": "scrambled Sobol points, spread evenly over the distributions",
    "lhs": "a Latin hypercube, spread evenly over each distribution",
    SALTELLI: "Saltelli's design for Sobol indices",
    GRID: "a grid of all combinations of values",
    LIST: "a list of given points",
    TPE: "a search for the worst case (TPE), which samples no distribution",
    CROSS_ENTROPY: "importance sampling by the cross-entropy method, weighted back to the distributions",
    SUBSET: "subset simulation, level by level towards the limit",
}
"""Description of each sampler, shown after its name."""


def figure(value: Any, digits: int = 4) -> str:
    """Return a number as text, also an infinite one (such as a ratio to a limit of 0)."""
    if isinstance(value, float) and math.isinf(value):  # a number of numpy, too
        return "infinite" if value > 0.0 else "minus infinite"
    return number(value, digits)


def sampler(study: RecordedSweep) -> str:
    """Return a description of the sweep's sampler, its options and the seeds of the runs."""
    settings = dict(study.section.get("sampler") or {})
    settings.pop("kind", None)
    options = "".join(f", {key} {number(value)}" for key, value in settings.items() if value is not None)
    seeds = {
        "common": "; all runs share one seed (common random numbers)",
        "each": "; each run has its own seed",
    }.get(str(study.section.get("seeds", "")), "")
    kind = study.sampler
    return f"{kind}: {SAMPLERS[kind]}{options}{seeds}" if kind in SAMPLERS else f"{kind or 'unknown'}{options}{seeds}"


def distribution(settings: Mapping[str, object]) -> str:
    """Return a distribution in words; `settings`: entry `distribution` of a variable in the sweep file."""
    options = {key: value for key, value in settings.items() if value is not None}
    kind = str(options.pop("kind", ""))
    low, high = options.pop("low", None), options.pop("high", None)
    if kind in ("uniform", "log_uniform", "triangular"):
        rest = _rest(options)
        return f"{kind.replace('_', '-')}, {number(low)} to {number(high)}{rest}"
    cut = [f"{word} {number(bound)}" for word, bound in (("from", low), ("to", high)) if bound is not None]
    ends = f", truncated {' '.join(cut)}" if cut else ""
    if kind == "population":
        of, quantity = options.pop("of", ""), options.pop("quantity", "")
        return f"{quantity} of the population {of}, by percentile{_rest(options)}{ends}"
    return f"{kind.replace('_', '-')}{_rest(options)}{ends}"


def _rest(options: Mapping[str, object]) -> str:
    return "".join(f", {key.replace('_', ' ')} {_value(value)}" for key, value in options.items())


def _value(value: Any) -> str:
    return ", ".join(_value(item) for item in value) if isinstance(value, list) else number(value)


def varied(study: RecordedSweep) -> PageTable:
    """Return the table of the variables with their distributions."""
    settings = study.section.get("vary") or {}
    rows = []
    for name in study.variables:
        variable = settings.get(name) or {}
        paths = variable.get("paths") or ()
        about = study.about[name]
        shown = distribution(variable.get("distribution") or {}) if variable.get("distribution") else "-"
        unit = about.unit or ("-" if study.numbers(name)[1] else "1")
        rows.append((name, unit, shown, about.text, ", ".join(map(str, paths))))
    head = ("variable", "unit", "distribution", "description", "parameters it sets")
    return PageTable("", head, tuple(rows), _correlations(study))


def _correlations(study: RecordedSweep) -> str:
    pairs = study.section.get("correlation") or ()
    if not pairs:
        return "The variables are independent of each other."
    text = ", ".join(f"{a} with {b} {number(value)}" for a, b, value in pairs)
    return f"Correlated in their normal scores (Gaussian copula): {text}; the others are independent."
