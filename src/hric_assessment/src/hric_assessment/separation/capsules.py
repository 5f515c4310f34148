"""Distances between capsules in closed form, vectorised."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_core.geometry import FloatArray
from hric_human.body import Body

IntArray = np.ndarray[Any, np.dtype[np.int64]]
_TINY = 1e-300
"""Replacement for a squared length of zero: a capsule may be a sphere."""


@dataclass(frozen=True)
class Capsules:
    """Capsules of the links of a model.

    Attributes:
        links: link of each capsule, k names; a link may have several.
        ends: ends of the axes, in the frames of the links, shape (k, 2, 3) [m].
        radii: shape (k,) [m].
    """

    links: tuple[str, ...]
    ends: FloatArray
    radii: FloatArray

    def placed(self, T_world_link: FloatArray) -> FloatArray:
        """Return the ends in the world, shape (n, k, 2, 3) [m]; T_world_link: pose of each link, shape (n, k, 4, 4)."""
        R, p = T_world_link[..., :3, :3], T_world_link[..., None, :3, 3]
        return np.asarray(np.einsum("nkij,kej->nkei", R, self.ends) + p)


def of_body(body: Body) -> Capsules:
    """Return the capsules of a simulated person, one for each segment."""
    segments = list(body.segments.values())
    return Capsules(
        tuple(segment.link for segment in segments),
        np.array([segment.straight for segment in segments]),
        np.array([segment.radius for segment in segments]),
    )


def segment_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distance of line segments, shape (...,) [m]; shapes broadcast.

    Args:
        a: both ends of each first segment, shape (..., 2, 3) [m].
        b: both ends of each second segment, likewise.
    """
    square, _, _ = _nearest(a, b)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def nearest_points(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the point of each segment that is nearest to the other, shape (..., 3) each [m].

    If there are several nearest points, any one of them. Arguments: see `segment_distance`.
    """
    _, s, t = _nearest(a, b)
    return a[..., 0, :] + s[..., None] * (a[..., 1, :] - a[..., 0, :]), b[..., 0, :] + t[..., None] * (
        b[..., 1, :] - b[..., 0, :]
    )


def _nearest(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the squared distance [m^2], and the positions along both segments from 0 to 1, shape (...,) each.

    The squared distance is a convex quadratic of the positions s and t on the unit square. Its minimum in the plane,
    clamped to the square one coordinate after the other, is the minimum in the square (Ericson, Real-Time Collision
    Detection, 5.1.9). Parallel segments have no unique minimum; starting at an end of the first segment finds one.
    """
    u, v, w = a[..., 1, :] - a[..., 0, :], b[..., 1, :] - b[..., 0, :], a[..., 0, :] - b[..., 0, :]
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw, ww = _dot(u, w), _dot(v, w), _dot(w, w)
    safe_u, safe_v = np.maximum(uu, _TINY), np.maximum(vv, _TINY)
    determinant = uu * vv - uv * uv
    s = np.clip((uv * vw - vv * uw) / np.maximum(determinant, _TINY), 0.0, 1.0)
    best, best_s, best_t = np.full(np.shape(ww), np.inf), np.zeros(np.shape(ww)), np.zeros(np.shape(ww))
    for start in (s, np.zeros_like(s), np.ones_like(s)):
        t = np.clip((uv * start + vw) / safe_v, 0.0, 1.0)
        near = np.clip((uv * t - uw) / safe_u, 0.0, 1.0)
        square = ww + near * (near * uu + 2.0 * uw) + t * (t * vv - 2.0 * vw) - 2.0 * near * t * uv
        better = square < best
        best, best_s, best_t = (np.where(better, *pair) for pair in ((square, best), (near, best_s), (t, best_t)))
    return best, best_s, best_t


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def distances(a: FloatArray, radii_a: FloatArray, b: FloatArray, radii_b: FloatArray) -> FloatArray:
    """Return the distance of each capsule of one model from each of another, shape (n, k, m) [m]; negative: overlap.

    Args:
        a: ends of the first model, shape (n, k, 2, 3) [m].
        radii_a: shape (k,) [m].
        b: ends of the second model, shape (n, m, 2, 3) [m].
        radii_b: shape (m,) [m].
    """
    return segment_distance(a[:, :, None], b[:, None]) - radii_a[:, None] - radii_b
