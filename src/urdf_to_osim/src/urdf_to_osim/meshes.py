"""Conversion of a description's meshes to files for OpenSim; results are cached by the hash of their content."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hric_core.errors import DescriptionError, HricError
from hric_core.kept import write_whole
from hric_core.meshes.canonical import WRITTEN_SUFFIX, canonical, find


@dataclass(frozen=True)
class MeshRequest:
    """Request to convert a mesh file of the description.

    Attributes:
        link: link that has the mesh, for error messages.
        address: address in the description: package://, file:// or a path.
        scale: factors along x, y, z, applied to the vertices [1].
        file: name of the resulting file without folder and ending; requests with equal address and scale share it.
    """

    link: str
    address: str
    scale: tuple[float, float, float]
    file: str


@dataclass(frozen=True)
class MeshResult:
    """Converted mesh file, in metres, with the scale of the request applied.

    Attributes:
        request: request that led to this file.
        file: bare file name with its ending, for `Mesh` and `ContactMesh`.
        seconds: time of the conversion [s].
        cached: True if an earlier conversion was used.
    """

    request: MeshRequest
    file: str
    seconds: float
    cached: bool


def convert_meshes(
    requests: Sequence[MeshRequest], folder: Path, cache: Path | None = None, relative_to: Path | None = None
) -> list[MeshResult]:
    """Convert meshes and write `<file>.obj` for each request into a folder, each file completely or not at all.

    Args:
        requests: meshes in any order; an address may occur more than once.
        folder: folder Geometry/; created if missing, other files in it are not changed.
        cache: folder of cached conversions; None: `cache_folder("meshes")`. If it cannot be written, meshes are
            converted each time.
        relative_to: base folder of relative addresses, usually that of the description.

    Raises:
        DescriptionError: a mesh is missing, has an unknown ending or a bad scale, or cannot be read; nothing is written
            if meshes are missing.
    """
    paths = _find_all(requests, relative_to)
    folder.mkdir(parents=True, exist_ok=True)
    return [_convert(request, path, folder, cache) for request, path in zip(requests, paths, strict=True)]


def _find_all(requests: Sequence[MeshRequest], relative_to: Path | None) -> list[Path]:
    """Return the mesh file of each request; the error names the first missing file and counts the others."""
    paths: list[Path] = []
    errors: list[str] = []
    for request in requests:
        try:
            paths.append(find(request.address, request.scale, f"link {request.link!r}", relative_to))
        except HricError as error:
            if str(error) not in errors:
                errors.append(str(error))
    if errors:
        more = f" ({len(errors) - 1} more meshes have such errors)" if len(errors) > 1 else ""
        raise DescriptionError(f"{errors[0]}{more}")
    return paths


def _convert(request: MeshRequest, path: Path, folder: Path, cache: Path | None) -> MeshResult:
    started = time.perf_counter()
    target = folder / f"{request.file}{WRITTEN_SUFFIX}"
    text, cached = canonical(path, request.scale, f"link {request.link!r}", cache)
    write_whole(target, text)
    return MeshResult(request, target.name, time.perf_counter() - started, cached)
