"""Posture scoring methods (RULA, REBA, plugins), and their scores over time with the reason for each point.

    for key, method in methods().items():
        method.table().title, method.score(posture, task).score

A method is a class exported as a plugin of the base `hric_assessment::PostureMethod`; verdict, report and schema get
all methods from here.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from hric_assessment.ergonomics.posture import NOTHING_KNOWN, Known, Posture, Spread, Task
from hric_assessment.tables import Adder, Band, Condition, PostureTable
from hric_core import plugins
from hric_core.errors import UnknownNameError
from hric_core.geometry import FloatArray

IntArray = np.ndarray[Any, np.dtype[np.signedinteger[Any]]]
Total = Callable[["Scorer"], IntArray]
VARIATION = 5.0
"""Shift of the thresholds that this project chose, by which their influence is measured [deg] (project default)."""


@dataclass(frozen=True)
class Step:
    """One contribution to a posture score over time.

    Attributes:
        part: part of the body, or of the method.
        points: points at each instant, shape (n,).
        reasons: possible reasons, phrases.
        case: index of the reason that applies at each instant, shape (n,).
        angle: angle that determines the points, shape (n,) [rad]; None: a flag determines them.
        spread: uncertainty of the angle, half-width of an interval, one value or shape (n,) [rad].
    """

    part: str
    points: IntArray
    reasons: tuple[str, ...]
    case: IntArray
    angle: FloatArray | None = None
    spread: Spread = 0.0

    def reason(self, index: int) -> str:
        """Return a text with the points at one instant and the reason for them."""
        spread = float(np.broadcast_to(self.spread, len(self.points))[index])
        about = f" +- {math.degrees(spread):.1f}" if spread else ""
        value = "" if self.angle is None else f" ({math.degrees(self.angle[index]):.1f}{about} deg)"
        return f"{self.part} {self.points[index]:+d}: {self.reasons[self.case[index]]}{value}"


@dataclass(frozen=True)
class Scores:
    """Posture scores over time, with the range that follows from uncertain angles.

    Attributes:
        method: title, edition and version of the table.
        table: scoring table.
        score: score at each instant, shape (n,).
        parts: scores of parts of the body and of tables A, B and C, each of shape (n,).
        steps: contributions to `highest`.
        lowest, highest: lowest and highest score that the uncertainty of the angles allows, shape (n,).
        lowest_steps: contributions to `lowest`.
        stricter, looser: score with all thresholds that this project chose smaller, and larger, by VARIATION, shape
            (n,).
        assumptions: values assumed for unknown fields. Unknown angles get the lowest score, so the true score can only
            be higher; only unknown support of arm or trunk would lower it.
    """

    method: str
    table: PostureTable
    score: IntArray
    parts: Mapping[str, IntArray]
    steps: tuple[Step, ...]
    lowest: IntArray
    highest: IntArray
    lowest_steps: tuple[Step, ...]
    stricter: IntArray
    looser: IntArray
    assumptions: tuple[str, ...]

    def reasons(self, index: int) -> list[str]:
        """Return points and reason of each contribution that has points at one instant."""
        return [step.reason(index) for step in self.steps if step.points[index] != 0]

    def uncertain(self, index: int) -> list[str]:
        """Return points and reason of each contribution that at one instant depends on the uncertainty of an angle."""
        pairs = zip(self.steps, self.lowest_steps, strict=True)
        return [high.reason(index) for high, low in pairs if high.points[index] != low.points[index]]

    def level(self, index: int) -> str:
        """Return the name of the score's level at one instant, such as "acceptable"."""
        return self.table.level(int(self.score[index]))

    @property
    def chosen(self) -> list[str]:
        """Sentences about the thresholds that no source defines, and about their influence on these scores."""
        moved = int(np.count_nonzero((self.stricter != self.score) | (self.looser != self.score)))
        lines = [
            f"{name}: {threshold.value:g} deg, chosen here: {threshold.text}"
            for name, threshold in self.table.chosen.items()
        ]
        return [*lines, f"changing them by {VARIATION:g} deg either way changes {moved} of {len(self.score)} scores"]


