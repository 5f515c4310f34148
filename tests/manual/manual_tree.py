"""Restoration of the workspace after a page: files that the page made are moved away, never deleted."""

import shutil
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

USUAL = ("my_study", "src/my_controller")
"""Files and folders that commands of several pages make."""


class TreeError(Exception):
    """Error of a workspace in which a page cannot run, or in which it changed other files."""


@contextmanager
def kept_clean(root: Path, moved_to: Path, written: Iterable[str] = ()) -> Iterator[None]:
    """Context in which a page may run in the workspace.

    Args:
        root: workspace, a git clone.
        moved_to: folder to which files made by the page are moved: run folders, and files that git does not ignore.
        written: files that the page writes.

    Raises:
        TreeError: a file that the page would make already exists, or a tracked file was changed.
    """
    if there := [name for name in (*USUAL, *written) if (root / name).exists()]:
        raise TreeError(f"in {root}, move away first: {', '.join(there)}")
    changed, untracked = _changed(root), _untracked(root)
    runs = root / "runs"
    before, latest = _entries(runs), _target(runs / "latest")
    try:
        yield
    finally:
        for name in sorted(_untracked(root) - untracked):
            _move(root / name, moved_to / name)
        for run in _entries(runs) - before:
            _move(run, moved_to / "runs" / run.name)
        _point(runs / "latest", latest)
    if found := _changed(root) ^ changed:
        raise TreeError(f"the page changed files of the workspace: {', '.join(sorted(found))}")


def _status(root: Path) -> list[tuple[str, str]]:
    """Return git status and path of all changes; a new folder is one entry."""
    command = ["git", "status", "--porcelain", "-z", "--no-renames", "--untracked-files=normal"]
    told = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout
    return [(entry[:2], entry[3:].rstrip("/")) for entry in told.split("\0") if entry]


def _changed(root: Path) -> set[str]:
    return {path for status, path in _status(root) if status != "??"}


def _untracked(root: Path) -> set[str]:
    return {path for status, path in _status(root) if status == "??"}


def _entries(runs: Path) -> set[Path]:
    return {entry for entry in runs.glob("*") if not entry.is_symlink()}


def _target(link: Path) -> Path | None:
    return link.readlink() if link.is_symlink() else None


def _point(link: Path, target: Path | None) -> None:
    link.unlink(missing_ok=True)
    if target:
        link.symlink_to(target)


def _move(what: Path, where: Path) -> None:
    where.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(what, where)
