"""Contact area of two convex shapes: the corners of the intersection of the sides that face each other.

A collision library returns only the deepest point. If a flat side lies on another, this point jumps from corner to
corner, and the force of a contact spring in it would rotate a body that should only be pushed. So the side of each
shape that faces the other is described as a polygon (of a box, the end of a cylinder, a hull), a line (of a capsule,
the side of a cylinder) or nothing (of a sphere). Both are projected along the contact normal and intersected, and the
overlap along the normal is computed at each corner of the intersection. All computations use plain floats, as sides
have few corners.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hric_core.geometry.transforms import FloatArray, cross
from hric_core.summation import total

KINDS = ("sphere", "capsule", "cylinder", "box", "plane", "hull")
_ROUND = 12
"""Number of corners of the polygon that approximates the round end of a cylinder (project default, unconfirmed)."""
_LYING = 0.7
"""Smallest cosine of the angle between axis and contact normal at which a cylinder touches with an end (45 deg)."""
_PARALLEL = 0.05
"""Largest sine of the angle between two lines that count as parallel (project default, unconfirmed)."""
_FLAT = 1e-3
"""Largest distance of a hull's point from its outermost point on the same side, relative to the hull's size [1]."""
_AGREES = 1e-4
"""Largest difference in depth of the deepest corner and the collision library's deepest point [m].

A twentieth of the depth is added. Beyond it, the contact is not between two sides, and only the point is used."""
_TINY = 1e-9
SOFTNESS = 5e-4
"""Difference in depth of two corners over which the contact force moves to the deeper one [m].

Project default, unconfirmed."""

Point = tuple[float, float]


class Corner(NamedTuple):
    """Corner of a contact area.

    Attributes:
        position: position in the world frame, shape (3,) [m].
        depth: overlap of the shapes along the normal, negative for a gap [m].
        share: weight of the corner: the part of the area's outline that is nearest to it; all shares add up to 1.
    """

    position: FloatArray
    depth: float
    share: float


@dataclass(frozen=True, eq=False)
class Solid:
    """Convex collision shape of a link.

    Attributes:
        kind: one of KINDS; the axis of capsules and cylinders is z, a plane is the half-space below z = 0.
        size: sphere: radius; capsule, cylinder: radius, length between the ends; box: three edges; else empty [m].
        T_link_solid: pose of the shape in the link, shape (4, 4).
        points: points of a hull, shape (n, 3) [m].
    """

    kind: str
    size: tuple[float, ...]
    T_link_solid: FloatArray
    points: FloatArray | None = None


def _box_side(size: Sequence[float], d: FloatArray) -> FloatArray:
    k = int(np.argmax(np.abs(d)))
    half = [0.5 * s for s in size]
    corners = np.empty((4, 3))
    corners[:, k] = math.copysign(half[k], d[k])
    i, j = (k + 1) % 3, (k + 2) % 3
    corners[:, i] = [half[i], -half[i], -half[i], half[i]]
    corners[:, j] = [half[j], half[j], -half[j], -half[j]]
    return corners


@lru_cache(maxsize=64)
def _circle(radius: float) -> FloatArray:
    angles = np.arange(_ROUND) * (2.0 * math.pi / _ROUND)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(_ROUND)])


def _cylinder_side(radius: float, length: float, d: FloatArray) -> FloatArray:
    half = 0.5 * length
    if abs(d[2]) > _LYING:
        side: FloatArray = _circle(radius) + np.array([0.0, 0.0, math.copysign(half, d[2])])
        return side
    out = radius / math.hypot(d[0], d[1])
    return np.array([[out * d[0], out * d[1], half], [out * d[0], out * d[1], -half]])


def _hull_side(points: FloatArray, d: FloatArray) -> FloatArray:
    """Return the points of a hull that are outermost in direction d, within a tolerance, in any order.

    Their convex hull is computed later, in the plane of the contact."""
    heights = points @ d
    size = float(np.ptp(points, axis=0).max())
    side: FloatArray = points[heights > heights.max() - _FLAT * size]
    return side


def _side(solid: Solid, T_world_link: FloatArray, direction: FloatArray) -> FloatArray | None:
    """Return the corners of a shape's side that faces a direction, in the world frame, shape (n, 3) [m].

    A line has two corners. The result is None or a single point for a shape without a side."""
    if solid.kind in ("sphere", "plane"):
        return None
    T = T_world_link @ solid.T_link_solid
    R = T[:3, :3]
    d = R.T @ direction
    if solid.kind == "capsule":
        radius, length = solid.size
        ends = np.array([[0.0, 0.0, 0.5 * length], [0.0, 0.0, -0.5 * length]])
        side: FloatArray = ends @ R.T + T[:3, 3] + radius * direction
        return side
    if solid.kind == "box":
        local = _box_side(solid.size, d)
    elif solid.kind == "cylinder":
        local = _cylinder_side(solid.size[0], solid.size[1], d)
    else:
        assert solid.points is not None
        local = _hull_side(solid.points, d)
    return np.asarray(local @ R.T + T[:3, 3])


def _across(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that are perpendicular to a normal and to each other."""
    e = np.zeros(3)
    e[int(np.argmin(np.abs(normal)))] = 1.0
    s = cross(normal, e)
    s /= math.sqrt(float(s @ s))
    return s, cross(normal, s)


