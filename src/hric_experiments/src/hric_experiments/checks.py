"""Checks of values read from YAML; each raises ValueError with the key, what stood there and what would be valid."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

_PI = re.compile(r"^\s*(?P<sign>[-+]?)\s*(?:(?P<factor>\d+(?:\.\d*)?)\s*\*\s*)?pi\s*(?:/\s*(?P<divisor>\d+(?:\.\d*)?))?\s*$")


def fields(raw: Mapping[str, Any], valid: Sequence[str], required: Sequence[str], where: str) -> None:
    """Refuse unknown and missing keys."""
    prefix = f"{where}." if where else ""
    unknown = sorted(str(key) for key in raw if key not in valid)
    if unknown:
        raise ValueError(f"unknown key {', '.join(prefix + key for key in unknown)}; valid: {', '.join(valid)}")
    missing = [key for key in required if key not in raw]
    if missing:
        raise ValueError(f"{', '.join(prefix + key for key in missing)} is missing")


def mapping(raw: Any, where: str) -> dict[str, Any]:
    """A mapping with string keys; None counts as empty."""
    if raw is None:
        return {}
    if not isinstance(raw, Mapping) or any(not isinstance(key, str) for key in raw):
        raise ValueError(f"{where} must be a mapping of names to values; got {raw!r}")
    return dict(raw)


def number(raw: Any, where: str, *, minimum: float = -math.inf, exclusive: bool = False) -> float:
    """A finite number not below `minimum` (above it when exclusive)."""
    bound = f" {'above' if exclusive else 'at least'} {minimum:g}" if minimum > -math.inf else ""
    if isinstance(raw, str) and re.fullmatch(r"[-+]?\d+\.?\d*[eE][-+]?\d+", raw):
        raw = float(raw)  # YAML 1.1 reads 1e-3 as text
    if isinstance(raw, bool) or not isinstance(raw, int | float) or not math.isfinite(raw):
        raise ValueError(f"{where} must be a finite number{bound}; got {raw!r}")
    if raw < minimum or (exclusive and raw == minimum):
        raise ValueError(f"{where} must be{bound}; got {raw!r}")
    return float(raw)


def angle(raw: Any, where: str) -> float:
    """An angle: a finite number or text such as "pi/4" or "-3*pi/4" [rad]."""
    if isinstance(raw, str):
        match = _PI.match(raw)
        if match is None or float(match["divisor"] or 1) == 0.0:
            raise ValueError(f"{where} must be a number or a multiple of pi such as -3*pi/4 [rad]; got {raw!r}")
        value = float(match["factor"] or 1) * math.pi / float(match["divisor"] or 1)
        return -value if match["sign"] == "-" else value
    return number(raw, where)


def names_list(raw: Any, where: str) -> tuple[str, ...]:
    """A non-empty list of different names."""
    if not isinstance(raw, Sequence) or isinstance(raw, str) or not raw or any(not isinstance(name, str) or not name for name in raw):
        raise ValueError(f"{where} must be a list of names; got {raw!r}")
    if len(set(raw)) != len(raw):
        raise ValueError(f"{where} names something twice: {', '.join(raw)}")
    return tuple(raw)


def strings_of(raw: Mapping[str, Any], defaults: Mapping[str, str], where: str) -> dict[str, str]:
    """The text values of the keys of `defaults`."""
    result = {}
    for key, default in defaults.items():
        value = raw.get(key, default)
        if not isinstance(value, str):
            raise ValueError(f"{where}.{key} must be text; got {value!r}")
        result[key] = value
    return result
