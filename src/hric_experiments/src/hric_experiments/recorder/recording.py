"""One recording: a run folder, the parts of its bag, each written by a `bag_recorder` of its own, and the room on the
disk."""

import contextlib
import os
import time
from collections.abc import Callable
from pathlib import Path

from hric_bags.files import MEGABYTE
from hric_bags.run_folder import FAILED, RunFolder, iso_now
from hric_core.errors import FailureError, HricError
from hric_experiments.recorder.process import STOP_TIMEOUT, RecorderProcess, RecordError

SPLIT_TIMEOUT = 20.0
"""How long the recorder of the next part may take to subscribe to all that the one before it receives [s]."""
OVERLAP = 0.2
"""Both record for so long when both receive all: what was under way to the first one only arrives meanwhile; project
default, unconfirmed [s]."""
_POLL = 0.05
Start = Callable[[Path, int], RecorderProcess]
"""Starts the recorder of a part: its bag, the number of the part."""
Missing = Callable[[int, int], set[str]]
"""Topics that the recorder of the second part receives and that of the first does not."""


class DiskFullError(FailureError):
    """Too little room to record."""


def free_space(path: Path) -> float:
    """Room on the disk of `path`, or of the nearest folder above it that exists [MB].

    Raises:
        DiskFullError: it cannot be found out.
    """
    while not path.exists() and path != path.parent:
        path = path.parent
    try:
        state = os.statvfs(path)
    except OSError as error:
        raise DiskFullError(f"cannot tell the free space of {path}: {error.strerror or error}") from error
    return state.f_bavail * state.f_frsize / MEGABYTE


def check_space(path: Path, limit: float) -> None:
    """Refuse a recording that would be ended at once.

    Args:
        path: where it is to go.
        limit: room that must be there [MB].

    Raises:
        DiskFullError: there is less.
    """
    left = free_space(path)
    if left < limit:
        raise DiskFullError(
            f"only {left:.0f} MB are free where recordings go ({path}), fewer than the limit min_free of "
            f"{limit:.0f} MB: make room, "
            "choose another folder (HRIC_RUNS), lower the limit, or record:=false"
        )


class Recording:
    """A bag in one or more parts. Not thread-safe.

    The bag of one part has the name of the run folder; with the first split it becomes `..._0.bag`, and `..._1.bag`
    follows. Where two parts meet they overlap: what one recorder received is not lost.

    Args:
        folder: where to.
        start: starts the recorder of a part.
        missing: what the recorder of one part receives and that of another does not yet.
    """

    def __init__(self, folder: RunFolder, start: Start, missing: Missing) -> None:
        self.folder = folder
        self._start, self._missing = start, missing
        self._part_began = time.monotonic()
        self._parts: list[RecorderProcess] = [start(folder.bag_path, 0)]

    @property
    def bag(self) -> Path:
        """The bag, or its first part."""
        return self._parts[0].bag

    @property
    def part(self) -> RecorderProcess:
        """The part that is being written."""
        return self._parts[-1]

    @property
    def parts(self) -> int:
        """How many there are."""
        return len(self._parts)

    @property
    def part_size(self) -> int:
        """Of the part that is being written [B]."""
        try:
            return self.part.active.stat().st_size
        except FileNotFoundError:
            return 0

    @property
    def part_age(self) -> float:
        """Since the part that is being written began [s of wall time]."""
        return time.monotonic() - self._part_began

    def split(self, timeout: float = SPLIT_TIMEOUT, give_up: Callable[[], bool] = lambda: False) -> Path:
        """Begin the next part; when its recorder receives all that the one before it does, close that one.

        Args:
            timeout: how long that may take [s].
            give_up: whether the wait is to end now, because of a shutdown.

        Returns:
            the closed part.

        Raises:
            RecordError: it takes longer; the recording goes on in the part that it had.
        """
        old, began = self.part, time.monotonic()
        new = self._start(self._name(self.parts), self.parts)
        self._parts.append(new)
        self._note()
        try:
            new.wait_open(timeout, give_up)
            self._wait_subscribed(began + timeout, timeout, give_up)
        except RecordError:
            self._abandon(new)
            raise
        time.sleep(OVERLAP)
        self._part_began = time.monotonic()
        old.stop()
        self._name_first()
        return old.bag

    def stop(self, timeout: float = STOP_TIMEOUT) -> Path:
        """Close what is open. Returns the bag, or its first part.

        Raises:
            RecordError: a bag could not be closed.
        """
        deadline = time.monotonic() + timeout
        for part in self._parts:
            part.interrupt()
        for part in self._parts[:]:
            try:
                part.stop(max(deadline - time.monotonic(), _POLL))
            except RecordError:
                if part is self._parts[0] or part.bag.exists() or part.active.exists():
                    raise
                self._parts.remove(part)  # ended before it had begun
                self._note()
        if self.parts > 1:
            self._name_first()
        return self.bag

    def finish(self, status: str, **notes: object) -> None:
        """Note in run.yaml how the run ended."""
        self.folder.update(status=status, finished=iso_now(), **notes)

    def fail(self, error: str) -> None:
        """Note that the run failed; where there is no room for that, whoever reads it next notes that it is over."""
        with contextlib.suppress(HricError):
            self.finish(FAILED, error=error)

    def _wait_subscribed(self, deadline: float, timeout: float, give_up: Callable[[], bool]) -> None:
        while not give_up() and (missing := self._missing(self.parts - 1, self.parts - 2)):
            if time.monotonic() > deadline:
                raise RecordError(
                    f"the next part did not subscribe to {', '.join(sorted(missing))} within {timeout:g} s; all goes "
                    "on in the part before it"
                )
            time.sleep(_POLL)

    def _abandon(self, part: RecorderProcess) -> None:
        with contextlib.suppress(RecordError):
            part.stop()
        part.bag.unlink(missing_ok=True)
        part.active.unlink(missing_ok=True)
        self._parts.remove(part)
        self._note()

    def _name(self, number: int) -> Path:
        return self.folder.path / f"{self.folder.bag_path.stem}_{number}.bag"

    def _name_first(self) -> None:
        """Give the first part its number; at every moment the bag that run.yaml names is there."""
        first, named = self._parts[0], self._name(0)
        if first.bag == named or not first.bag.exists():
            return
        before = first.bag
        os.link(before, named)
        first.bag = named
        self._note()
        before.unlink()

    def _note(self) -> None:
        names = [part.bag.name for part in self._parts]
        self.folder.update(bag=names[0], bags=names)
