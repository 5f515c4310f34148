"""Pairs of links whose collision is not tested, told to the engine."""

from __future__ import annotations

import pybullet

from hric_control.plants.masks import masked
from pybullet_ros_control.engine import Body, Engine


def apply_masks(engine: Engine, body: Body, masks: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Switch self-collision off for links that are fixed to each other, and for the pairs that match; returns them.

    Links joined by one joint are left out by the engine itself.
    """
    group = {} if body.model is None else body.model.group
    off = []
    names = sorted(body.links, key=body.links.__getitem__)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            if masked(a, b, masks) or group.get(a, a) == group.get(b, b):
                pybullet.setCollisionFilterPair(body.id, body.id, body.links[a], body.links[b], 0, physicsClientId=engine.client)
                off.append((a, b))
    return off
