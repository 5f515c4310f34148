"""Guards the disk that a recording goes to: it is ended while there is still room to end it well."""

from __future__ import annotations

import os
from pathlib import Path

from hric_control.errors import HricError

MIN_FREE = 1024.0
"""Below this a recording is ended: what the recorder holds in memory must find room, and the report [MB]."""
MEGABYTE = 1e6
"""[B]"""


class DiskFullError(HricError):
    """Too little room to record."""


def free(path: Path) -> float:
    """Room on the disk of `path`, or of the nearest folder above it that exists [MB].

    Raises:
        DiskFullError: the disk does not answer.
    """
    while not path.exists() and path != path.parent:
        path = path.parent
    try:
        state = os.statvfs(path)
    except OSError as error:
        raise DiskFullError(f"cannot tell the free space of {path}: {error.strerror or error}") from error
    return state.f_bavail * state.f_frsize / MEGABYTE


def check(path: Path, limit: float) -> None:
    """Refuse a recording that would be ended at once.

    Args:
        path: where it is to go.
        limit: room that must be there [MB].

    Raises:
        DiskFullError: there is less.
    """
    left = free(path)
    if left < limit:
        raise DiskFullError(
            f"only {left:.0f} MB are free where recordings go ({path}), fewer than the limit min_free of {limit:.0f} MB: make room, "
            "choose another folder (HRIC_RUNS), lower the limit, or record:=false"
        )
