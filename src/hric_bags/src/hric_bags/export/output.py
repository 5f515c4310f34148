"""The folder of an export: files that are whole or absent, and a list of those that are done, so that an interrupted
export goes on."""

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from hric_bags import files
from hric_bags.export.table import ExportError

LIST = "export.json"
VERSION = 1
"""Of the files' contents: those of another version do not count as done."""


class Output:
    """The folder of one export.

    Args:
        folder: made if missing.
        bags: parts of what is exported; files of another bag, or of this one before it changed, do not count as done.
        request: what the caller set besides the formats; files made on another request do not count either.
        again: nothing counts as done.
        words: of an anonymised export, those that name the person; None: it is not one. Its list has no names, but a
            hash of them.

    Attributes:
        folder: see above.

    Raises:
        ExportError: of this export and the one in the folder only one is anonymised.
    """

    def __init__(
        self,
        folder: Path,
        bags: Sequence[Path],
        request: dict[str, Any] | None = None,
        again: bool = False,
        words: Sequence[str] | None = None,
    ) -> None:
        self.folder = folder
        known: Any = [
            {"name": bag.name, "size": bag.stat().st_size, "modified": bag.stat().st_mtime_ns} for bag in bags
        ]
        if words is not None:
            known = hashlib.sha256(json.dumps([known, sorted(words)]).encode()).hexdigest()
        self._head = {"version": VERSION, "bags": known, "request": request or {}}
        self._formats: dict[str, dict[str, Any]] = {}
        kept = _read(folder / LIST)
        if kept and (words is not None) != isinstance(kept.get("bags"), str):
            kind = "that is not anonymised" if words is not None else "that is anonymised"
            raise ExportError(f"{folder} has an export {kind}; valid: another folder")
        if not again and kept and all(kept.get(key) == value for key, value in self._head.items()):
            self._formats = kept.get("formats") or {}

    def done(self, kind: str) -> list[Path] | None:
        """Files of a format that is finished; None: it is not."""
        entry = self._formats.get(kind) or {}
        paths = [self.folder / name for name in entry.get("files", ())]
        return paths if entry.get("finished") and all(path.is_file() for path in paths) else None

    def write(self, kind: str, name: str, writer: Callable[[Path], object], *, again: bool = False) -> None:
        """Write one file of a format, unless it is there already, and note it.

        Args:
            kind: the format.
            name: of the file.
            writer: is called with the path to write to.
            again: also where it is there.

        Raises:
            FileError: the disk refuses.
        """
        relative = f"{kind}/{name}"
        entry = self._formats.setdefault(kind, {"files": []})
        path = self.folder / relative
        if relative in entry["files"] and path.is_file() and not again:
            return
        files.make_folder(path.parent)
        with files.atomic(path) as temporary:
            writer(temporary)
        if relative not in entry["files"]:
            entry["files"].append(relative)
        self._note()

    def finish(self, kind: str) -> None:
        """Note that a format is complete."""
        self._formats.setdefault(kind, {"files": []})["finished"] = True
        self._note()

    def _note(self) -> None:
        files.make_folder(self.folder)
        files.write_json(self.folder / LIST, {**self._head, "formats": self._formats})


def _read(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text())
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}
