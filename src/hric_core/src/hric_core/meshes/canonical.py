"""Meshes in one form for every engine, cached by the hash of their source, and their convex hulls.

The form is .obj text in metres with the scale applied."""

import hashlib
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hric_core.errors import DescriptionError, HricError
from hric_core.geometry import FloatArray
from hric_core.kept import cache_folder, write_whole
from hric_core.resources import resolve
from hric_core.urdf import Shape

LOG = logging.getLogger("hric.meshes")
SUFFIXES = (".dae", ".obj", ".stl")
"""Types of mesh files that a description may name."""
WRITTEN_SUFFIX = ".obj"
"""Type of the written files."""
VERSION = b"1"
"""Version in every key of the cache; change it with the output of the conversion."""
THINNEST = 1e-6
"""Thickness of a solid by its length, below which it is a plane [1] (project default, unconfirmed)."""


IntArray = NDArray[np.int64]


class UnreadableMeshError(HricError):
    """Error of a file that does not match its extension, or has no surface."""


@dataclass(frozen=True)
class MeshSurface:
    """Triangles in the axes of the mesh.

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
    """Return the path of a mesh that can be read.

    Args:
        address: address in the description.
        scale: factors along x, y, z.
        where: element with the mesh, for errors.
        relative_to: folder of relative addresses.

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
    """Return the canonical text of a mesh file, and True if it came from the cache.

    Args:
        path: result of `find`.
        scale: factors along x, y, z.
        where: element with the mesh, for errors.
        cache: folder of conversions; `cache_folder("meshes")` by default. One that is not writable costs time, not the
            result.

    Raises:
        DescriptionError: it cannot be read.
    """
    cache = cache_folder("meshes") if cache is None else cache
    try:
        content = path.read_bytes()
        key = hashlib.sha256(
            b"|".join([VERSION, path.suffix.lower().encode(), repr(tuple(map(float, scale))).encode(), content])
        ).hexdigest()
        if cache is not None and (text := _read_kept(cache, key)) is not None:
            return text, True
        from hric_core.meshes.files import read_surface  # loads the mesh libraries: 0.3 s

        x, y, z = map(float, scale)
        text = obj_text(read_surface(path, content, (x, y, z)), path.name).encode()
    except (OSError, UnreadableMeshError) as error:
        raise DescriptionError(
            f"{where}: mesh {str(path)!r} cannot be read as {path.suffix}: {error}. Repair it, or leave meshes out"
        ) from error
    if cache is not None:
        _keep(cache / _kept_name(key, text), text)
    return text, False


def mesh_of(shape: Shape) -> bytes:
    """Return the canonical text of a shape's mesh. Raises DescriptionError as `find` and `canonical`."""
    return canonical(find(shape.address, shape.size, shape.where), shape.size, shape.where)[0]


def hull_of(shape: Shape) -> MeshSurface:
    """Return the convex hull of a shape's mesh, in axes of the shape: the collision shape on every engine.

    Raises:
        DescriptionError: as `find` and `canonical`, or it is flat.
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
    extents = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(vertices) < 4 or extents[-1] < THINNEST * extents[0]:
        raise UnreadableMeshError("it is flat; as a solid it must enclose a volume")
    hull = ConvexHull(vertices)
    numbers = {int(old): new for new, old in enumerate(hull.vertices)}
    faces = np.array([[numbers[int(corner)] for corner in face] for face in hull.simplices], np.int64)
    corners: FloatArray = vertices[hull.vertices]
    return MeshSurface(corners, faces)


def _kept_name(key: str, text: bytes) -> str:
    """Return the file name: hash of content, scale and version, and hash of the text, by which damage is detected."""
    return f"{key}_{hashlib.sha256(text).hexdigest()[:32]}{WRITTEN_SUFFIX}"


def _read_kept(cache: Path, key: str) -> bytes | None:
    try:
        for path in cache.glob(f"{key}_*{WRITTEN_SUFFIX}"):
            text = path.read_bytes()
            if path.name == _kept_name(key, text):
                return text
            path.unlink()
    except OSError:
        pass  # an unreadable cache is ignored
    return None


def _keep(path: Path, text: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)
    except OSError as error:
        LOG.warning("converted meshes are not kept: %s", error)
