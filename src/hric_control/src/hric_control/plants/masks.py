"""Pairs of links whose collision is not tested, by a YAML table with reasons."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase

import yaml

from hric_control.errors import HricError
from hric_control.plants.resources import resolve

DEFAULT = "package://hric_control/config/collision_masks.yaml"


def load_masks(address: str) -> list[tuple[str, str]]:
    """Patterns of link pairs.

    Args:
        address: path or package://..., "" for the table of this package.

    Raises:
        HricError: an entry is not {links: [pattern, pattern], reason: text}.
    """
    path = resolve(address or DEFAULT)
    table = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    pairs = []
    for entry in table.get("pairs", []):
        links, reason = entry.get("links", []), entry.get("reason", "")
        if len(links) != 2 or not reason:
            raise HricError(f"{path}: each pair needs links: [pattern, pattern] and a reason; got {entry}")
        pairs.append((str(links[0]), str(links[1])))
    return pairs


def masked(a: str, b: str, masks: Iterable[tuple[str, str]]) -> bool:
    """Whether a pair of links matches one of the pairs of patterns, in either order."""
    return any((fnmatchcase(a, x) and fnmatchcase(b, y)) or (fnmatchcase(a, y) and fnmatchcase(b, x)) for x, y in masks)
