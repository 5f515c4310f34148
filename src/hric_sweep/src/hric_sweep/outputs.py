"""Outputs of a run: numbers that a path selects from the metrics of the run.

A path consists of keys of metrics.json, separated by dots; `*` selects all items of a list or a mapping, and `reduce`
combines them into one number, which is NaN if one of them is null or NaN, that is, not known. Three groups exist only
in sweeps: `impact`, contacts of the person as the verdict assesses them; `supervision`, decisions of the safety
supervisor; and `collaboration`, numbers by which the benchmark compares controllers.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_analysis.values import KEYS
from hric_core.errors import HricError, ParameterError
from hric_core.parameters import choice, number, text
from hric_sweep.registry import FileSettings

IMPACT, SUPERVISION, COLLABORATION = "impact", "supervision", "collaboration"
SWEEP_GROUPS = (IMPACT, SUPERVISION, COLLABORATION)
"""First keys of paths to values that are not in metrics.json and exist only in sweeps."""
GROUPS = (*KEYS, *SWEEP_GROUPS)
REDUCE: dict[str, Callable[[Sequence[float]], float]] = {
    "max": max,
    "min": min,
    "mean": lambda numbers: float(np.mean(numbers)),
    "sum": math.fsum,
    "largest": lambda numbers: max(map(abs, numbers)),
    "first": lambda numbers: numbers[0],
    "last": lambda numbers: numbers[-1],
}
COUNT = "count"
UNKNOWN = float("nan")
"""Item of a path that is null in the metrics: an object of its own, unlike any other NaN."""


@dataclass(frozen=True)
class SweepOutput(FileSettings):
    """Output: definition of one number that is computed for each run."""

    path: str = text(
        empty=False, text="path of the value in the metrics of the run; `*`: all items of a list or mapping"
    )
    reduce: str = choice(
        *REDUCE,
        COUNT,
        default="max",
        text="reduction of several values to one; largest: in absolute value; count: number of values",
    )
    otherwise: float | None = number(
        None, text="number to use if a run has no value, such as a peak force without a contact; none: NaN"
    )
    unknown: float | None = number(
        None, text="number to use for a null, such as the settling time of a joint that never settles; none: NaN"
    )
    unit: str = text("", text="unit of the number")
    text: str = text("", text="description")

    def check(self, where: str) -> None:
        """Raise an error if no run has metrics under the path's first key."""
        group = self.path.split(".")[0]
        if group not in GROUPS:
            raise ParameterError(f"{where}path: {group!r} is no group of metrics of a run; valid: {', '.join(GROUPS)}")

    @property
    def group(self) -> str:
        """First key of the path."""
        return self.path.split(".")[0]

    def measured(self, values: Mapping[str, object]) -> float:
        """Return the output's value for a run; NaN: no value and no `otherwise`, or one of several is not known.

        Raises:
            HricError: an item at the path is not a number, or the path has an unknown key.
        """
        items = [item for item in walk(values, self.path.split("."), self.path) if item is not None]
        if self.reduce == COUNT:
            return float(sum(item is not UNKNOWN for item in items))
        for item in items:
            if not isinstance(item, bool | int | float):
                raise HricError(f"output {self.path} is {type(item).__name__}, not a number{_keys(item)}")
        if not items:
            return math.nan if self.otherwise is None else self.otherwise
        null = UNKNOWN if self.unknown is None else self.unknown
        numbers = [float(null if item is UNKNOWN else item) for item in items]
        return math.nan if any(map(math.isnan, numbers)) else float(REDUCE[self.reduce](numbers))


def walk(value: Any, path: Sequence[str], full_path: str, inside: bool = False) -> Iterator[Any]:
    """Yield the values at a path of nested data. Keys may contain dots.

    A null is UNKNOWN at the end of the path and inside an item of `*`; otherwise the run does not have this part: None.

    Raises:
        HricError: a key of the path is not in its mapping.
    """
    if not path or value is None:
        yield UNKNOWN if value is None and (inside or not path) else value
        return
    head, rest = path[0], path[1:]
    if head == "*" and isinstance(value, Mapping | list | tuple):
        for item in value.values() if isinstance(value, Mapping) else value:
            yield from walk(item, rest, full_path, True)
    elif isinstance(value, Mapping):
        for length in range(1, len(path) + 1):
            if (key := ".".join(path[:length])) in value:
                yield from walk(value[key], path[length:], full_path, inside)
                return
        raise HricError(f"output {full_path}: no {'.'.join(path)!r}{_keys(value)}")
    elif isinstance(value, list | tuple) and head.lstrip("-").isdigit():
        if -len(value) <= int(head) < len(value):
            yield from walk(value[int(head)], rest, full_path, inside)
    else:
        raise HricError(f"output {full_path}: {head!r} of {type(value).__name__}; valid: an index, or *")


def _keys(value: Any) -> str:
    return f"; valid: {', '.join(map(str, value))}" if isinstance(value, Mapping) else ""
