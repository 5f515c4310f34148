"""Pairs of links whose collision is not tested, by a YAML table with reasons."""

from __future__ import annotations

from fnmatch import fnmatchcase
from pathlib import Path

import pybullet
import yaml

from hric_control.errors import HricError
from pybullet_ros_control.engine import Body, Engine


def load_masks(path: Path) -> list[tuple[str, str]]:
    """Patterns of link pairs.

    Raises:
        HricError: an entry is not {links: [pattern, pattern], reason: text}.
    """
    table = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    pairs = []
    for entry in table.get("pairs", []):
        links, reason = entry.get("links", []), entry.get("reason", "")
        if len(links) != 2 or not reason:
            raise HricError(f"{path}: each pair needs links: [pattern, pattern] and a reason; got {entry}")
        pairs.append((str(links[0]), str(links[1])))
    return pairs


def apply_masks(engine: Engine, body: Body, masks: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Switch self-collision off for links that are fixed to each other, and for the pairs that match; returns them.

    Links joined by one joint are left out by the engine itself.
    """
    group = {} if body.model is None else body.model.group
    off = []
    names = sorted(body.links, key=body.links.__getitem__)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            listed = any((fnmatchcase(a, x) and fnmatchcase(b, y)) or (fnmatchcase(a, y) and fnmatchcase(b, x)) for x, y in masks)
            if listed or group.get(a, a) == group.get(b, b):
                pybullet.setCollisionFilterPair(body.id, body.id, body.links[a], body.links[b], 0, physicsClientId=engine.client)
                off.append((a, b))
    return off
