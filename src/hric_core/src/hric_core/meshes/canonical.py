"""Conversion of mesh files to one format for every physics engine, with a cache; convex hulls of meshes.

The format is Wavefront .obj text in metres, with the scale of the robot description applied."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hric_core.errors import DescriptionError, HricError
from hric_core.geometry import FloatArray
from hric_core.kept import CacheEntry, cache_folder
from hric_core.magnitudes import largest
from hric_core.resources import resolve
from hric_core.urdf import Shape

SUFFIXES = (".dae", ".obj", ".stl")
"""Extensions of the mesh files that can be read."""
WRITTEN_SUFFIX = ".obj"
"""Extension of the converted files."""
VERSION = b"2"
"""Version of the conversion, part of every cache key; change it when the converted text changes."""
THINNEST = 1e-6
"""Smallest ratio of thickness to length of a mesh; below it the mesh is flat [1] (project default, unconfirmed)."""


IntArray = NDArray[np.int64]


class UnreadableMeshError(HricError):
    """Mesh file whose content does not match its extension, or has no surface."""


@dataclass(frozen=True)
class MeshSurface:
    """Triangle mesh, in the axes of its file.

    Attributes:
        vertices: shape (n, 3) [m].
        faces: indices of vertices, counter-clockwise seen from outside, shape (m, 3).
    """

    vertices: FloatArray
    faces: IntArray

    @property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, shape (2, 3) [m]."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])


def obj_text(surface: MeshSurface, source: str) -> str:
    """Return the surface as Wavefront .obj with nine digits, without normals, textures and materials.

    Args:
        surface: surface to write.
        source: name of the source for the first line.
    """
    vertices = ("v %.9g %.9g %.9g\n" * len(surface.vertices)) % tuple(surface.vertices.ravel().tolist())
    faces = ("f %d %d %d\n" * len(surface.faces)) % tuple((surface.faces + 1).ravel().tolist())
    return f"# from {source}; unit: m\n{vertices}{faces}"


def find(address: str, scale: Sequence[float], where: str, relative_to: Path | None = None) -> Path:
    """Return the path of a mesh file, after checking that it exists and that extension and scale are valid.

    Args:
        address: path, file:// or package:// address in the description.
        scale: factors along x, y, z.
        where: element of the description with the mesh, for error messages.
        relative_to: folder to which a relative path refers.

    Raises:
        DescriptionError: no such file, another type of file, or a bad scale.
    """
    where = f"{where}: mesh {address!r}"
    if len(scale) != 3 or not all(math.isfinite(factor) and factor for factor in scale):
        raise DescriptionError(
            f"{where}: scale {' '.join(f'{x:g}' for x in scale)} must be three finite numbers other than 0"
        )
    if Path(address).suffix.lower() not in SUFFIXES:
        raise DescriptionError(
            f"{where}: this kind of file cannot be read; valid: {', '.join(SUFFIXES)}. Export it as one of these, "
            "or leave meshes out"
        )
    try:
        return resolve(address, relative_to)
    except HricError as error:
        raise DescriptionError(
            f"{where}: {error}. Put the file there, set ROS_PACKAGE_PATH, or leave meshes out"
        ) from error


def canonical(path: Path, scale: Sequence[float], where: str, cache: Path | None = None) -> tuple[bytes, bool]:
    """Return a mesh file as Wavefront .obj text in metres, and True if the text came from the cache.

    Args:
        path: result of `find`.
        scale: factors along x, y, z.
        where: element of the description with the mesh, for error messages.
        cache: folder of converted meshes; `cache_folder("meshes")` by default. If it is not writable, the mesh is
            converted again each time.

    Raises:
        DescriptionError: the mesh cannot be read.
    """
    cache = cache_folder("meshes") if cache is None else cache
    try:
        content = path.read_bytes()
        parts = (VERSION, path.suffix.lower().encode(), repr(tuple(map(float, scale))).encode(), content)
        entry = CacheEntry(cache, parts, WRITTEN_SUFFIX)
        if (text := entry.read()) is not None:
            return text, True
        from hric_core.meshes.files import read_surface  # loads the mesh libraries: 0.3 s

        x, y, z = map(float, scale)
        text = obj_text(read_surface(path, content, (x, y, z)), path.name).encode()
    except (OSError, UnreadableMeshError) as error:
        raise DescriptionError(
            f"{where}: mesh {str(path)!r} cannot be read as {path.suffix}: {error}. Repair it, or leave meshes out"
        ) from error
    entry.write(text)
    return text, False


def mesh_of(shape: Shape) -> bytes:
    """Return the mesh of a URDF shape as Wavefront .obj text in metres. Raises DescriptionError if it is not usable."""
    return canonical(find(shape.address, shape.size, shape.where), shape.size, shape.where)[0]


def hull_of(shape: Shape) -> MeshSurface:
    """Return the convex hull of a URDF shape's mesh, in the axes of the shape; every engine collides with this hull.

    Raises:
        DescriptionError: the mesh is missing, cannot be read, or is flat.
    """
    path = find(shape.address, shape.size, shape.where)
    try:
        return _hull(path, path.stat().st_mtime_ns, shape.size, shape.where)
    except UnreadableMeshError as error:
        raise DescriptionError(f"{shape.where}: mesh {str(path)!r}: {error}") from error


@lru_cache(maxsize=256)
def _hull(path: Path, changed: int, scale: tuple[float, ...], where: str) -> MeshSurface:
    from scipy.spatial import ConvexHull

    lines = canonical(path, scale, where)[0].splitlines()
    vertices = np.array([line.split()[1:] for line in lines if line.startswith(b"v ")], float)
    if (length := float(np.ptp(vertices, axis=0).max())) > largest("m"):
        mm = " ".join(f"{factor * 1e-3:g}" for factor in scale)
        raise UnreadableMeshError(
            f'it is {length:.4g} m long; valid: up to {largest("m"):g} m. If it is in mm, use scale="{mm}"'
        )
    extents = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(vertices) < 4 or extents[-1] < THINNEST * extents[0]:
        raise UnreadableMeshError("the mesh is flat; a collision shape must enclose a volume")
    hull = ConvexHull(vertices)
    numbers = {int(old): new for new, old in enumerate(hull.vertices)}
    faces = np.array([[numbers[int(corner)] for corner in face] for face in hull.simplices], np.int64)
    corners: FloatArray = vertices[hull.vertices]
    return MeshSurface(corners, faces)
