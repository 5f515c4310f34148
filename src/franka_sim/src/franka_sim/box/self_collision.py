"""Self-collision check: distance between the links of the arm, modelled by capsules, computed only when necessary."""

from collections.abc import Sequence

import numpy as np

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.config import BoxConfig
from hric_core.geometry import FloatArray, MassProperties
from hric_core.geometry.transforms import homogeneous
from hric_dynamics.tree import Bodies, link_row
from panda_description.parameters import config as description_file

_FINGERS = {"from": [0.0, -0.0525, 0.1034], "to": [0.0, 0.0525, 0.1034], "radius": 0.0125}
"""Capsule around the fingertips in all their positions, in the hand's frame [m]; from a finger's capsule and range."""
_T_FLANGE_HAND = homogeneous(np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 2.0**0.5]]) / 2.0**0.5)
"""Pose of the hand, mounted at -45 degrees about z on the flange (panda_description, hand.xacro)."""


class SelfCollision:
    """Clearance between the links, computed only when it could have fallen below the margin.

    No point of the arm moves faster than sum |dq_i| reach_i. After the clearance d was computed, it cannot fall below
    the margin before the integral of this speed has reached d - margin. (Only the joints between two links change
    their distance, so the bound holds for their relative motion.)

    Args:
        model: model of the arm; the shape of the hand is included if the model has one.
        config: margin [m] and reach [m].

    Attributes:
        free: distance that any point can move until two links may be too near [m]; the user takes the way of each cycle
            from it.
    """

    def __init__(self, model: KdlFrankaModel, config: BoxConfig) -> None:
        self._margin, self.reach = config.self_collision_margin, config.reach
        self._tolerance = config.start_tolerance * max(config.reach)
        chain = model.chain.description
        joints = enumerate(chain.segments)
        rows = [[i, *link_row(i - 1, False, joint.T_parent_joint, joint.axis, MassProperties())] for i, joint in joints]
        self._bodies = Bodies(len(rows), rows)
        capsules = _capsules(chain.T_last_tip, bool(np.abs(model.F_T_NE - np.eye(4)).max() > 0.0))
        self._names = [name for name, _ in capsules]
        self._capsules = np.array([row for _, row in capsules])
        self._pairs = np.array(_pairs(self._names), float)
        self._min_clearance, self.free = self._margin, 0.0

    def clearance(self, q: Sequence[float]) -> float:
        """Return the minimum distance [m] of two links without a common joint, negative inside; q: 7 floats [rad]."""
        return float(self._distances(q).min())

    def nearest(self, q: Sequence[float]) -> tuple[str, str]:
        """Return the names of the two links that are nearest to each other; q: 7 floats [rad]."""
        first, second = self._pairs[self._distances(q).argmin()]
        return self._names[int(first)], self._names[int(second)]

    def _distances(self, q: Sequence[float]) -> FloatArray:
        distances = np.empty(len(self._pairs))
        self._bodies.capsule_distances(q, self._capsules, self._pairs, distances)
        return distances

    def start(self, q: Sequence[float]) -> None:
        """Start a motion: links that are too near already may separate, but not approach."""
        clearance = self.clearance(q)
        self._min_clearance = min(self._margin, clearance - self._tolerance)
        self.free = clearance - self._min_clearance

    def too_near(self, q: Sequence[float]) -> bool:
        """Return True if two links are nearer than the margin; not needed while `free` is positive."""
        self.free = self.clearance(q) - self._min_clearance
        return not self.free >= 0.0  # also where the distance is not known


def _capsules(T_link7_flange: FloatArray, hand: bool) -> list[tuple[str, list[float]]]:
    """Return the name of the link, and the row for `Bodies.capsule_distances`, of each capsule; hand: include it."""
    rows = description_file("collision")["links"]
    links = [(f"link{i}", i - 1, np.eye(4), rows[f"link{i}"]) for i in range(8)]
    if hand:
        T = T_link7_flange @ _T_FLANGE_HAND
        links.append(("hand", 6, T, [*rows["hand"], _FINGERS]))
    return [
        (name, [link, *(T[:3, :3] @ row["from"] + T[:3, 3]), *(T[:3, :3] @ row["to"] + T[:3, 3]), row["radius"]])
        for name, link, T, shapes in links
        for row in shapes
    ]


def _pairs(owners: Sequence[str]) -> list[tuple[int, int]]:
    """Return the index pairs of capsules to compare; links with a common joint and ignored pairs are left out.

    Link 6 and the hand are 5 cm apart at any position of joint 7 and are left out.
    """
    order = ["link0", *(f"link{i}" for i in range(1, 8)), "hand"]
    masked = {frozenset(("link6", "hand"))} | {
        frozenset(name.removeprefix("panda_") for name in pair) for pair in panda_description.ignored_pairs("panda")
    }
    pairs = []
    for i, first in enumerate(owners):
        for j in range(i + 1, len(owners)):
            second = owners[j]
            if abs(order.index(first) - order.index(second)) > 1 and frozenset((first, second)) not in masked:
                pairs.append((i, j))
    return pairs