class Scorer:
    """Scorer of body parts by a table.

    Args:
        table: scoring table, such as RULA's.
        known: fields of the posture and the task.
        shift: shift of all thresholds that this project chose [deg].
        end: value of uncertain angles that counts: -1 the one with the lowest score, 1 with the highest, 0 the middle.

    Attributes:
        steps: contributions of all parts scored so far.
        parts: scores of the parts and of tables A, B and C, by name, each of shape (n,).
    """

    def __init__(self, table: PostureTable, known: Known, shift: float = 0.0, end: int = 0) -> None:
        self._end = end
        self.known = known
        self.table = table
        self.steps: list[Step] = []
        self.parts: dict[str, IntArray] = {}
        self._shift = shift

    def part(self, name: str) -> IntArray:
        """Score a part of the body and return its score, at least 1, shape (n,)."""
        part = self.table.parts[name]
        label = name.replace("_", " ")
        steps = [self._band(label, band) for band in part.bands] + [self._adder(label, adder) for adder in part.add]
        if part.start:
            steps.insert(0, self.constant(label, part.start, "start value"))
        self.steps += steps
        self.parts[name] = np.maximum(1, sum((step.points for step in steps), np.zeros(self.known.count, np.int64)))
        return self.parts[name]

    def constant(self, part: str, points: int, reason: str) -> Step:
        """Return a contribution with the same points at all instants."""
        zeros = np.zeros(self.known.count, np.int8)
        return Step(part, zeros + points, (reason,), zeros)

    def flagged(self, part: str, points: int, reason: str, flag: Any) -> IntArray:
        """Add a contribution that counts while a flag is True, and return its points, shape (n,)."""
        case = np.asarray(flag, np.int8)
        step = Step(part, points * case, (f"not {reason}", reason), case)
        self.steps.append(step)
        return step.points

    def cases(self, part: str, points: Sequence[int], reasons: Sequence[str], case: IntArray) -> IntArray:
        """Add a contribution whose points depend on a case, and return its points, shape (n,).

        Args:
            part: part of the body, or of the method.
            points: points of each case.
            reasons: reason of each case.
            case: index of the case at each instant, shape (n,).
        """
        step = Step(part, np.array(points)[case], tuple(reasons), case)
        self.steps.append(step)
        return step.points

    def _band(self, label: str, band: Band) -> Step:
        angle, spread = self.known[band.angle], self._spread(band.angle)
        bounds = [self.table.degrees(bound, self._shift) for bound in band.bounds]
        case, scores = _case(band, bounds, angle), np.array(band.scores, np.int8)
        if self._end and np.any(spread):
            first, last = _case(band, bounds, angle - spread), _case(band, bounds, angle + spread)
            for other, score in enumerate(band.scores):
                better = self._end * (score - scores[case]) > 0
                case = np.where(better & (first <= other) & (other <= last), other, case)
        reasons = [f"{band.angle.replace('_', ' ')} {between}" for between in _ranges(bounds)]
        points = scores[case]
        if band.unless is not None:
            spared = self.known[band.unless]
            reasons.append(band.unless.replace("_", " "))
            points, case = np.where(spared, band.then, points), np.where(spared, len(bounds) + 1, case)
        return Step(label, points, tuple(reasons), case, angle, spread)

    def _adder(self, label: str, adder: Adder) -> Step:
        case = np.any([self._fulfilled(condition) for condition in adder.any], axis=0).astype(np.int8)
        only = adder.any[0].angle if len(adder.any) == 1 else None
        angle = None if only is None else self.known[only]
        spread = 0.0 if only is None else self._spread(only)
        return Step(label, adder.score * case, (f"not {adder.text}", adder.text), case, angle, spread)

    def _fulfilled(self, condition: Condition) -> Any:
        if condition.flag is not None:
            return self.known[condition.flag]
        name = str(condition.angle)
        angle = self.known[name] if condition.above is not None else np.abs(self.known[name])
        threshold = math.radians(self.table.degrees(str(condition.above or condition.beyond), self._shift))
        return angle + (self._end * self._spread(name) if self._end else 0.0) > threshold

    def _spread(self, name: str) -> Spread:
        """Return the uncertainty of an angle, half-width of an interval, one value or shape (n,) [rad]."""
        return self.known.spread.get(name, 0.0)


def scored(table: PostureTable, method: str, known: Known, total: Total) -> Scores:
    """Return the posture scores by a table, with their range.

    Args:
        table: scoring table, such as RULA's.
        method: name and version of the table.
        known: fields of the posture and the task.
        total: function that scores the parts with a scorer and combines them into the score.
    """
    scorer = Scorer(table, known)
    score, stricter, looser = total(scorer), *(total(Scorer(table, known, shift)) for shift in (-VARIATION, VARIATION))
    low, high, lowest, highest = scorer, scorer, score, score
    if any(np.any(width) for width in known.spread.values()):
        low, high = Scorer(table, known, end=-1), Scorer(table, known, end=1)
        lowest, highest = total(low), total(high)
    ends = (lowest, highest, tuple(low.steps))
    return Scores(
        method, table, score, scorer.parts, tuple(high.steps), *ends, stricter, looser, tuple(known.assumptions)
    )


def _case(band: Band, bounds: Sequence[float], angle: FloatArray) -> IntArray:
    """Return the index of the band in which an angle lies, shape (n,); bounds: ascending [deg]; angle: [rad]."""
    case = np.zeros(len(angle), np.int8)
    for bound, below, above in zip(bounds, band.scores, band.scores[1:], strict=False):
        upper_counts = (above < below) != (bound in band.higher_on)
        case += angle >= math.radians(bound) if upper_counts else angle > math.radians(bound)
    return case


