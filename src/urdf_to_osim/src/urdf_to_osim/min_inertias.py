"""Minimum effective inertia of each joint of a robot description, for decisions before the OpenSim model exists."""

import math

import numpy as np

from hric_core.urdf import ONE_COORDINATE, Robot
from hric_dynamics.tree import Tree

POSES = 8
"""Number of poses at which a robot is evaluated (project default, unconfirmed)."""
SINGULAR = 1e-13
"""Minimum eigenvalue of a mass matrix that is scaled to a unit diagonal; poses below it are ignored as singular."""


def poses(robot: Robot) -> list[dict[str, float]]:
    """Return random poses, as joint positions by name [rad or m], within the joints' ranges and within +-pi.

    All calls return the same poses.
    """
    random = np.random.default_rng(0)
    single = [joint for joint in robot.joints.values() if joint.type in ONE_COORDINATE]
    lower = np.array([min(max(joint.lower, -math.pi), joint.upper) for joint in single])
    upper = np.array([max(min(joint.upper, math.pi), joint.lower) for joint in single])
    return [
        dict(zip((joint.name for joint in single), map(float, random.uniform(lower, upper)), strict=True))
        for _ in range(POSES)
    ]


def min_inertias(robot: Robot) -> dict[str, float]:
    """Return the minimum over random poses of each joint's inertia with all others free [kg m^2 or kg], by joint.

    This inertia is 1 / (M^-1)_ii of the mass matrix M. Empty if M is singular in all poses.
    """
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
