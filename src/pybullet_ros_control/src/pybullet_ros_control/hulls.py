"""Convex hulls of meshes, reduced by the collision margin that PyBullet adds around each hull."""

import numpy as np
import scipy  # it loads scipy.optimize on first use: half a second that a robot without meshes does not need

from hric_core.geometry import FloatArray
from hric_core.meshes.canonical import MeshSurface

SKIN = 1e-3
"""Collision margin that PyBullet adds around each hull [m]. Source: gUrdfDefaultCollisionMargin of PyBullet 3.2.7."""
_THINNEST = 0.5
"""Maximum reduction of a hull as a fraction of its inscribed sphere's radius [1] (project default, unconfirmed)."""


def without_skin(hull: MeshSurface) -> MeshSurface:
    """Return a hull whose sides are moved inwards by the engine's margin, so that with the margin they fit the mesh.

    The margin rounds the corners: another body touches a corner of a box 0.7 mm late. A hull thinner than four margins
    is reduced by less.

    Args:
        hull: convex hull of the mesh, which encloses a volume.
    """
    sides = scipy.spatial.ConvexHull(hull.vertices).equations  # n x + d <= 0 inside, n of length 1
    bounds = [*[(None, None)] * 3, (0.0, None)]
    rows = np.hstack([sides[:, :3], np.ones((len(sides), 1))])
    inner = scipy.optimize.linprog([0.0, 0.0, 0.0, -1.0], A_ub=rows, b_ub=-sides[:, 3], bounds=bounds)
    if not inner.success:
        return hull
    sides[:, 3] += min(SKIN, _THINNEST * inner.x[3])
    try:
        return _surface(scipy.spatial.HalfspaceIntersection(sides, inner.x[:3]).intersections)
    except scipy.spatial.QhullError:
        return hull


def _surface(points: FloatArray) -> MeshSurface:
    hull = scipy.spatial.ConvexHull(points)
    numbers = np.full(len(points), -1)
    numbers[hull.vertices] = np.arange(len(hull.vertices))
    return MeshSurface(points[hull.vertices], numbers[hull.simplices])
