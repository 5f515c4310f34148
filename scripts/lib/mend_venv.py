"""Take out of .venv what an interrupted pip left incomplete, so that pip installs it again. Called by scripts/setup
with the environment's Python."""

import shutil
import sysconfig
from importlib import metadata
from pathlib import Path

PRUNED = {"pybullet_data"}, {"cmeel.prefix", "include"}
"""Of a path in what scripts/setup takes out again."""


def mend(folder: Path) -> None:
    """Forget each package below a folder one of whose files is missing or cut off."""
    for found in metadata.distributions(path=[str(folder)]):
        kept = Path(str(found._path))  # type: ignore[attr-defined]
        if not found.files or not all(whole(file) for file in found.files):
            print(f"    incomplete, installed again: {kept.name.partition('-')[0]}")
            shutil.rmtree(kept, ignore_errors=True)


def whole(file: metadata.PackagePath) -> bool:
    """Whether a file is there with the size that its package says; compiled Python is not counted."""
    path = Path(str(file.locate()))
    if path.suffix == ".pyc" or any(parts <= set(path.parts) for parts in PRUNED):
        return True
    return path.is_file() and (file.size is None or path.stat().st_size == file.size)


if __name__ == "__main__":
    mend(Path(sysconfig.get_path("purelib")))
