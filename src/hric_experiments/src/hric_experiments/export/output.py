"""The folder of an export: files that are whole or absent, and a list of those that are done, so that an interrupted export goes on."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hric_experiments import files
from hric_experiments.export.table import ExportError

LIST = "export.json"
VERSION = 1
"""Of the files' contents: those of another version do not count as done."""


@contextlib.contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A path to write to, moved to `path` when the block ends without an error.

    Raises:
        ExportError: the disk refuses.
    """
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


class Output:
    """The folder of one export.

    Args:
        folder: made if missing.
        bags: parts of what is exported; files of another bag, or of this one before it changed, do not count as done.
        request: what was asked for besides the formats; files made on another request do not count either.
        again: nothing counts as done.

    Attributes:
        folder: see above.
    """

    def __init__(self, folder: Path, bags: Sequence[Path], request: dict[str, Any] | None = None, *, again: bool = False) -> None:
        self.folder = folder
        told = [{"name": bag.name, "size": bag.stat().st_size, "modified": bag.stat().st_mtime_ns} for bag in bags]
        self._head = {"version": VERSION, "bags": told, "request": request or {}}
        self._formats: dict[str, dict[str, Any]] = {}
        if not again and (kept := _read(folder / LIST)) and all(kept.get(key) == value for key, value in self._head.items()):
            self._formats = kept.get("formats") or {}

    def done(self, kind: str) -> list[Path] | None:
        """Files of a format that is finished; None: it is not."""
        entry = self._formats.get(kind) or {}
        paths = [self.folder / name for name in entry.get("files", ())]
        return paths if entry.get("finished") and all(path.is_file() for path in paths) else None

    @contextlib.contextmanager
    def file(self, kind: str, name: str) -> Iterator[Path | None]:
        """Where to write one file of a format, noted when the block ends; None: it is there already."""
        relative = f"{kind}/{name}"
        entry = self._formats.setdefault(kind, {"files": []})
        path = self.folder / relative
        if relative in entry["files"] and path.is_file():
            yield None
            return
        with atomic(path) as temporary:
            yield temporary
        if relative not in entry["files"]:
            entry["files"].append(relative)
        self._note()

    def finish(self, kind: str) -> list[Path]:
        """Note that a format is complete; its files."""
        self._formats.setdefault(kind, {"files": []})["finished"] = True
        self._note()
        return [self.folder / name for name in self._formats[kind]["files"]]

    def _note(self) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            files.write_json(self.folder / LIST, {**self._head, "formats": self._formats})
        except OSError as error:
            raise ExportError(f"cannot write {self.folder / LIST}: {error.strerror or error}") from error


def _read(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text())
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}
