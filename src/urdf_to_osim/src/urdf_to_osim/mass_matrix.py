"""The mass matrix of a description, by itself: what is decided before a model exists rests on it. The proof asks another library."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hric_control.plants.spatial import FloatArray, MassProperties
from urdf_to_osim.joints import joint_turn
from urdf_to_osim.urdf import ONE_COORDINATE, Joint, Robot

POSES = 8
"""Number of poses that a robot is judged by: default chosen by this project, unconfirmed."""
SINGULAR = 1e-13
"""Smallest eigenvalue of a mass matrix that is scaled to a diagonal of ones, below which a pose tells nothing."""


def mass_matrix(robot: Robot, q: Mapping[str, float]) -> tuple[FloatArray, list[str]]:
    """Mass matrix by the composite rigid body algorithm, in axes of the root link; mimic joints move freely.

    Args:
        robot: the description.
        q: coordinates of joints with one coordinate [rad or m]; all others are at zero.

    Returns:
        Matrix, shape (n, n) [kg m^2, kg m, kg], and the joint of each row: joints in order, planar ones with three rows (angle, x, y), floating
        ones with six (rotations, translations).
    """
    T = {robot.root: np.eye(4)}
    rows: list[str] = []
    moving: dict[str, list[int]] = {robot.root: []}  # link -> rows of the joints that move it
    twists: list[FloatArray] = []
    for joint in robot.joints.values():
        T_root_joint = T[joint.parent] @ joint.T_parent_joint
        own = _twists(joint, T_root_joint)
        moving[joint.child] = moving[joint.parent] + list(range(len(rows), len(rows) + own.shape[1]))
        rows += [joint.name] * own.shape[1]
        twists.append(own)
        T[joint.child] = T_root_joint @ _motion(joint, q.get(joint.name, 0.0))
    S = np.hstack([np.zeros((6, 0)), *twists])
    M, composite = np.zeros((len(rows), len(rows))), {name: _inertia(link.mass, T[name]) for name, link in robot.links.items()}
    for joint in reversed(robot.joints.values()):
        columns = moving[joint.child]
        if own_columns := columns[len(moving[joint.parent]) :]:
            block = S[:, columns].T @ composite[joint.child] @ S[:, own_columns]
            M[np.ix_(columns, own_columns)] = block
            M[np.ix_(own_columns, columns)] = block.T
        composite[joint.parent] = composite[joint.parent] + composite[joint.child]
    return M, rows


def _twists(joint: Joint, T_root_joint: FloatArray) -> FloatArray:
    """Angular velocity and velocity of the root's origin for each speed, shape (6, n)."""
    if joint.type == "fixed":
        return np.zeros((6, 0))
    turning = sliding = np.zeros((3, 0))
    if joint.type in ("revolute", "continuous"):
        turning = joint.axis[:, None]
    elif joint.type == "prismatic":
        sliding = joint.axis[:, None]
    elif joint.type == "planar":
        sliding, turning = np.hsplit(joint_turn(joint), [2])
    elif joint.type == "floating":
        turning = sliding = np.eye(3)
    R, p = T_root_joint[:3, :3], T_root_joint[:3, 3]
    turning, sliding = R @ turning, R @ sliding
    return np.hstack([np.vstack([turning, _skew(p) @ turning]), np.vstack([np.zeros_like(sliding), sliding])])


def _motion(joint: Joint, q: float) -> FloatArray:
    """Pose of the child in the joint frame, shape (4, 4) [m]."""
    T = np.eye(4)
    if joint.type == "prismatic":
        T[:3, 3] = q * joint.axis
    elif joint.type in ONE_COORDINATE:
        K = _skew(joint.axis)
        T[:3, :3] += math.sin(q) * K + (1.0 - math.cos(q)) * K @ K
    return T


def _inertia(body: MassProperties | None, T_root_link: FloatArray) -> FloatArray:
    """Spatial inertia about the root's origin, shape (6, 6)."""
    if body is None:
        return np.zeros((6, 6))
    R = T_root_link[:3, :3]
    C = _skew(R @ body.com + T_root_link[:3, 3])
    G = np.diag([0.0, 0.0, 0.0, *[body.mass] * 3])
    G[:3, :3] = R @ body.inertia @ R.T + body.mass * C @ C.T
    G[:3, 3:], G[3:, :3] = body.mass * C, body.mass * C.T
    return G


def _skew(v: FloatArray) -> FloatArray:
    """Matrix of the product v x ., shape (3, 3)."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def poses(robot: Robot) -> list[dict[str, float]]:
    """The same poses for each call, within the joints' ranges and half a turn or pi metres."""
    random = np.random.default_rng(0)
    single = [joint for joint in robot.joints.values() if joint.type in ONE_COORDINATE]
    lower = np.array([min(max(joint.lower, -math.pi), joint.upper) for joint in single])
    upper = np.array([max(min(joint.upper, math.pi), joint.lower) for joint in single])
    return [dict(zip((joint.name for joint in single), map(float, random.uniform(lower, upper)), strict=True)) for _ in range(POSES)]


def least_inertias(robot: Robot) -> dict[str, float]:
    """What resists each joint while all others are free, 1 / (M^-1)_ii, the least over `poses` [kg m^2 or kg]; empty where all are singular."""
    least: dict[str, float] = {}
    for q in poses(robot):
        M, rows = mass_matrix(robot, q)
        own = np.sqrt(np.abs(np.diag(M)))
        if not own.all():
            continue
        values, vectors = np.linalg.eigh(M / np.outer(own, own))
        if values[0] > SINGULAR:
            found = own**2 / np.sum(vectors**2 / values, axis=1)
            least |= {name: min(float(inertia), least.get(name, math.inf)) for name, inertia in zip(rows, found, strict=True)}
    return least
