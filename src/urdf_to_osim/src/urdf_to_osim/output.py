"""Writing of a converted model with its mesh files: all files are written, or none."""

import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hric_core.errors import CommandError, ParameterError, failing
from urdf_to_osim.converter import Conversion
from urdf_to_osim.geometry import lay, refer

GEOMETRY = "Geometry"  # the folder beside an .osim where OpenSim looks for mesh files
SUFFIX = ".osim"


@dataclass(frozen=True)
class Written:
    """Files that were written: the model, its mesh files in Geometry/, and the time for the meshes [s]."""

    path: Path
    meshes: tuple[Path, ...]
    mesh_seconds: float


def write(
    conversion: Conversion, path: Path | str, check: Callable[[Path], None] | None = None, cache: Path | None = None
) -> Written:
    """Write a converted model and its mesh files; files of the same names are replaced, others are not changed.

    Args:
        conversion: result of the conversion.
        path: .osim file to write; its folder must exist.
        check: function that is called with the finished file at a temporary path; if it raises an exception, no file
            is written.
        cache: folder of converted meshes; None: `hric_core.kept.cache_folder("meshes")`.

    Raises:
        ParameterError: the path does not end in .osim, is a folder, or its folder does not exist.
        DescriptionError: a mesh is missing or cannot be read; names link and address.
        CommandError: the files cannot be written.
    """
    path = Path(path)
    if path.suffix != SUFFIX or path.is_dir():
        raise ParameterError(f"output {path} must be the name of a file that ends in {SUFFIX}")
    if not path.parent.is_dir():
        raise ParameterError(f"output {path}: there is no folder {path.parent}; create it first")
    try:
        with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as name:
            return _write(conversion, path, Path(name), check, cache)
    except OSError as error:
        with failing():
            raise CommandError(f"output {path} cannot be written: {error.strerror or error}") from error


def _write(
    conversion: Conversion, path: Path, stage: Path, check: Callable[[Path], None] | None, cache: Path | None
) -> Written:
    mesh_files = lay(conversion, stage / GEOMETRY, cache)
    staged = stage / path.name
    refer(conversion, None)
    if not conversion.model.printToXML(str(staged)) or not staged.is_file():
        raise CommandError(f"output {path}: OpenSim did not write the file")
    os.chmod(staged, 0o644)
    if check is not None:
        check(staged)
    _move(stage / GEOMETRY, path.parent / GEOMETRY, mesh_files.files)
    os.replace(staged, path)
    refer(conversion, (path.parent / GEOMETRY).resolve())
    return Written(path, tuple(path.parent / GEOMETRY / file for file in mesh_files.files), mesh_files.seconds)


def _move(stage: Path, folder: Path, files: tuple[str, ...]) -> None:
    """Move files into a folder one by one; if that fails for one, remove those that did not exist before."""
    made_folder = bool(files) and not folder.exists()
    made: list[Path] = []
    try:
        if made_folder:
            folder.mkdir()
        for file in files:
            made += [folder / file] if not (folder / file).exists() else []
            os.replace(stage / file, folder / file)
    except OSError:
        for path in made:
            path.unlink(missing_ok=True)
        if made_folder:
            shutil.rmtree(folder, ignore_errors=True)
        raise
