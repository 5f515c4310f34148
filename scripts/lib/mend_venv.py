"""Removal of packages from .venv that an interrupted pip left incomplete, so that pip installs them again.

Called by scripts/setup with the environment's Python."""

import shutil
import sysconfig
from importlib import metadata
from pathlib import Path

PRUNED = {"pybullet_data"}, {"cmeel.prefix", "include"}
"""Sets of path components of files that scripts/setup removes on purpose."""


def mend(folder: Path) -> None:
    """Remove each package below a folder if one of its files is missing or truncated."""
    for package in metadata.distributions(path=[str(folder)]):
        record = Path(str(package._path))  # type: ignore[attr-defined]
        if not package.files or not all(is_complete(file) for file in package.files):
            print(f"    incomplete, will be installed again: {record.name.partition('-')[0]}")
            shutil.rmtree(record, ignore_errors=True)


def is_complete(file: metadata.PackagePath) -> bool:
    """Return True if a file has the size in its package's record; bytecode files are not checked."""
    path = Path(str(file.locate()))
    if path.suffix == ".pyc" or any(parts <= set(path.parts) for parts in PRUNED):
        return True
    return path.is_file() and (file.size is None or path.stat().st_size == file.size)


if __name__ == "__main__":
    mend(Path(sysconfig.get_path("purelib")))
