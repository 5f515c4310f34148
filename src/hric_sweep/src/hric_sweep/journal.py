"""Journal of a sweep: one line of JSON per finished run, written to disk before the run counts as finished.

The file survives a crash at any byte: an incomplete last line is dropped when the journal is opened again.
"""

import fcntl
import json
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType

from hric_core.errors import NOT_GOOD, HricError
from hric_sweep.records import RunResponse

NAME = "runs.jsonl"


class JournalError(HricError):
    """Error: the journal cannot be written, or another program uses it."""

    exit_code = NOT_GOOD


class Journal(AbstractContextManager["Journal"]):
    """Append-only file of responses, locked for one program at a time.

    Args:
        path: run folder of the sweep, in which the file is `NAME`; or path of the file.

    Attributes:
        path: path of the file.
        entries: all responses, in the order in which they were written, including those of earlier sessions.

    Raises:
        JournalError: the file cannot be opened, or another sweep has it open.
        HricError: a line before the last one is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path / NAME if path.is_dir() else path
        try:
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise JournalError(f"cannot open {self.path}: {error.strerror}") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._file)
            raise JournalError(
                f"another program writes {self.path}; valid: wait until that program has ended"
            ) from error
        content = self.path.read_bytes() if self.path.is_file() else b""  # a device file has no content to read
        self._size = content.rfind(b"\n") + 1
        if self._size < len(content):
            os.ftruncate(self._file, self._size)
        os.lseek(self._file, self._size, os.SEEK_SET)
        self.entries = parse(content[: self._size], self.path)

    def append(self, entries: Sequence[RunResponse]) -> None:
        """Append responses; they are on the disk when the call returns.

        Raises:
            JournalError: the responses cannot be written; the journal is unchanged.
        """
        lines = b"".join(json.dumps(vars(entry)).encode() + b"\n" for entry in entries)
        try:
            written = 0
            while written < len(lines):
                written += os.write(self._file, lines[written:])
            os.fsync(self._file)
        except OSError as error:
            self._restore()
            raise JournalError(
                f"cannot write {self.path}: {error.strerror}. {len(self.entries)} finished runs are stored; only the "
                f"last {len(entries)} are lost. Free some disk space"
            ) from error
        self._size += len(lines)
        self.entries += entries

    def _restore(self) -> None:
        """Truncate the file to its complete entries after a failed write."""
        try:
            os.ftruncate(self._file, self._size)
            os.lseek(self._file, self._size, os.SEEK_SET)
        except OSError:  # the incomplete line is dropped when the journal is opened again
            return

    def close(self) -> None:
        """Close the file and release the lock."""
        os.close(self._file)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def parse(content: bytes, path: Path) -> list[RunResponse]:
    """Return the responses in the complete lines of a journal.

    Raises:
        HricError: a line is damaged, or a different version wrote it.
    """
    entries = []
    for number, line in enumerate(content.splitlines(), 1):
        try:
            entries.append(RunResponse(**json.loads(line)))
        except (ValueError, TypeError):
            raise HricError(f"{path}, line {number} is damaged; valid: the lines that a sweep wrote") from None
    return entries
