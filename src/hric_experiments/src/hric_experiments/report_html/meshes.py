"""Meshes of a robot description as few plain triangles."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkQuadricDecimation

from urdf_to_osim.mesh_files import Surface, read_surface

TRIANGLES = 3000
"""Of one mesh at most: the Panda's links look round, and a page's meshes take half a megabyte. Project default,
unconfirmed."""


SHARP = np.radians(35.0)
"""Edges between planes farther apart stay edges when the browser shades the surface. Project default, unconfirmed."""


def few_triangles(path: Path, scale: tuple[float, float, float]) -> Surface:
    """A mesh file for the browser: few triangles, and vertices on sharp edges once per side, as smooth shading wants
    them.

    Raises:
        OSError, UnreadableMeshError: it cannot be read.
    """
    return _few_triangles(path, path.stat().st_mtime_ns, scale)


@lru_cache(maxsize=64)
def _few_triangles(path: Path, changed: int, scale: tuple[float, float, float]) -> Surface:
    reduced = decimate(read_surface(path, path.read_bytes(), scale))
    mesh = trimesh.Trimesh(reduced.vertices, reduced.faces, process=False)
    shaded = trimesh.graph.smooth_shade(mesh, angle=SHARP, facet_minarea=None)
    return Surface(np.asarray(shaded.vertices, float), np.asarray(shaded.faces, np.int64))


def decimate(surface: Surface, triangles: int = TRIANGLES) -> Surface:
    """At most about `triangles` triangles, by joining those whose planes agree best (quadric error); unchanged where
    there are no more."""
    if len(surface.faces) <= triangles:
        return surface
    decimation = vtkQuadricDecimation()
    decimation.SetInputData(_poly(surface))
    decimation.SetTargetReduction(1.0 - triangles / len(surface.faces))
    decimation.Update()
    result = decimation.GetOutput()
    vertices = vtk_to_numpy(result.GetPoints().GetData()).astype(float)
    faces = vtk_to_numpy(result.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int64)
    return Surface(vertices, faces)


def _poly(surface: Surface) -> vtkPolyData:
    points = vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(surface.vertices, dtype=np.float64), deep=1))
    cells = vtkCellArray()
    cells.SetData(3, numpy_to_vtkIdTypeArray(surface.faces.ravel().astype(np.int64), deep=1))
    poly = vtkPolyData()
    poly.SetPoints(points)
    poly.SetPolys(cells)
    return poly
