"""The journal of a sweep: a line of JSON for each run that has ended, on the disk before it counts.

It may be cut off at any byte: a last line that is not whole is dropped when it is opened again.
"""

import errno
import fcntl
import json
import os
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from hric_core.errors import NOT_GOOD, HricError

NAME = "runs.jsonl"


class JournalError(HricError):
    """The journal cannot be written, or it is another program's at the moment."""

    exit_code = NOT_GOOD


class Journal:
    """Appends to the journal, one supervisor at a time.

    Args:
        folder: of the sweep.

    Attributes:
        entries: of before, in the order in which they were written.

    Raises:
        JournalError: it cannot be opened, or another sweep has it open.
        HricError: a line in its middle is damaged.
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
        content = self.path.read_bytes() if self.path.is_file() else b""  # not of a device
        self._size = content.rfind(b"\n") + 1
        if self._size < len(content):
            os.ftruncate(self._file, self._size)
        os.lseek(self._file, self._size, os.SEEK_SET)
        self.entries = parse(content[: self._size], self.path)

    def append(self, entries: Sequence[dict[str, Any]]) -> None:
        """Add lines; they are on the disk afterwards.

        Raises:
            JournalError: they cannot be written; the journal is as before.
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
                f"what just ended ({len(entries)}); make space, then: hric sweep --resume "
                f"{self.path.parent}"
            ) from error
        self._size += len(lines)
        self.entries += entries

    def _restore(self) -> None:
        """Take back what was written of them."""
        try:
            os.ftruncate(self._file, self._size)
            os.lseek(self._file, self._size, os.SEEK_SET)
        except OSError:  # the next who opens it drops the piece
            return

    def close(self) -> None:
        """Let others open it."""
        os.close(self._file)

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def parse(content: bytes, path: Path) -> list[dict[str, Any]]:
    """The entries of whole lines.

    Raises:
        HricError: a line that is none.
    """
    found = []
    for number, line in enumerate(content.splitlines(), 1):
        try:
            found.append(json.loads(line))
        except ValueError:
            raise HricError(f"{path}, line {number} is damaged; valid: the lines that a sweep wrote") from None
    return found
