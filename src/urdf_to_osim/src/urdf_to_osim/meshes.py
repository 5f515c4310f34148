"""Meshes of a description as files for OpenSim, converted once and cached by the hash of their content."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hric_core.errors import DescriptionError, HricError
from hric_core.kept import write_whole
from hric_core.meshes.canonical import WRITTEN_SUFFIX, canonical, find


@dataclass(frozen=True)
class MeshRequest:
    """Mesh file of the description to convert.

    Attributes:
        link: link that shows it, for errors.
        address: address in the description: package://, file:// or a path.
        scale: factors along x, y, z, applied to the vertices.
        file: name of the result in Geometry/ in the model, without folder or ending; the same for the same address and
            scale.
    """

    link: str
    address: str
    scale: tuple[float, float, float]
    file: str


@dataclass(frozen=True)
class MeshResult:
    """Converted mesh in the folder, in metres, with the request's scale applied.

    Attributes:
        request: the request.
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
    """Write `<file>.obj` for each request into a folder, each file completely or not at all.

    Args:
        requests: meshes in any order; the same address may occur more than once.
        folder: the Geometry folder; created if missing, other files in it are not touched.
        cache: folder of cached conversions; `cache_folder("meshes")` by default. A read-only cache only costs time.
        relative_to: base folder of relative addresses, the description's own.

    Raises:
        DescriptionError: a mesh is missing, has an unknown ending or a bad scale, or cannot be read; nothing is written
            if meshes are missing.
    """
    paths = _find_all(requests, relative_to)
    folder.mkdir(parents=True, exist_ok=True)
    return [_convert(request, path, folder, cache) for request, path in zip(requests, paths, strict=True)]


def _find_all(requests: Sequence[MeshRequest], relative_to: Path | None) -> list[Path]:
    """Return the file of each request; the error names the first missing one and the number of others."""
    paths: list[Path] = []
    errors: list[str] = []
    for request in requests:
        try:
            paths.append(find(request.address, request.scale, f"link {request.link!r}", relative_to))
        except HricError as error:
            if str(error) not in errors:
                errors.append(str(error))
    if errors:
        raise DescriptionError(errors[0] + (f" ({len(errors) - 1} more meshes likewise)" if len(errors) > 1 else ""))
    return paths


def _convert(request: MeshRequest, path: Path, folder: Path, cache: Path | None) -> MeshResult:
    started = time.perf_counter()
    target = folder / f"{request.file}{WRITTEN_SUFFIX}"
    text, cached = canonical(path, request.scale, f"link {request.link!r}", cache)
    write_whole(target, text)
    return MeshResult(request, target.name, time.perf_counter() - started, cached)
