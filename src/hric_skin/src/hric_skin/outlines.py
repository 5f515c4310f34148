"""Outlines of the body regions of a skin, seen from the front or from behind, for flat pictures."""

from collections import defaultdict
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from hric_core.geometry import FloatArray
from hric_skin.regions import REGION_KEYS
from hric_skin.skin import Skin
from hric_skin.surface import smoothed

SMOOTHING = 4
"""Number of times that the borders between regions are smoothed."""
SMALLEST = 0.15
"""Smallest outlined area, as a share of the region's largest [1]; smaller ones are folds of the mouth or of fingers."""
STEP = 6e-3
"""Smallest distance of two points along an outline [m]."""


def outlines(skin: Skin, vertices: FloatArray, *, back: bool) -> dict[str, list[FloatArray]]:
    """Return the outlines of each region that can be seen (see `REGION_KEYS`), the farthest region first.

    Outlines have no holes, though folds of the surface may hide parts inside of them.

    Args:
        skin: skin of a person.
        vertices: its vertices in a posture in which limbs do not hide each other; x forward, y left, z up, shape (n, 3)
            [m].
        back: True for the view from behind, False for the view from the front.

    Returns:
        Closed polygons by region, coordinates to the viewer's right and up, shape (k, 2) each [m].
    """
    sign = -1.0 if back else 1.0
    vertices, first, merged = np.unique(np.round(vertices, 6), axis=0, return_index=True, return_inverse=True)
    triangles = merged.ravel()[skin.triangles]  # without the seams between zones
    likeness = smoothed(triangles, np.eye(len(REGION_KEYS))[skin.region_keys[first]], SMOOTHING)
    seen = np.column_stack((sign * vertices[:, 1], vertices[:, 2]))
    a, b, c = (seen[triangles[:, corner]].T for corner in range(3))
    (x, y), (u, v) = b - a, c - a
    towards = triangles[x * v > y * u]
    keys = np.argmax(likeness, axis=1)
    points, cells = _cells(towards, seen, likeness)
    depth = sign * vertices[:, 0]
    regions = sorted(np.unique(keys[towards]), key=lambda key: float(np.mean(depth[towards[keys[towards] == key]])))
    polygons = {REGION_KEYS[key]: [points[loop] for loop in _loops(cells[key])] for key in regions}
    smallest = {name: SMALLEST * max(map(_area, loops)) for name, loops in polygons.items()}
    return {name: [_thinned(one) for one in loops if _area(one) >= smallest[name]] for name, loops in polygons.items()}


def _cells(
    triangles: npt.NDArray[np.int32], points: FloatArray, likeness: FloatArray
) -> tuple[FloatArray, dict[int, list[tuple[int, ...]]]]:
    """Return points and the polygons of each region; a triangle of several regions is split between its corners.

    Args:
        triangles: indices of points, shape (m, 3).
        points: points, shape (n, 2); further ones are appended.
        likeness: how much each point belongs to each region, shape (n, k); the largest decides.
    """
    keys = np.argmax(likeness, axis=1).tolist()
    more, borders, cells = list(points), dict[tuple[int, int], int](), defaultdict[int, list[tuple[int, ...]]](list)

    def border(i: int, j: int) -> int:
        i, j = min(i, j), max(i, j)
        if (i, j) not in borders:
            a, b = likeness[[i, j], keys[i]] - likeness[[i, j], keys[j]]
            borders[i, j] = len(more)
            more.append(points[i] + (a / (a - b) if a > b else 0.5) * (points[j] - points[i]))
        return borders[i, j]

    for a, b, c in triangles.tolist():
        corners = (a, b, c)
        if keys[a] == keys[b] == keys[c]:
            cells[keys[a]].append(corners)
            continue
        sides = [border(i, j) for i, j in pairwise((*corners, a))]
        crossed = [
            more[side] for side, (i, j) in zip(sides, pairwise((*corners, a)), strict=True) if keys[i] != keys[j]
        ]
        more.append(np.mean(crossed, axis=0))
        for k, corner in enumerate(corners):
            cells[keys[corner]].append((corner, sides[k], len(more) - 1, sides[k - 1]))
    return np.array(more), cells


def _loops(cells: list[tuple[int, ...]]) -> list[list[int]]:
    """Return the closed boundaries of some polygons, all of the same orientation, as indices of points."""
    edges = {edge for cell in cells for edge in pairwise((*cell, cell[0]))}
    following = defaultdict[int, list[int]](list)
    for begin, end in edges:
        if (end, begin) not in edges:
            following[begin].append(end)
    loops = []
    while following:
        loop = [next(iter(following))]
        while ends := following.get(loop[-1]):
            loop.append(ends.pop())
            if not ends:
                del following[loop[-2]]
        loops.append(loop[:-1])
    return loops


def _thinned(loop: FloatArray) -> FloatArray:
    """Return a polygon, shape (k, 2), without points that are near the one before."""
    kept = [loop[0]]
    for point in loop[1:]:
        if np.hypot(*(point - kept[-1])) > STEP:
            kept.append(point)
    return np.array(kept)


def _area(loop: FloatArray) -> float:
    """Return the area of a polygon, shape (k, 2); below zero if it runs clockwise."""
    x, y = loop.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
