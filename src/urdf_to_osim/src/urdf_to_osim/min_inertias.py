"""Inertia of each joint of a description, for decisions before a model exists; the proof uses another library."""

import math

import numpy as np

from hric_core.urdf import ONE_COORDINATE, Robot
from hric_dynamics.tree import Tree

POSES = 8
"""Number of poses at which a robot is evaluated (project default, unconfirmed)."""
SINGULAR = 1e-13
"""Smallest eigenvalue of a mass matrix scaled to a unit diagonal, below which a pose is ignored as singular."""


def poses(robot: Robot) -> list[dict[str, float]]:
    """Return poses within the joints' ranges and half a turn or pi metres; the same for each call."""
    random = np.random.default_rng(0)
    single = [joint for joint in robot.joints.values() if joint.type in ONE_COORDINATE]
    lower = np.array([min(max(joint.lower, -math.pi), joint.upper) for joint in single])
    upper = np.array([max(min(joint.upper, math.pi), joint.lower) for joint in single])
    return [
        dict(zip((joint.name for joint in single), map(float, random.uniform(lower, upper)), strict=True))
        for _ in range(POSES)
    ]


def min_inertias(robot: Robot) -> dict[str, float]:
    """Return 1 / (M^-1)_ii of each joint, the smallest over `poses` [kg m^2 or kg]; empty if all are singular."""
    smallest: dict[str, float] = {}
    tree = Tree(robot)
    for q in poses(robot):
        M = tree.mass_matrix(tree.positions(q))
        scale = np.sqrt(np.abs(np.diag(M)))
        if not scale.all():
            continue
        values, vectors = np.linalg.eigh(M / np.outer(scale, scale))
        if values[0] > SINGULAR:
            inertias = scale**2 / np.sum(vectors**2 / values, axis=1)
            smallest |= {
                name: min(float(inertia), smallest.get(name, math.inf))
                for name, inertia in zip(tree.joints, inertias, strict=True)
            }
    return smallest
