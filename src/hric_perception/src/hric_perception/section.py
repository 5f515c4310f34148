"""Values read from a mapping, each checked; errors give the full key, what stood there and what would be valid. No ROS."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from hric_control.errors import ParameterError, UnknownNameError

Vector = tuple[float, float, float]
_EXPONENT = re.compile(r"[-+]?\d+\.?\d*[eE][-+]?\d+")
"""A number with an exponent that YAML 1.1 reads as text."""


class Section:
    """A mapping of a file or of the parameter server.

    Args:
        where: its full name, for messages.
        content: what stands there; None counts as empty.

    Raises:
        ParameterError: it is no mapping.
    """

    def __init__(self, where: str, content: Any) -> None:
        if content is not None and (not isinstance(content, Mapping) or any(not isinstance(key, str) for key in content)):
            raise ParameterError(f"{where} is {content!r}; valid: a mapping of names to values")
        self.where, self.content = where, dict(content or {})

    def only(self, *names: str) -> None:
        """Refuse other keys. Raises UnknownNameError."""
        for name in self.content:
            if name not in names:
                raise UnknownNameError("key", name, names, self.where)

    def section(self, name: str) -> Section:
        """The mapping below a key; empty where there is none."""
        return Section(f"{self.where}.{name}", self.content.get(name))

    def number(self, name: str, default: float, low: float = -math.inf, high: float = math.inf, *, above: bool = False) -> float:
        """A finite number from low (above it with `above`) to high."""
        value = _number(self.content.get(name, default))
        if value is None or not low <= value <= high or (above and value == low):
            bounds = " above" if above else " from"
            limits = f"{bounds} {low:g}" * math.isfinite(low) + f" to {high:g}" * math.isfinite(high)
            raise ParameterError(f"{self.where}.{name} is {self.content.get(name, default)!r}; valid: a finite number{limits}")
        return value

    def whole(self, name: str, default: int, low: int, high: int) -> int:
        """A whole number from low to high."""
        value = self.content.get(name, default)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise ParameterError(f"{self.where}.{name} is {value!r}; valid: a whole number from {low} to {high}")
        return value

    def vector(self, name: str, default: Vector) -> Vector:
        """Three finite numbers."""
        x, y, z = self.numbers(f"{self.where}.{name}", self.content.get(name, list(default)), (3,))
        return x, y, z

    def rows(self, name: str, *lengths: int) -> list[list[float]]:
        """Rows of finite numbers, each of one of the lengths; empty where the key is not given."""
        value = self.content.get(name, [])
        if not isinstance(value, list | tuple):
            raise ParameterError(f"{self.where}.{name} is {value!r}; valid: a list of lists of {' or '.join(map(str, lengths))} numbers")
        return [self.numbers(f"{self.where}.{name}[{index}]", row, lengths) for index, row in enumerate(value)]

    def text(self, name: str, default: str = "", valid: Sequence[str] = ()) -> str:
        """A text, one of `valid` if there are any; a number such as 4.1 counts as text."""
        value = self.content.get(name, default)
        if isinstance(value, int | float) and not isinstance(value, bool):
            value = str(value)
        if not isinstance(value, str) or (valid and value not in valid):
            raise ParameterError(f"{self.where}.{name} is {value!r}; valid: {', '.join(valid) or 'a text'}")
        return value

    def texts(self, name: str) -> list[str]:
        """A list of different texts, one at least."""
        value = self.content.get(name)
        if not isinstance(value, list | tuple) or not value or any(not isinstance(part, str) for part in value) or len(set(value)) != len(value):
            raise ParameterError(f"{self.where}.{name} is {value!r}; valid: a list of different texts")
        return list(value)

    @staticmethod
    def numbers(where: str, value: Any, lengths: Sequence[int]) -> list[float]:
        """A list of finite numbers, of one of the lengths; where: its full name."""
        row = [_number(part) for part in value] if isinstance(value, list | tuple) and len(value) in lengths else [None]
        numbers = [part for part in row if part is not None]
        if len(numbers) != len(row):
            raise ParameterError(f"{where} is {value!r}; valid: {' or '.join(map(str, lengths))} finite numbers")
        return numbers


def _number(value: Any) -> float | None:
    if isinstance(value, str) and _EXPONENT.fullmatch(value):
        value = float(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
