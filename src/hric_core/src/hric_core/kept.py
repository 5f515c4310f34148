"""Folder of the cache for computed results, its files by the content they were computed from, and atomic writing."""

import hashlib
import logging
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

LOG = logging.getLogger("hric.cache")


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


class CacheEntry:
    """File in a cache folder; a damaged file is removed when it is read.

    Args:
        folder: folder of the cache; None: nothing is kept.
        parts: everything that the content depends on, with a version of the code that computes it.
        suffix: extension of the file.
    """

    def __init__(self, folder: Path | None, parts: Iterable[bytes], suffix: str) -> None:
        self._folder, self._suffix = folder, suffix
        self._key = hashlib.sha256(b"|".join(parts)).hexdigest()

    def read(self) -> bytes | None:
        """Return the content; None if it must be computed."""
        if self._folder is None:
            return None
        try:
            for path in self._folder.glob(f"{self._key}_*{self._suffix}"):
                content = path.read_bytes()
                if path.name == self._name(content):
                    return content
                path.unlink()
        except OSError:
            pass  # an unreadable cache is ignored
        return None

    def write(self, content: bytes) -> None:
        """Write the content to the cache; log a message if that is not possible."""
        if self._folder is None:
            return
        path = self._folder / self._name(content)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, content)
        except OSError as error:
            LOG.info("cache: cannot write %s (%s); the content is computed again next time", path, error)

    def _name(self, content: bytes) -> str:
        """Return the name of the file: its key, and a hash of the content, by which a damaged file is detected."""
        return f"{self._key}_{hashlib.sha256(content).hexdigest()[:32]}{self._suffix}"