def _ranges(bounds: Sequence[float]) -> list[str]:
    inner = [f"{low:g} to {high:g} deg" for low, high in pairwise(bounds)]
    return [f"below {bounds[0]:g} deg", *inner, f"above {bounds[-1]:g} deg"]


def needed(table: PostureTable) -> list[str]:
    """Return the names of the posture fields that a scoring table uses."""
    names: dict[str, None] = {}
    for part in table.parts.values():
        for band in part.bands:
            names |= dict.fromkeys(filter(None, (band.angle, band.unless)))
        for adder in part.add:
            names |= dict.fromkeys(filter(None, (condition.flag or condition.angle for condition in adder.any)))
    return list(names)


def cells(rows: Mapping[str, Sequence[int]], row: IntArray, column: IntArray) -> IntArray:
    """Look up cells of a table, shape (n,).

    Args:
        rows: rows of the table, in order.
        row: row indices from 1 on, shape (n,); an index beyond the last row means the last.
        column: column indices from 1 on, shape (n,); an index beyond the last column means the last.
    """
    table = np.array(list(rows.values()), np.int64)
    return np.asarray(table[np.minimum(row, table.shape[0]) - 1, np.minimum(column, table.shape[1]) - 1])


def index(scores: Sequence[IntArray], sizes: Sequence[int]) -> IntArray:
    """Return the column number of a combination of scores, both starting at 1, shape (n,).

    Scoring tables list several scores in one row; the last score varies fastest.
    """
    number = np.zeros_like(scores[0])
    for score, size in zip(scores, sizes, strict=True):
        number = number * size + score - 1
    return number + 1


class PostureMethod:
    """Base class of methods that score the posture of one arm with the rest of the body; instances have no state.

    Attributes:
        table: function that returns the scoring table, whose title is the name of the method.
        task_fields: fields of `Task` that the method needs.
        versions: versions of table A; the first is the default.
        parts: smallest value of `human.parts` that has all joints of the method.
        supplements: True if findings of other methods are to be reported even if this method's score is unknown.
        legs: phrase about what joints of the legs add to the method's score; empty: nothing.
        by_table: True if angles affect the score only through the parts of the table, so that it may be looked up.
    """

    table: Callable[[], PostureTable]
    task_fields: tuple[str, ...]
    versions: tuple[str, ...] = ("current",)
    parts = "upper_body"
    supplements = False
    legs = ""
    by_table = False

    def total(self, scorer: Scorer, task: Task, version: str) -> IntArray:
        """Score the parts with `scorer` and return the total score, shape (n,); called several times per recording."""
        raise NotImplementedError

    def name(self, version: str) -> str:
        """Return title, edition and version of the table, for findings."""
        return self.table().name

    def score(
        self,
        posture: Posture,
        task: Task = NOTHING_KNOWN,
        version: str = "",
        spread: Mapping[str, Spread] = MappingProxyType({}),
    ) -> Scores:
        """Return the scores of a posture over time.

        Args:
            posture: posture of one arm and of the rest of the person.
            task: task of that arm; its load counts for the rest of the person, too.
            version: one of `versions`; empty: the default.
            spread: uncertainty of angles, half-width of an interval, one value or shape (n,) [rad], by name; inf: not
                known.

        Raises:
            HricError: fields have different lengths, the version does not exist, or the table lacks the coupling.
        """
        version, table = version or self.versions[0], self.table()
        if version not in self.versions:
            raise UnknownNameError(f"version of {table.title}'s table A", version, self.versions)
        known = Known(posture, task, [*needed(table), *self.task_fields], spread)
        return scored(table, self.name(version), known, lambda scorer: self.total(scorer, task, version))

    def highest(self, posture: Posture, task: Task, version: str, spread: Mapping[str, Spread]) -> IntArray:
        """Return the highest scores that uncertain angles allow, shape (n,); arguments: see `score`."""
        table = self.table()
        known = Known(posture, task, [*needed(table), *self.task_fields], spread)
        return self.total(Scorer(table, known, end=1), task, version or self.versions[0])


def methods() -> dict[str, PostureMethod]:
    """Return all posture methods, by their title in lower case, which is also their key in the verdict's JSON.

    Raises:
        HricError: a plugin cannot be imported, or a table is invalid.
    """
    exported = [plugins.find(plugins.POSTURE_METHOD, name)() for name in plugins.names(plugins.POSTURE_METHOD)]
    return {method.table().title.lower(): method for method in exported}


def method_of(subject: str) -> PostureMethod | None:
    """Return the posture method of the finding with this subject; None: the finding is not about a posture."""
    return methods().get(subject.partition(" of the ")[0].lower())
