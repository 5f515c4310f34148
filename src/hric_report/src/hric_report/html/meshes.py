"""Meshes of a robot description for the browser: few triangles, one surface per material colour."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh

from hric_core.meshes.canonical import MeshSurface
from hric_core.meshes.files import read_coloured

TRIANGLES = 3000
"""Maximum number of triangles of a mesh; the Panda's links still look round, and all meshes of a page take half a
megabyte. Project default, unconfirmed."""
FEWEST = 40
"""Minimum number of triangles per colour in a reduced mesh. Project default, unconfirmed."""
SHARP = np.radians(35.0)
"""Angle between faces above which the edge stays sharp in the browser's shading [rad]. Project default, unconfirmed."""
Coloured = tuple[MeshSurface, tuple[float, ...] | None]
"""(surface, colour of its material): red, green, blue and opacity, each 0 to 1; None: no material."""


def few_triangles(path: Path, scale: tuple[float, float, float]) -> tuple[Coloured, ...]:
    """Read a mesh file for the browser, one surface per colour, with few triangles.

    Vertices on sharp edges are duplicated, one for each side, as smooth shading requires.

    Raises:
        OSError, UnreadableMeshError: the file cannot be read.
    """
    return _few_triangles(path, path.stat().st_mtime_ns, scale)


@lru_cache(maxsize=64)
def _few_triangles(path: Path, changed: int, scale: tuple[float, float, float]) -> tuple[Coloured, ...]:
    parts = read_coloured(path, path.read_bytes(), scale)
    share = TRIANGLES / sum(len(surface.faces) for surface, _ in parts)
    return tuple(
        (_shaded(decimate(surface, max(FEWEST, int(share * len(surface.faces))))), colour) for surface, colour in parts
    )


def _shaded(surface: MeshSurface) -> MeshSurface:
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    shaded = trimesh.graph.smooth_shade(mesh, angle=SHARP, facet_minarea=None)
    return MeshSurface(np.asarray(shaded.vertices, float), np.asarray(shaded.faces, np.int64))


def decimate(surface: MeshSurface, triangles: int = TRIANGLES) -> MeshSurface:
    """Reduce a surface to about `triangles` triangles by quadric error decimation; a smaller one is unchanged."""
    if len(surface.faces) <= triangles:
        return surface
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    reduced = mesh.simplify_quadric_decimation(face_count=triangles)
    return MeshSurface(np.asarray(reduced.vertices, float), np.asarray(reduced.faces, np.int64))
