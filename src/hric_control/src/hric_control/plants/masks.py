"""Pairs of links that are not checked for collision, read from a YAML file that gives a reason for each."""

from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase

from hric_core.parameters import Settings, listing, read_yaml, section, text
from hric_core.resources import resolve

DEFAULT = "package://hric_control/config/collision_masks.yaml"


@dataclass(frozen=True)
class _Pair(Settings):
    links: tuple[str, str] = listing(text(empty=False), 2)
    reason: str = text(empty=False)


@dataclass(frozen=True)
class _Masks(Settings):
    pairs: tuple[_Pair, ...] = listing(section(_Pair), default=())


def load_masks(address: str) -> list[tuple[str, str]]:
    """Read the pairs of link name patterns that are not checked for collision.

    Args:
        address: path or package://...; empty for the file of this package.

    Raises:
        HricError: an entry is not {links: [pattern, pattern], reason: text}.
    """
    path = resolve(address or DEFAULT)
    return [pair.links for pair in _Masks.of(read_yaml(path), f"{path}:").pairs]


def masked(a: str, b: str, masks: Iterable[tuple[str, str]]) -> bool:
    """Return True if a pair of links matches one of the pairs of patterns, in either order."""
    return any((fnmatchcase(a, x) and fnmatchcase(b, y)) or (fnmatchcase(a, y) and fnmatchcase(b, x)) for x, y in masks)
