"""Recording of a bag in parts into a run folder, with one process `bag_recorder` per part; free disk space."""

import contextlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Unpack

from hric_bags.files import MEGABYTE
from hric_bags.run_file import RunNotes
from hric_bags.run_folder import FAILED, RunFolder, iso_now
from hric_core.errors import FailureError, HricError
from hric_experiments.recorder.process import STOP_TIMEOUT, RecorderProcess, RecordError

SPLIT_TIMEOUT = 20.0
"""Maximum time for the next part's bag_recorder to subscribe to all topics of the previous part [s]."""
OVERLAP = 0.2
"""Time for which two parts are recorded at once after both have subscribed [s], so that messages already on the way to
the first one alone are still recorded; project default, unconfirmed."""
_POLL = 0.05
Start = Callable[[Path, int], RecorderProcess]
"""Function of (path of the bag, number of the part) that starts bag_recorder for a part."""
Missing = Callable[[int, int], set[str]]
"""Function of two part numbers (new, old) that returns the topics received only for the old part."""


class DiskFullError(FailureError):
    """Error: there is too little free disk space to record."""


def free_space(path: Path) -> float:
    """Return the free space on the disk of `path`, or of its nearest existing parent folder [MB].

    Raises:
        DiskFullError: the free space cannot be determined.
    """
    while not path.exists() and path != path.parent:
        path = path.parent
    try:
        state = os.statvfs(path)
    except OSError as error:
        raise DiskFullError(f"cannot determine the free disk space of {path}: {error.strerror or error}") from error
    return state.f_bavail * state.f_frsize / MEGABYTE


def check_space(path: Path, limit: float) -> None:
    """Check that there is enough free space to start a recording.

    Args:
        path: target folder.
        limit: required free space [MB].

    Raises:
        DiskFullError: there is less free space.
    """
    left = free_space(path)
    if left < limit:
        raise DiskFullError(
            f"only {left:.0f} MB are free in the folder for recordings ({path}), less than the limit min_free of "
            f"{limit:.0f} MB; free some space, "
            "choose another folder (HRIC_RUNS), lower the limit, or set record:=false"
        )


class BagWriting:
    """Recording of a bag in one or more parts; not thread-safe.

    A bag with one part has the name of the run folder; at the first split it is renamed to `..._0.bag`, and `..._1.bag`
    follows. Successive parts overlap in time, so that no message is lost.

    Args:
        folder: run folder.
        start: function that starts bag_recorder for a part.
        missing: function that returns the topics that are not yet recorded in a new part.
    """

    def __init__(self, folder: RunFolder, start: Start, missing: Missing) -> None:
        self.folder = folder
        self._start, self._missing = start, missing
        self._part_began = time.monotonic()
        self._parts: list[RecorderProcess] = [start(folder.bag_path, 0)]

    @property
    def bag(self) -> Path:
        """Path of the bag, or of its first part."""
        return self._parts[0].bag

    @property
    def part(self) -> RecorderProcess:
        """Process that records the current part."""
        return self._parts[-1]

    @property
    def parts(self) -> int:
        """Number of parts so far."""
        return len(self._parts)

    @property
    def part_size(self) -> int:
        """Size of the current part [B]."""
        try:
            return self.part.active.stat().st_size
        except FileNotFoundError:
            return 0

    @property
    def part_age(self) -> float:
        """Duration of the current part so far [s of wall time]."""
        return time.monotonic() - self._part_began

    def split(self, timeout: float = SPLIT_TIMEOUT, give_up: Callable[[], bool] = lambda: False) -> Path:
        """Start the next part; close the previous one after the new process has subscribed to all its topics.

        Args:
            timeout: maximum time until all topics are subscribed [s].
            give_up: function that returns True to end the wait early, at shutdown.

        Returns:
            Path of the closed part.

        Raises:
            RecordError: the timeout has passed; the recording continues in the previous part.
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
        """Close all parts; return the path of the bag or of its first part.

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
                self._parts.remove(part)  # this process ended before it opened its bag
                self._note()
        if self.parts > 1:
            self._name_first()
        return self.bag

    def finish(self, status: str, **notes: Unpack[RunNotes]) -> None:
        """Write status, end time and further notes to run.yaml."""
        self.folder.update(status=status, finished=iso_now(), **notes)

    def fail(self, error: str) -> None:
        """Write to run.yaml that the run failed; without effect if the disk is full."""
        with contextlib.suppress(HricError):
            self.finish(FAILED, error=error)

    def _wait_subscribed(self, deadline: float, timeout: float, give_up: Callable[[], bool]) -> None:
        while not give_up() and (missing := self._missing(self.parts - 1, self.parts - 2)):
            if time.monotonic() > deadline:
                raise RecordError(
                    f"the next part did not subscribe to {', '.join(sorted(missing))} within {timeout:g} s; the "
                    "recording continues in the previous part"
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
        """Rename the first part to its numbered name; the bag that run.yaml names exists at any moment."""
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
