"""Inertia that resists each joint of a description: what is decided before a model exists rests on it. The proof uses
another library."""

import math

import numpy as np

from hric_control.urdf import ONE_COORDINATE, Robot
from hric_control.urdf.mass_matrix import mass_matrix

POSES = 8
"""Number of poses that a robot is judged by: default chosen by this project, unconfirmed."""
SINGULAR = 1e-13
"""Smallest eigenvalue of a mass matrix that is scaled to a diagonal of ones, below which a pose says nothing."""


def poses(robot: Robot) -> list[dict[str, float]]:
    """The same poses for each call, within the joints' ranges and half a turn or pi metres."""
    random = np.random.default_rng(0)
    single = [joint for joint in robot.joints.values() if joint.type in ONE_COORDINATE]
    lower = np.array([min(max(joint.lower, -math.pi), joint.upper) for joint in single])
    upper = np.array([max(min(joint.upper, math.pi), joint.lower) for joint in single])
    return [
        dict(zip((joint.name for joint in single), map(float, random.uniform(lower, upper)), strict=True))
        for _ in range(POSES)
    ]


def min_inertias(robot: Robot) -> dict[str, float]:
    """What resists each joint while all others are free, 1 / (M^-1)_ii, the smallest over `poses` [kg m^2 or kg]; empty
    where all are singular."""
    smallest: dict[str, float] = {}
    for q in poses(robot):
        M, rows = mass_matrix(robot, q)
        own = np.sqrt(np.abs(np.diag(M)))
        if not own.all():
            continue
        values, vectors = np.linalg.eigh(M / np.outer(own, own))
        if values[0] > SINGULAR:
            found = own**2 / np.sum(vectors**2 / values, axis=1)
            smallest |= {
                name: min(float(inertia), smallest.get(name, math.inf))
                for name, inertia in zip(rows, found, strict=True)
            }
    return smallest
