"""The meshes of a description as files that OpenSim reads, converted once and kept by the hash of their content."""

import hashlib
import logging
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hric_control.errors import DescriptionError, HricError
from hric_control.kept import cache_folder, write_whole
from hric_control.plants.resources import resolve

LOG = logging.getLogger("hric.urdf_to_osim")
SUFFIXES = (".dae", ".obj", ".stl")
"""What a description may name; of these OpenSim itself would pass over .dae with a line in its log."""
WRITTEN_SUFFIX = ".obj"
"""Of what is written."""
VERSION = b"1"
"""Part of every key of the cache: to be changed with what the conversion writes."""


@dataclass(frozen=True)
class MeshRequest:
    """A mesh file of the description, to be converted.

    Attributes:
        link: that shows it, for errors.
        address: as the description has it: package://, file:// or a path.
        scale: factors along x, y, z, applied to the vertices.
        file: name that the model has for the result in Geometry/, without folder or ending; the same for the same
            address and scale.
    """

    link: str
    address: str
    scale: tuple[float, float, float]
    file: str


@dataclass(frozen=True)
class MeshResult:
    """A mesh that lies in the folder now, in metres, with the request's scale already in it.

    Attributes:
        request: as given.
        file: bare file name with its ending, for `Mesh` and `ContactMesh`.
        seconds: time that it took [s].
        cached: whether an earlier conversion was used.
    """

    request: MeshRequest
    file: str
    seconds: float
    cached: bool


def convert_meshes(
    requests: Sequence[MeshRequest], folder: Path, cache: Path | None = None, relative_to: Path | None = None
) -> list[MeshResult]:
    """Lay `<file>.obj` for each request into a folder. Each file appears whole or not at all.

    Args:
        requests: meshes in any order; the same address may come more than once.
        folder: the Geometry folder; made where it is missing, other files in it are left alone.
        cache: where conversions are kept; `cache_folder("meshes")` by default. One that cannot be written costs time,
            not the result.
        relative_to: folder against which relative addresses are meant, the description's own.

    Raises:
        DescriptionError: a mesh is missing, has an unknown ending or a bad scale, or cannot be read; nothing is written
            for missing ones.
    """
    paths = _find_all(requests, relative_to)
    cache = cache_folder("meshes") if cache is None else cache
    folder.mkdir(parents=True, exist_ok=True)
    return [_convert(request, path, folder, cache) for request, path in zip(requests, paths, strict=True)]


def _find_all(requests: Sequence[MeshRequest], relative_to: Path | None) -> list[Path]:
    """The file of each request; the error names the first that is missing and how many more are."""
    paths: list[Path] = []
    errors: list[str] = []
    for request in requests:
        try:
            paths.append(_find(request, relative_to))
        except HricError as error:
            if str(error) not in errors:
                errors.append(str(error))
    if errors:
        raise DescriptionError(errors[0] + (f" ({len(errors) - 1} more meshes likewise)" if len(errors) > 1 else ""))
    return paths


def _find(request: MeshRequest, relative_to: Path | None) -> Path:
    where = f"link {request.link!r}: mesh {request.address!r}"
    if len(request.scale) != 3 or not all(math.isfinite(factor) and factor for factor in request.scale):
        raise DescriptionError(
            f"{where}: scale {' '.join(f'{x:g}' for x in request.scale)} must be three finite numbers other than 0"
        )
    if Path(request.address).suffix.lower() not in SUFFIXES:
        raise DescriptionError(
            f"{where}: this kind of file cannot be read; valid: {', '.join(SUFFIXES)}. Export it as one of these, "
            "or leave meshes out"
        )
    try:
        return resolve(request.address, relative_to)
    except HricError as error:
        raise DescriptionError(
            f"{where}: {error}. Put the file there, set ROS_PACKAGE_PATH, or leave meshes out"
        ) from error


def _convert(request: MeshRequest, path: Path, folder: Path, cache: Path | None) -> MeshResult:
    started = time.perf_counter()
    content = path.read_bytes()
    key = hashlib.sha256(
        b"|".join([VERSION, path.suffix.lower().encode(), repr(tuple(map(float, request.scale))).encode(), content])
    ).hexdigest()
    target = folder / f"{request.file}{WRITTEN_SUFFIX}"
    text = None if cache is None else _read_kept(cache, key)
    cached = text is not None
    if text is None:
        text = _fresh(request, path, content)
        if cache is not None:
            _keep(cache / _kept_name(key, text), text)
    write_whole(target, text)
    return MeshResult(request, target.name, time.perf_counter() - started, cached)


def _fresh(request: MeshRequest, path: Path, content: bytes) -> bytes:
    from urdf_to_osim.mesh_files import UnreadableMeshError, obj_text, read_surface  # loads the mesh libraries: 0.3 s

    try:
        return obj_text(read_surface(path, content, request.scale), path.name).encode()
    except UnreadableMeshError as error:
        raise DescriptionError(
            f"link {request.link!r}: mesh {request.address!r} ({path}) cannot be read as {path.suffix}: {error}. "
            "Repair it, or leave meshes out"
        ) from error


def _kept_name(key: str, text: bytes) -> str:
    """Names content, scale and version of the conversion, and a hash of what must be in the file, by which a file that
    was damaged since is known."""
    return f"{key}_{hashlib.sha256(text).hexdigest()[:32]}{WRITTEN_SUFFIX}"


def _read_kept(cache: Path, key: str) -> bytes | None:
    try:
        for path in cache.glob(f"{key}_*{WRITTEN_SUFFIX}"):
            text = path.read_bytes()
            if path.name == _kept_name(key, text):
                return text
            path.unlink()
    except OSError:
        pass  # a cache that cannot be read is no cache
    return None


def _keep(kept: Path, text: bytes) -> None:
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        write_whole(kept, text)
    except OSError as error:
        LOG.warning("converted meshes are not kept: %s", error)
