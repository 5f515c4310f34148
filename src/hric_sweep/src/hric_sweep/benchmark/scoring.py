"""Scoring of a benchmark: statistics of each score by controller and collaboration, ranks, order of the controllers.

There is no total score over the categories: only `RULE` determines the order.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median

from hric_sweep.benchmark.definition import (
    ERGONOMICS,
    FINDINGS,
    TASK,
    Benchmark,
    BenchmarkRun,
    Collaboration,
    Score,
)
from hric_sweep.records import RunResponse

ROBUSTNESS = "robustness"
"""Category that ranks the spread of all scores over bodies and seeds."""
RULE = (
    "1. findings: fewer runs that are above a limit or could not be judged; 2. ergonomics: smaller mean rank; "
    "3. task: smaller mean rank; 4. robustness: fewer runs not completed, then smaller mean rank of the spread. A "
    "later "
    "category counts only if all earlier ones are equal. In a collaboration, controllers are ranked by the median of "
    "each score over bodies and seeds; all scores have equal weight; controllers that differ by no more than the "
    "tolerance share a rank."
)
"""Rule by which controllers are ordered."""


@dataclass(frozen=True)
class ScoreSummary:
    """Statistics of a score over all runs that have a value; None: no run has one.

    Attributes:
        median, lowest, highest: median, smallest and largest value.
        by_body: median of each body's runs, by name of the body.
    """

    median: float | None
    lowest: float | None
    highest: float | None
    by_body: Mapping[str, float | None]

    @property
    def spread(self) -> float | None:
        """Largest minus smallest value over all bodies and seeds."""
        return None if self.lowest is None or self.highest is None else self.highest - self.lowest


@dataclass(frozen=True)
class ScoreCell:
    """Results of one controller in one collaboration.

    Attributes:
        runs: number of runs.
        above: number of runs with a finding beyond its limit, or not assessable (infinite ratio to the limit).
        unknown: number of runs without a value for a finding, because they failed.
        incomplete: number of runs that failed, or have a task score that is unknown or beyond its limit.
        failures: number of runs by reason of failure.
        scores: summary of each score, by `CATEGORY.NAME`.
    """

    runs: int
    above: int
    unknown: int
    incomplete: int
    failures: Mapping[str, int]
    scores: Mapping[str, ScoreSummary]


@dataclass(frozen=True)
class Standing:
    """Rank of a controller in the whole benchmark, with the values that determine it.

    Attributes:
        name: name of the controller.
        rank: rank from 1; controllers that are equal by the rule share a rank.
        out_of_limits: number of runs that are above a limit or could not be judged.
        ergonomics, task, spread: mean rank over all collaborations in ergonomics, task and robustness.
        incomplete: number of runs whose task was not completed.
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


Cells = Mapping[tuple[str, str], ScoreCell]
"""Results by (collaboration, controller)."""
Ranks = Mapping[tuple[str, str], float]
"""Mean ranks by (collaboration, controller)."""


def cells(benchmark: Benchmark, responses: Mapping[BenchmarkRun, RunResponse]) -> Cells:
    """Summarise the results of all runs by (collaboration, controller)."""
    rows: dict[tuple[str, str], dict[BenchmarkRun, RunResponse]] = {}
    for run, response in responses.items():
        rows.setdefault((run.collaboration, run.controller), {})[run] = response
    return {key: _cell(benchmark.collaborations[key[0]], part) for key, part in rows.items()}


def _cell(collaboration: Collaboration, rows: Mapping[BenchmarkRun, RunResponse]) -> ScoreCell:
    above = unknown = incomplete = 0
    for response in rows.values():
        findings = _states(collaboration, FINDINGS, response)
        above += "beyond" in findings
        unknown += "beyond" not in findings and "unknown" in findings
        incomplete += bool(response.failure) or _states(collaboration, TASK, response) > {"within"}
    failures = dict(Counter(response.failure for response in rows.values() if response.failure))
    scores = {key: _summary(key, rows) for key in collaboration.all}
    return ScoreCell(len(rows), above, unknown, incomplete, failures, scores)


