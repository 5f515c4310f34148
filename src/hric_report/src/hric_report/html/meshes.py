"""Meshes of a robot description as few plain triangles, by the colours of their materials."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh

from hric_core.meshes.canonical import Surface
from hric_core.meshes.files import read_coloured

TRIANGLES = 3000
"""Of one mesh at most: the Panda's links look round, and a page's meshes take half a megabyte. Project default,
unconfirmed."""
FEWEST = 40
"""Of one colour of a mesh, which is not reduced below [triangles]. Project default, unconfirmed."""
SHARP = np.radians(35.0)
"""Edges between planes farther apart stay edges when the browser shades the surface. Project default, unconfirmed."""
Coloured = tuple[Surface, tuple[float, ...] | None]
"""A surface, and red, green, blue and opacity of its material, each 0 to 1; None: it has none."""


def few_triangles(path: Path, scale: tuple[float, float, float]) -> tuple[Coloured, ...]:
    """A mesh file for the browser, a surface per colour: few triangles, and vertices on sharp edges once per side, as
    smooth shading wants them.

    Raises:
        OSError, UnreadableMeshError: it cannot be read.
    """
    return _few_triangles(path, path.stat().st_mtime_ns, scale)


@lru_cache(maxsize=64)
def _few_triangles(path: Path, changed: int, scale: tuple[float, float, float]) -> tuple[Coloured, ...]:
    parts = read_coloured(path, path.read_bytes(), scale)
    share = TRIANGLES / sum(len(surface.faces) for surface, _ in parts)
    return tuple(
        (_shaded(decimate(surface, max(FEWEST, int(share * len(surface.faces))))), colour) for surface, colour in parts
    )


def _shaded(surface: Surface) -> Surface:
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    shaded = trimesh.graph.smooth_shade(mesh, angle=SHARP, facet_minarea=None)
    return Surface(np.asarray(shaded.vertices, float), np.asarray(shaded.faces, np.int64))


def decimate(surface: Surface, triangles: int = TRIANGLES) -> Surface:
    """At most about `triangles` triangles, by joining those whose planes agree best (quadric error); unchanged where
    there are no more."""
    if len(surface.faces) <= triangles:
        return surface
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    reduced = mesh.simplify_quadric_decimation(face_count=triangles)
    return Surface(np.asarray(reduced.vertices, float), np.asarray(reduced.faces, np.int64))
