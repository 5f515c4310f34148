"""Folder of an export, with complete files and a list of them, so that an interrupted export can resume."""

import hashlib
import json
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypedDict

from hric_bags import files
from hric_bags.export.table import ExportError

LIST = "export.json"
VERSION = 1
"""Version of the exported files' contents; files of another version are written again."""


class FormatEntry(TypedDict, total=False):
    """Files of a format, relative to the export's folder; finished: True if the format is complete."""

    files: list[str]
    finished: bool


class ExportFolder:
    """Folder of one export, with the list of its files.

    Args:
        folder: folder of the export, created if missing.
        bags: parts of the exported bag; files of another bag, or of this one before it changed, are written again.
        request: settings of the export besides the formats; files made with other settings are written again.
        again: True: all files are written again.
        words: words that identify the person in an anonymised export, whose list has a hash instead of names; None: not
            anonymised.

    Attributes:
        folder: folder of the export.

    Raises:
        ExportError: the folder has an export that, unlike this one, is anonymised or is not.
    """

    def __init__(
        self,
        folder: Path,
        bags: Sequence[Path],
        request: dict[str, object] | None = None,
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
        self._formats: dict[str, FormatEntry] = {}
        listed = _read(folder / LIST)
        if listed and (words is not None) != isinstance(listed.get("bags"), str):
            kind = "that is not anonymised" if words is not None else "that is anonymised"
            raise ExportError(f"{folder} has an export {kind}; valid: another folder")
        of_formats = [name for entry in (listed.get("formats") or {}).values() for name in entry.get("files", ())]
        self._written, self._again = set(listed.get("written") or of_formats), again
        if not again and listed and all(listed.get(key) == value for key, value in self._head.items()):
            self._formats = listed.get("formats") or {}

    def done(self, kind: str) -> list[Path] | None:
        """Return the files of a finished format; None: the format is not finished."""
        entry = self._formats.get(kind) or FormatEntry()
        paths = [self.folder / name for name in entry.get("files", ())]
        return paths if entry.get("finished") and all(path.is_file() for path in paths) else None

    def write(self, kind: str, name: str, writer: Callable[[Path], object], *, again: bool = False) -> None:
        """Write one file of a format, unless it exists already, and add it to the list.

        Args:
            kind: name of the format.
            name: file name.
            writer: function that writes to the path passed to it.
            again: True: write the file also if it exists.

        Raises:
            ExportError: the file exists, and no export wrote it.
            FileError: the system refuses to write the file.
        """
        relative = f"{kind}/{name}"
        entry = self._formats.setdefault(kind, {"files": []})
        path = self.folder / relative
        if relative in entry["files"] and path.is_file() and not again:
            return
        if relative not in self._written:
            if path.exists() and not self._again:
                raise ExportError(f"{path} is not from an export; valid: another folder, or --again to replace it")
            self._written.add(relative)
            self._note()  # before the file is written: it is known to be of an export even after a crash
        files.make_folder(path.parent)
        with files.atomic(path) as temporary:
            writer(temporary)
        if relative not in entry["files"]:
            entry["files"].append(relative)
        self._note()

    def write_all(self, kind: str, name: str, writer: Callable[[Path], object]) -> None:
        """Write the files of a format that `writer` puts into a new folder with this name."""
        files.make_folder(self.folder)
        with tempfile.TemporaryDirectory(prefix=".", dir=self.folder) as temporary:
            writer(Path(temporary) / name)
            for path in sorted((Path(temporary) / name).iterdir()):
                self.write(kind, path.name, path.replace)

    def finish(self, kind: str) -> None:
        """Mark a format as complete in the list."""
        self._formats.setdefault(kind, {"files": []})["finished"] = True
        self._note()

    def _note(self) -> None:
        files.make_folder(self.folder)
        files.write_json(self.folder / LIST, {**self._head, "formats": self._formats, "written": sorted(self._written)})


def _read(path: Path) -> Any:
    """Return the list of an earlier export, read from `path`; empty: there is none."""
    try:
        data = json.loads(path.read_text())
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}