def _states(collaboration: Collaboration, category: str, response: RunResponse) -> set[str]:
    """Return the states of a run's scores in a category: "within" (always), and "beyond" or "unknown" if any has it."""
    scores = collaboration.scores(category).items()
    return {"within", *(_state(score, response.outputs[f"{category}.{name}"]) for name, score in scores)}


def _state(score: Score, value: float | None) -> str:
    if value is None:
        return "unknown"
    return "beyond" if score.beyond(value) else "within"


def _summary(key: str, rows: Mapping[BenchmarkRun, RunResponse]) -> ScoreSummary:
    values: dict[str, list[float]] = {run.body: [] for run in rows}
    for run, response in rows.items():
        values[run.body] += [] if (value := response.outputs[key]) is None else [float(value)]
    known = [value for values_of_body in values.values() for value in values_of_body]
    by_body = {body: median(values_of_body) if values_of_body else None for body, values_of_body in values.items()}
    return ScoreSummary(median(known) if known else None, min(known, default=None), max(known, default=None), by_body)


def ranks(values: Mapping[str, float | None], sign: float, tolerance: float) -> dict[str, int]:
    """Return the rank of each controller by one score: 1 + the number of controllers that are clearly better.

    Clearly better means better by more than the tolerance. A controller without a value is last.

    Args:
        values: score by controller.
        sign: 1 if smaller is better, -1 if larger is better.
        tolerance: relative difference (of the larger of two values) up to which they count as equal [1].
    """
    worst = {name: math.inf if value is None else sign * value for name, value in values.items()}
    return {
        name: 1 + sum(_better(other, value, tolerance) for who, other in worst.items() if who != name)
        for name, value in worst.items()
    }


def _better(a: float, b: float, tolerance: float) -> bool:
    return not math.isinf(a) if math.isinf(b) else b - a > tolerance * max(abs(a), abs(b))


def category_ranks(benchmark: Benchmark, results: Cells, controllers: Sequence[str], category: str) -> Ranks:
    """Return the mean rank over the scores of a category, by collaboration and controller.

    In the category ROBUSTNESS, the ranked values are the spreads of all scores except findings; smaller is better.
    """
    mean_ranks = {}
    for name, collaboration in benchmark.collaborations.items():
        scores = {key: score for key, score in collaboration.all.items() if _belongs(key, category)}
        by_score = [
            ranks(
                {who: _value(results[name, who].scores[key], category) for who in controllers},
                1.0 if category == ROBUSTNESS else score.sign,
                benchmark.tolerance,
            )
            for key, score in scores.items()
        ]
        for who in controllers:
            mean_ranks[name, who] = float(mean(rank[who] for rank in by_score)) if by_score else 1.0
    return mean_ranks


def _belongs(key: str, category: str) -> bool:
    return not key.startswith(FINDINGS) if category == ROBUSTNESS else key.startswith(f"{category}.")


def _value(score: ScoreSummary, category: str) -> float | None:
    return score.spread if category == ROBUSTNESS else score.median


def standings(benchmark: Benchmark, results: Cells, controllers: Sequence[str]) -> list[Standing]:
    """Return the overall result of each controller, ordered by RULE."""
    overall = {
        category: _overall(category_ranks(benchmark, results, controllers, category), controllers)
        for category in (ERGONOMICS, TASK, ROBUSTNESS)
    }
    rows = []
    for who in controllers:
        cells_of = [results[name, who] for name in benchmark.collaborations]
        out, incomplete = sum(cell.above + cell.unknown for cell in cells_of), sum(cell.incomplete for cell in cells_of)
        key = (out, overall[ERGONOMICS][who], overall[TASK][who], incomplete, overall[ROBUSTNESS][who])
        rows.append((key, who, sum(cell.runs for cell in cells_of)))
    rows.sort()
    return [Standing(who, 1 + sum(other < key for other, _, _ in rows), *key, runs) for key, who, runs in rows]


def _overall(by_cell: Ranks, controllers: Sequence[str]) -> dict[str, float]:
    """Return each controller's mean rank over collaborations, rounded so that equal means compare as equal."""
    return {who: round(mean(rank for (_, name), rank in by_cell.items() if name == who), 9) for who in controllers}
