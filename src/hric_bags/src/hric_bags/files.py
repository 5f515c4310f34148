"""Writing of files that are either complete or absent: written under another name in the folder, then renamed."""

import contextlib
import errno
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hric_core.errors import FailureError

MEGABYTE = 1e6
"""One megabyte [B]."""


class FileError(FailureError):
    """Error for a file that cannot be written: the disk is full or broken, or access is not permitted."""


def cannot_write(path: Path, error: OSError) -> FileError:
    """Return the error for a file that the system refused to write; for a full disk, with the free space."""
    free = ""
    if error.errno == errno.ENOSPC:
        with contextlib.suppress(OSError):
            state = os.statvfs(path.parent)
            free = f" ({state.f_bavail * state.f_frsize / MEGABYTE:.0f} MB are free)"
    return FileError(f"cannot write {path}: {error.strerror or error}{free}")


def make_folder(folder: Path) -> None:
    """Make a folder and its missing parents. Raises FileError if the system refuses."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(folder, error) from error


@contextlib.contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """Yield a path with the same extension to write to, renamed to `path` if the block ends without an error.

    Raises:
        FileError: the system refuses to write; no incomplete file is left.
    """
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically: a reader sees the old contents or the new, never a part."""
    with atomic(path) as temporary, temporary.open("w") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def write_json(path: Path, data: Any) -> None:
    """Write data as a JSON file, atomically; NaN raises ValueError, because JSON does not have it."""
    write_text(path, json.dumps(data, indent=2, allow_nan=False) + "\n")


def write_yaml(path: Path, data: Any) -> None:
    """Write data as a YAML file, atomically, with keys in their order."""
    import yaml

    write_text(path, yaml.dump(data, Dumper=yaml.CSafeDumper, sort_keys=False, allow_unicode=True, width=140))


def point_link(link: Path, target: str) -> None:
    """Make a symbolic link point to `target` (relative to the link's folder), atomically."""
    temporary = link.with_name(f".{link.name}.{os.getpid()}.tmp")
    temporary.unlink(missing_ok=True)
    temporary.symlink_to(target)
    temporary.replace(link)
