"""Journal of a sweep: one line of JSON for each finished run, written to disk before the run counts.

It may be cut off at any byte: an incomplete last line is dropped when the journal is opened again.
"""

import errno
import fcntl
import json
import os
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from hric_core.errors import HricError

NAME = "runs.jsonl"
UNFINISHED_CODE = 3
"""Exit code of a sweep in which runs failed, or which could not continue; finished runs are stored."""


class JournalError(HricError):
    """Error: the journal cannot be written, or another program uses it."""

    exit_code = UNFINISHED_CODE


class Journal:
    """Append-only file of responses, locked for one supervisor at a time.

    Args:
        folder: run folder of the sweep.

    Attributes:
        entries: all entries, in the order in which they were written, including those of earlier sessions.

    Raises:
        JournalError: the file cannot be opened, or another sweep has it open.
        HricError: a line before the last one is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        try:
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise JournalError(f"cannot open {self.path}: {error.strerror}") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._file)
            raise JournalError(f"another program runs the sweep in {folder}; valid: wait for its end") from error
        content = self.path.read_bytes() if self.path.is_file() else b""  # a device file has no content to read
        self._size = content.rfind(b"\n") + 1
        if self._size < len(content):
            os.ftruncate(self._file, self._size)
        os.lseek(self._file, self._size, os.SEEK_SET)
        self.entries = parse(content[: self._size], self.path)

    def append(self, entries: Sequence[dict[str, Any]]) -> None:
        """Append entries; when the call returns they are on the disk.

        Raises:
            JournalError: they cannot be written; the journal is unchanged.
        """
        lines = b"".join(json.dumps(entry).encode() + b"\n" for entry in entries)
        try:
            written = 0
            while written < len(lines):
                written += os.write(self._file, lines[written:])
            os.fsync(self._file)
        except OSError as error:
            self._restore()
            full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
            why = "there is no space left" if full else error.strerror
            raise JournalError(
                f"cannot write {self.path}: {why}; {len(self.entries)} runs are kept there, and no other is lost but "
                f"what just ended ({len(entries)}); make space, then: rosrun hric_experiments sweep --resume "
                f"{self.path.parent}"
            ) from error
        self._size += len(lines)
        self.entries += entries

    def _restore(self) -> None:
        """Remove the part of the entries that was already written."""
        try:
            os.ftruncate(self._file, self._size)
            os.lseek(self._file, self._size, os.SEEK_SET)
        except OSError:  # the incomplete line is dropped when the journal is opened again
            return

    def close(self) -> None:
        """Close the file and release the lock."""
        os.close(self._file)

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def parse(content: bytes, path: Path) -> list[dict[str, Any]]:
    """Return the entries of complete lines.

    Raises:
        HricError: a line is not valid JSON.
    """
    found = []
    for number, line in enumerate(content.splitlines(), 1):
        try:
            found.append(json.loads(line))
        except ValueError:
            raise HricError(f"{path}, line {number} is damaged; valid: the lines that a sweep wrote") from None
    return found
