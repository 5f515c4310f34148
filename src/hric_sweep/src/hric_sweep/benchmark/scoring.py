"""Scoring of a benchmark: values by controller and collaboration, ranks, and one order.

Categories are never added up. The order follows from `RULE` alone.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median
from typing import Any

from hric_sweep.benchmark.definition import ERGONOMICS, FINDINGS, TASK, Benchmark, Collaboration, Score
from hric_sweep.benchmark.running import Run

RULE = (
    "1. findings: fewer runs that are above a limit, or could not be judged; 2. ergonomics, 3. task: smaller mean "
    "rank; 4. robustness: fewer runs not completed, then smaller mean rank of the spread. A later category decides "
    "only where all before it are equal. The rank in a collaboration is that of the median over bodies and seeds, "
    "score by score, all scores alike; controllers within the tolerance of each other share a rank."
)
"""Rule by which controllers are ordered."""


@dataclass(frozen=True)
class Cell:
    """Results of one controller in one collaboration.

    Attributes:
        runs: number of runs.
        above: runs with a finding beyond its limit, or with one that is not assessable (an infinite share).
        unknown: runs with an unknown finding, because they failed.
        incomplete: runs that failed, or have a score of the task that is unknown or beyond its limit.
        failures: number of runs by reason of failure.
        values: median of each score over all runs that have it, by category and name; None: no run has it.
        lowest, highest: extreme values of the same runs.
        by_body: medians of each score, by body.
    """

    runs: int
    above: int
    unknown: int
    incomplete: int
    failures: Mapping[str, int]
    values: Mapping[tuple[str, str], float | None]
    lowest: Mapping[tuple[str, str], float | None]
    highest: Mapping[tuple[str, str], float | None]
    by_body: Mapping[str, Mapping[tuple[str, str], float | None]]

    def spread(self, key: tuple[str, str]) -> float | None:
        """Return the largest minus the smallest value of a score over all bodies and seeds."""
        low, high = self.lowest[key], self.highest[key]
        return None if low is None or high is None else high - low


@dataclass(frozen=True)
class Standing:
    """Result of a controller in the whole benchmark.

    Attributes:
        name: name of the controller.
        rank: rank from 1; controllers that are equal by the rule share a rank.
        out_of_limits: runs that are above a limit or could not be judged.
        ergonomics, task, spread: mean ranks over collaborations.
        incomplete: runs whose task was not completed.
        runs: number of all runs.
    """

    name: str
    rank: int
    out_of_limits: int
    ergonomics: float
    task: float
    incomplete: int
    spread: float
    runs: int


def cells(
    benchmark: Benchmark, runs: Sequence[Run], responses: Sequence[Mapping[str, Any]]
) -> dict[tuple[str, str], Cell]:
    """Return the results by collaboration and controller.

    Args:
        benchmark: definition of the benchmark.
        runs: runs of the benchmark.
        responses: responses in the order of the runs.
    """
    rows: dict[tuple[str, str], list[tuple[Run, Mapping[str, Any]]]] = {}
    for run, response in zip(runs, responses, strict=True):
        rows.setdefault((run.collaboration, run.controller), []).append((run, response))
    return {key: _cell(benchmark.collaborations[key[0]], own) for key, own in rows.items()}


def _cell(one: Collaboration, rows: Sequence[tuple[Run, Mapping[str, Any]]]) -> Cell:
    failures: dict[str, int] = {}
    above = unknown = incomplete = 0
    for _, response in rows:
        found, failure = response["outputs"], response["failure"]
        if failure:
            failures[failure] = failures.get(failure, 0) + 1
        states = [_state(score, found[f"{FINDINGS}.{name}"]) for name, score in one.findings.items()]
        above += "beyond" in states
        unknown += "beyond" not in states and "unknown" in states
        done = [_state(score, found[f"{TASK}.{name}"]) == "within" for name, score in one.task.items()]
        incomplete += bool(failure) or not all(done)
    bodies = list(dict.fromkeys(run.body for run, _ in rows))
    known = {key: _known(key, rows) for key in one.all}
    return Cell(
        len(rows),
        above,
        unknown,
        incomplete,
        failures,
        {key: _of(median, values) for key, values in known.items()},
        {key: _of(min, values) for key, values in known.items()},
        {key: _of(max, values) for key, values in known.items()},
        {
            body: {key: _of(median, _known(key, [row for row in rows if row[0].body == body])) for key in one.all}
            for body in bodies
        },
    )


def _known(key: tuple[str, str], rows: Sequence[tuple[Run, Mapping[str, Any]]]) -> list[float]:
    found = (response["outputs"][".".join(key)] for _, response in rows)
    return [float(value) for value in found if value is not None]


def _of(what: Callable[[list[float]], float], values: list[float]) -> float | None:
    return float(what(values)) if values else None


def _state(score: Score, value: float | None) -> str:
    if value is None:
        return "unknown"
    return "beyond" if score.beyond(value) else "within"


def ranks(values: Mapping[str, float | None], sign: float, tolerance: float) -> dict[str, int]:
    """Return the rank of each controller by one score: 1 + the number of controllers that are clearly better.

    Clearly better means by more than the tolerance. A controller without a value is last.

    Args:
        values: score by controller.
        sign: 1 if smaller is better, -1 if larger is better.
        tolerance: share of the larger of two values within which they count as equal.
    """
    worst = {name: math.inf if value is None else sign * value for name, value in values.items()}
    return {
        name: 1 + sum(_better(other, own, tolerance) for who, other in worst.items() if who != name)
        for name, own in worst.items()
    }


def _better(a: float, b: float, tolerance: float) -> bool:
    if math.isinf(b):
        return not math.isinf(a)
    return b - a > tolerance * max(abs(a), abs(b))


def category_ranks(
    benchmark: Benchmark, found: Mapping[tuple[str, str], Cell], controllers: Sequence[str], category: str
) -> dict[tuple[str, str], float]:
    """Return the mean rank over the scores of a category, by collaboration and controller."""
    result = {}
    for one in benchmark.collaborations.values():
        own = {
            name: ranks(
                {who: found[one.name, who].values[category, name] for who in controllers},
                score.sign,
                benchmark.tolerance,
            )
            for name, score in one.scores(category).items()
        }
        for who in controllers:
            result[one.name, who] = float(mean(rank[who] for rank in own.values())) if own else 1.0
    return result


def spread_ranks(
    benchmark: Benchmark, found: Mapping[tuple[str, str], Cell], controllers: Sequence[str]
) -> dict[tuple[str, str], float]:
    """Return the mean rank by the spread of all scores, by collaboration and controller."""
    result = {}
    for one in benchmark.collaborations.values():
        own = [
            ranks({who: found[one.name, who].spread(key) for who in controllers}, 1.0, benchmark.tolerance)
            for key in one.all
            if key[0] != FINDINGS
        ]
        for who in controllers:
            result[one.name, who] = float(mean(rank[who] for rank in own))
    return result


def standings(
    benchmark: Benchmark, found: Mapping[tuple[str, str], Cell], controllers: Sequence[str]
) -> list[Standing]:
    """Return all controllers in the order of RULE."""
    overall = {
        category: _overall(category_ranks(benchmark, found, controllers, category), controllers)
        for category in (ERGONOMICS, TASK)
    }
    spread = _overall(spread_ranks(benchmark, found, controllers), controllers)
    rows = []
    for who in controllers:
        own = [found[name, who] for name in benchmark.collaborations]
        out, incomplete = sum(one.above + one.unknown for one in own), sum(one.incomplete for one in own)
        rows.append((who, (out, overall[ERGONOMICS][who], overall[TASK][who], incomplete, spread[who]), own))
    rows.sort(key=lambda row: (row[1], row[0]))
    return [
        Standing(who, 1 + sum(other < key for _, other, _ in rows), *key, sum(one.runs for one in own))
        for who, key, own in rows
    ]


def _overall(by_cell: Mapping[tuple[str, str], float], controllers: Sequence[str]) -> dict[str, float]:
    """Return the mean over collaborations, rounded so that equal means compare as equal."""
    return {who: round(mean(rank for (_, name), rank in by_cell.items() if name == who), 9) for who in controllers}
