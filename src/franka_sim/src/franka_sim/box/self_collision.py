"""Self-collision check: distance between the links of the arm, modelled by capsules, computed only when necessary."""

from collections.abc import Sequence

import numpy as np

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame
from franka_sim.box.config import BoxConfig
from hric_core.geometry import FloatArray
from panda_description.parameters import config as description_file

_Rows = list[dict[str, list[float]]]
_FINGERS = {"from": [0.0, -0.0525, 0.1034], "to": [0.0, 0.0525, 0.1034], "radius": 0.0125}
"""Capsule around the fingertips in all their positions, in the hand's frame [m]; from a finger's capsule and range."""
_R_FLANGE_HAND = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 2.0**0.5]]) / 2.0**0.5
"""Rotation of the hand, mounted at -45 degrees about z on the flange (panda_description, hand.xacro)."""


def segment_distances(a: FloatArray, u: FloatArray, b: FloatArray, v: FloatArray) -> FloatArray:
    """Return the distances of n pairs of segments a + s u and b + t v, s and t in 0..1; shapes (n, 3), result (n,) [m].

    Method of Ericson, Real-Time Collision Detection, 5.1.9: the optimum of s on the infinite line, clamped to 0..1, the
    best t for it, clamped, then the best s for that t, clamped. Segments of zero length are points.
    """
    tiny = 1e-12
    r = a - b
    uu, vv, uv = ((x * y).sum(1) for x, y in ((u, u), (v, v), (u, v)))
    ur, vr = (u * r).sum(1), (v * r).sum(1)
    det = uu * vv - uv * uv
    s = np.where(det > tiny, np.clip((uv * vr - ur * vv) / np.where(det > tiny, det, 1.0), 0.0, 1.0), 0.0)
    t = np.where(vv > tiny, np.clip((uv * s + vr) / np.where(vv > tiny, vv, 1.0), 0.0, 1.0), 0.0)
    s = np.where(uu > tiny, np.clip((uv * t - ur) / np.where(uu > tiny, uu, 1.0), 0.0, 1.0), 0.0)
    distance: FloatArray = np.linalg.norm(r + s[:, None] * u - t[:, None] * v, axis=1)
    return distance


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
        self._model, self._margin, self.reach = model, config.self_collision_margin, config.reach
        self._tolerance = config.start_tolerance * max(config.reach)
        links = _shapes(bool(np.abs(model.F_T_NE - np.eye(4)).max() > 0.0))
        capsules = [(name, frame, shape) for name, (frame, shapes) in links.items() for shape in shapes]
        pairs = _pairs([name for name, _, _ in capsules])
        self._first, self._second = (np.array(row) for row in zip(*pairs, strict=True))
        self._frames = [frame for _, frame, _ in capsules]
        self._ends = np.array([[shape["from"], shape["to"]] for _, _, shape in capsules])
        radii = np.array([shape["radius"] for _, _, shape in capsules])
        self._radii = radii[self._first] + radii[self._second]
        self._names = [name for name, _, _ in capsules]
        self._min_clearance, self.free = self._margin, 0.0

    def clearance(self, q: Sequence[float]) -> float:
        """Return the minimum distance [m] of two links without a common joint, negative inside; q: 7 floats [rad]."""
        return float(self._distances(q).min())

    def nearest(self, q: Sequence[float]) -> tuple[str, str]:
        """Return the names of the two links that are nearest to each other; q: 7 floats [rad]."""
        k = int(self._distances(q).argmin())
        return self._names[self._first[k]], self._names[self._second[k]]

    def _distances(self, q: Sequence[float]) -> FloatArray:
        poses = {
            frame: np.eye(4) if frame is None else self._model.pose(frame, q) for frame in dict.fromkeys(self._frames)
        }
        T = np.array([poses[frame] for frame in self._frames])
        ends = np.einsum("nij,nkj->nki", T[:, :3, :3], self._ends) + T[:, None, :3, 3]
        start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
        i, j = self._first, self._second
        distances: FloatArray = segment_distances(start[i], along[i], start[j], along[j]) - self._radii
        return distances

    def start(self, q: Sequence[float]) -> None:
        """Start a motion: links that are too near already may separate, but not approach."""
        clearance = self.clearance(q)
        self._min_clearance = min(self._margin, clearance - self._tolerance)
        self.free = clearance - self._min_clearance

    def too_near(self, q: Sequence[float]) -> bool:
        """Return True if two links are nearer than the margin; not needed while `free` is positive."""
        self.free = self.clearance(q) - self._min_clearance
        return self.free < 0.0


def _shapes(hand: bool) -> dict[str, tuple[FrankaFrame | None, _Rows]]:
    """Return for each link the model's frame and the capsules in it; frame None: the base. hand: include the hand."""
    rows = description_file("collision")["links"]
    shapes: dict[str, tuple[FrankaFrame | None, _Rows]] = {"link0": (None, rows["link0"])}
    for i in range(1, 8):
        shapes[f"link{i}"] = FrankaFrame(f"joint{i}"), rows[f"link{i}"]
    if hand:
        in_flange = [
            {
                "from": (_R_FLANGE_HAND @ row["from"]).tolist(),
                "to": (_R_FLANGE_HAND @ row["to"]).tolist(),
                "radius": row["radius"],
            }
            for row in [*rows["hand"], _FINGERS]
        ]
        shapes["hand"] = FrankaFrame.FLANGE, in_flange
    return shapes


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