def _convex(points: Sequence[Point]) -> list[Point]:
    """Return the corners of the convex hull, counter-clockwise (Andrew's monotone chain).

    One or two points are returned unchanged."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    halves = []
    for run in (ordered, ordered[::-1]):
        half: list[Point] = []
        for p in run:
            while len(half) > 1 and _area(half[-2], half[-1], p) <= _TINY * _TINY:
                half.pop()
            half.append(p)
        halves.append(half[:-1])
    return halves[0] + halves[1]


def _area(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _cut(shape: list[Point], window: list[Point]) -> list[Point]:
    """Return the part of a convex polygon or line within the convex polygon `window` (Sutherland and Hodgman)."""
    for i, a in enumerate(window):
        b, corners = window[(i + 1) % len(window)], []
        sides = [_area(a, b, p) for p in shape]
        pairs = range(len(shape)) if len(shape) > 2 else range(len(shape) - 1)
        for k, p in enumerate(shape):
            if sides[k] >= -_TINY * _TINY:
                corners.append(p)
            j = (k + 1) % len(shape)
            if k in pairs and sides[k] * sides[j] < 0.0:
                f = sides[k] / (sides[k] - sides[j])
                corners.append((p[0] + f * (shape[j][0] - p[0]), p[1] + f * (shape[j][1] - p[1])))
        shape = corners
        if not shape:
            break
    return shape


def _common(a: list[Point], b: list[Point]) -> list[Point]:
    """Return the corners of the intersection of two sides, each a polygon or line; none for lines that cross."""
    if len(b) > 2:
        return _cut(a, b)
    if len(a) > 2:
        return _cut(b, a)
    if len(a) < 2 or len(b) < 2:
        return []
    (ux, uy), (vx, vy) = (a[1][0] - a[0][0], a[1][1] - a[0][1]), (b[1][0] - b[0][0], b[1][1] - b[0][1])
    length, other = math.hypot(ux, uy), math.hypot(vx, vy)
    if length < _TINY or other < _TINY or abs(ux * vy - uy * vx) > _PARALLEL * length * other:
        return []
    along = sorted(((p[0] - a[0][0]) * ux + (p[1] - a[0][1]) * uy) / (length * length) for p in b)
    low, high = max(along[0], 0.0), min(along[1], 1.0)
    return [(a[0][0] + f * ux, a[0][1] + f * uy) for f in (low, high)] if low < high else []


class _Heights:
    """Plane fitted through the corners of a side, as height along the normal over points of the contact plane.

    For a line, the plane has no slope across the line.

    Args:
        points: positions of the corners in the contact plane [m].
        heights: heights of the corners along the normal [m].
    """

    def __init__(self, points: Sequence[Point], heights: Sequence[float]) -> None:
        n = len(points)
        x0, y0, h0 = total(x for x, _ in points) / n, total(y for _, y in points) / n, total(heights) / n
        xx = xy = yy = xh = yh = 0.0
        for (x, y), h in zip(points, heights, strict=True):
            dx, dy, dh = x - x0, y - y0, h - h0
            xx, xy, yy, xh, yh = xx + dx * dx, xy + dx * dy, yy + dy * dy, xh + dx * dh, yh + dy * dh
        size, area = xx + yy, xx * yy - xy * xy
        if area > _TINY * size * size:
            self._slope = (yy * xh - xy * yh) / area, (xx * yh - xy * xh) / area
        else:  # minimum-norm fit: a line has no slope across itself
            self._slope = (xh / size, yh / size) if size > 0.0 else (0.0, 0.0)
        self._offset = h0 - x0 * self._slope[0] - y0 * self._slope[1]

    def __call__(self, point: Point) -> float:
        return float(self._offset + self._slope[0] * point[0] + self._slope[1] * point[1])


def corners(
    a: Solid,
    T_world_a: FloatArray,
    b: Solid,
    T_world_b: FloatArray,
    normal: FloatArray,
    deepest: FloatArray,
    depth: float,
) -> list[Corner]:
    """Return the corners of the contact area of two shapes; only the deepest point if no two sides face each other.

    Args:
        a: first shape.
        T_world_a: pose of the first shape's link, shape (4, 4).
        b: second shape.
        T_world_b: pose of the second shape's link, shape (4, 4).
        normal: unit vector from b to a, shape (3,).
        deepest: middle of the overlap at the deepest point, in the world frame, shape (3,) [m].
        depth: overlap at the deepest point, negative for a gap [m]."""
    alone = [Corner(deepest, depth, 1.0)]
    side_a, side_b = _side(a, T_world_a, -normal), _side(b, T_world_b, normal)
    round_ones = [side is None and solid.kind != "plane" for side, solid in ((side_a, a), (side_b, b))]
    if any(round_ones) or (side_a is None and side_b is None):
        return alone
    s, t = _across(normal)
    frame = np.column_stack([s, t, normal])
    middle, height = float(normal @ deepest), {}
    outlines: list[list[Point]] = []
    for name, side in (("a", side_a), ("b", side_b)):
        if side is None:
            continue
        projected = (side @ frame).tolist()
        points = [(x, y) for x, y, _ in projected]
        height[name] = _Heights(points, [z for *_, z in projected])
        outlines.append(_convex(points) if len(points) > 2 else points)
    shared = _common(outlines[0], outlines[1]) if len(outlines) == 2 else outlines[0]
    surface = middle + (0.5 * depth if side_b is None else -0.5 * depth)
    corners = []
    for point, share in zip(shared, _shares(shared), strict=True):
        top = height["b"](point) if "b" in height else surface
        bottom = height["a"](point) if "a" in height else surface
        corners.append(Corner(point[0] * s + point[1] * t + middle * normal, top - bottom, share))
    if not corners or abs(max(corner.depth for corner in corners) - depth) > _AGREES + 0.05 * abs(depth):
        return alone
    return corners


def _shares(shape: list[Point]) -> list[float]:
    """Return for each corner of a polygon half the length of its two edges, relative to the length of the outline."""
    n = len(shape)
    edges = [math.dist(shape[k], shape[(k + 1) % n]) + _TINY for k in range(n)]
    return [0.5 * (edges[k - 1] + edges[k]) / total(edges) for k in range(n)]


def mean_normal(near: Sequence[tuple[float, FloatArray]]) -> FloatArray:
    """Return the mean contact normal of points (depth [m], normal): of overlapping points, weighted by depth.

    If fewer than two points overlap, it is the normal of the deepest point."""
    overlapping = [(depth, normal) for depth, normal in near if depth > 0.0]
    if len(overlapping) < 2:
        return max(near, key=lambda point: point[0])[1]
    weighted = sum((depth * normal for depth, normal in overlapping), np.zeros(3))
    size = float(np.linalg.norm(weighted))
    return weighted / size if size > 0.0 else overlapping[0][1]


def centre(corners: Sequence[Corner], deepening: Sequence[float] = (), ahead: float = 0.0) -> tuple[FloatArray, float]:
    """Return (position, shape (3,) [m], depth [m]) of the single spring that represents a contact area.

    The depth is D = s ln(sum_i a_i exp(d_i / s)) over the depths d_i of the corners, with their shares a_i and a
    softness s. For equal depths, D is that depth; if one corner is far deeper than the others, D is about its depth.
    The position is the mean of the corners weighted by the derivatives of D. So force and moment of the spring have a
    common potential: the spring returns the energy that it has stored, even if the side tilts meanwhile. (A mean
    weighted by depth has no potential: 12 % of the energy was gained in one impact of a hand on a box.)

    Args:
        corners: corners of the contact areas of all shapes of a pair of links.
        deepening: rate at which the depth of each corner increases [m/s]; empty: the present depths are used.
        ahead: time for which the depths are extrapolated at these rates [s].
    """
    depths = [corner.depth for corner in corners]
    if deepening:
        depths = [depth + ahead * speed for depth, speed in zip(depths, deepening, strict=True)]
    if len(corners) == 1:
        return corners[0].position, depths[0]
    deepest = max(depths)
    weights = [corner.share * math.exp((d - deepest) / SOFTNESS) for corner, d in zip(corners, depths, strict=True)]
    weight = total(weights)
    position = sum((w * corner.position for w, corner in zip(weights, corners, strict=True)), np.zeros(3)) / weight
    return position, deepest + SOFTNESS * math.log(weight)
