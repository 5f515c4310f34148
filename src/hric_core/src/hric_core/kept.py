"""Folder of the cache for computed results, and atomic writing of the files in it."""

import os
import tempfile
from pathlib import Path


def cache_folder(kind: str) -> Path | None:
    """Return the cache folder hric/<kind> below XDG_CACHE_HOME or ~/.cache; None if neither is an absolute path.

    The user may delete the folder at any time; its content is then computed again."""
    for base in (os.environ.get("XDG_CACHE_HOME", ""), os.path.expanduser("~/.cache")):
        if os.path.isabs(base):  # XDG base directory specification: ignore relative paths
            return Path(base) / "hric" / kind
    return None


def write_whole(target: Path, content: bytes) -> None:
    """Write a file atomically, also when several processes write it at once.

    Raises:
        OSError: the folder cannot be written.
    """
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.chmod(name, 0o644)
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
