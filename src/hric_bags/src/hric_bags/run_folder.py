"""Run folders runs/<experiment>_<date>/ with run.yaml, bag, metrics.json, figures; runs/latest is the newest run."""

import fcntl
import os
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from functools import reduce
from pathlib import Path
from typing import Any, Unpack, cast

from hric_bags import files, foreign
from hric_bags.run_file import RunFile
from hric_core.errors import HricError, failing

RUNNING, COMPLETED, INTERRUPTED, FAILED = "running", "completed", "interrupted", "failed"
STAMP = "%Y%m%d-%H%M%S"
GONE = "the process that made this run ended without closing it: it was killed, or the machine stopped"
"""Reason noted in run.yaml for a run with status `running` whose process has died."""


MAPPINGS = (
    *("definition", "definition.human", "definition.person", "definition.mocap", "definition.robot"),
    *("definition.metrics", "parameters", "parameters.robot", "parameters.robot.plant"),
)
"""Entries of run.yaml that are mappings if they are there, each after the one that contains it."""
NUMBERS = ("definition.duration", "definition.human.contact_area", "parameters.robot.plant.time_step")
"""Entries of run.yaml that are numbers above 0 if they are there: [s], [m^2] and [s]."""


class RunFolderError(HricError):
    """Error for a folder that does not exist, is not a run folder, or cannot be written."""


def runs_root(folder: str | None = None) -> Path:
    """Return the folder of all runs: `folder`, else $HRIC_RUNS, else runs/ of the workspace."""
    if folder or os.environ.get("HRIC_RUNS"):
        return Path(folder or os.environ["HRIC_RUNS"]).expanduser().absolute()
    return workspace() / "runs"


def workspace() -> Path:
    """Return the workspace folder: $HRIC_WS, else the one of this source file; the working directory for a wheel."""
    source = Path(__file__).resolve().parents[4]
    return Path(os.environ.get("HRIC_WS") or (source if (source / "scripts").is_dir() else Path.cwd()))


def iso_now() -> str:
    """Return the current UTC time as ISO 8601 text, which sorts by time."""
    return _iso(datetime.now(UTC))


def _iso(when: datetime) -> str:
    return when.isoformat(timespec="seconds").replace("+00:00", "Z")


class RunFolder:
    """Folder of one run on disk.

    The process that makes a run locks the folder until run.yaml states how the run ended; the system frees the lock if
    that process dies. A reader that finds status `running` without a lock therefore knows that the process has died,
    and notes this in run.yaml.

    Attributes:
        path: path of the folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._release: Callable[[], object] | None = None
        """Function that frees the lock; None: this object did not create the run, or the run has ended."""
        self._written: tuple[tuple[int, ...], RunFile] | None = None
        """Version and contents of run.yaml as this object wrote it last; None: it did not write it."""

    @classmethod
    def create(cls, root: Path, experiment: str, now: datetime | None = None) -> "RunFolder":
        """Create a new run folder, and lock it.

        Args:
            root: folder of all runs, made if missing.
            experiment: name of the experiment.
            now: local time for the folder's name; None: the current time.

        Raises:
            RunFolderError: the folder cannot be made.
        """
        name = f"{experiment}_{(now or datetime.now()).strftime(STAMP)}"
        try:
            root.mkdir(parents=True, exist_ok=True)
            folder = _make_unique(root, name)
        except OSError as error:
            with failing():
                raise RunFolderError(f"cannot make a run folder in {root}: {error.strerror or error}") from error
        made = cls(folder)
        if (lock := _lock(folder)) is not None:
            made._release = weakref.finalize(made, os.close, lock)
        return made

    @classmethod
    def open(cls, path: str | Path, root: Path | None = None) -> "RunFolder":
        """Return an existing run, by its path or by its name in the folder of all runs ("latest" too).

        Raises:
            RunFolderError: there is no such run; the message names the newest ones.
        """
        for candidate in (Path(path).expanduser(), (root or runs_root()) / path):
            if (candidate / "run.yaml").is_file():
                return cls(candidate.resolve())
        if kind := foreign.describe(Path(path).expanduser()):
            raise RunFolderError(kind)
        if Path(path).is_file():
            raise RunFolderError(
                f"{path} is no run folder and no bag: its content is not that of a .bag, .mcap or .db3"
            )
        base = root or runs_root()
        known = sorted(
            (item.parent.name for item in base.glob("*/run.yaml") if not item.parent.is_symlink()), reverse=True
        )[:5]
        raise RunFolderError(
            f"no run folder {str(path)!r} (a folder with run.yaml); newest in {base}: {', '.join(known) or 'none'}"
        )

    def become_latest(self) -> None:
        """Make the link `latest` in the folder of all runs point to this run."""
        files.point_link(self.path.parent / "latest", self.path.name)

    @property
    def bag_path(self) -> Path:
        """Path of the bag, whether it is recorded yet or not."""
        return self.path / f"{self.path.name}.bag"

    def bag_of(self, run: RunFile) -> Path:
        """Return the path of the bag that run.yaml names; run: contents of run.yaml.

        Raises:
            RunFolderError: the name is not that of a file in this folder.
        """
        name = str(run.get("bag", self.bag_path.name))
        if Path(name).name != name:
            raise RunFolderError(f"{self.path / 'run.yaml'}: bag is {name!r}; valid: name of a file in this folder")
        return self.path / name

    @property
    def metrics_path(self) -> Path:
        """Path of the metrics, whether they are written yet or not."""
        return self.path / "metrics.json"

    @property
    def urdf_path(self) -> Path:
        """Path of the robot's URDF, whether it is written yet or not."""
        return self.path / "robot.urdf"

    def description(self) -> str:
        """Return the robot's URDF, "" if the folder has none. Raises RunFolderError if it cannot be read."""
        try:
            return self.urdf_path.read_text() if self.urdf_path.is_file() else ""
        except OSError as error:
            raise RunFolderError(f"cannot read {self.urdf_path.name} of {self.path.name}: {error.strerror}") from error

    def write(self, data: RunFile) -> None:
        """Write run.yaml; a status other than `running` ends the run and frees its lock. Raises FileError."""
        files.write_yaml(self.path / "run.yaml", data)
        self._written = self._version(), cast(RunFile, _read_back(data))
        if data.get("status") != RUNNING and self._release is not None:
            self._release()
            self._release = None

    def read(self, gone: str = "") -> RunFile:
        """Return the contents of run.yaml; if the process of a `running` run has died, it becomes `interrupted`.

        Args:
            gone: reason to note in that case; "": the general reason `GONE`.
        """
        data = self._contents()
        if data.get("status") == RUNNING and self._release is None and (lock := _lock(self.path)) is not None:
            try:
                data = self._contents()  # read again: the run may have ended in between
                if data.get("status") == RUNNING:
                    data |= {"status": INTERRUPTED, "finished": self._last_written(), "reason": gone or GONE}
                    with suppress(HricError):  # a read-only medium can still be read
                        self.write(data)
            finally:
                os.close(lock)
        return data

    def _contents(self) -> RunFile:
        from hric_core.parameters import as_number, read_yaml  # imported here: the search for a run needs only Python

        if self._written is not None and self._written[0] and self._written[0] == self._version():
            return cast(RunFile, _read_back(self._written[1]))
        data = read_yaml(self.path / "run.yaml")
        if not isinstance(data, dict):
            raise RunFolderError(f"{self.path / 'run.yaml'} is not a mapping")
        for key in (*MAPPINGS, *NUMBERS):
            value = reduce(lambda tree, part: (tree or {}).get(part), key.split("."), cast(Any, data))
            with suppress(ValueError):
                if value is None or (isinstance(value, dict) if key in MAPPINGS else as_number(value) > 0.0):
                    continue
            raise RunFolderError(
                f"{self.path / 'run.yaml'}: {key} is {value!r}; valid: a "
                f"{'mapping' if key in MAPPINGS else 'number above 0'}"
            )
        return cast(RunFile, data)

    def _version(self) -> tuple[int, ...]:
        """Return numbers that differ for every file that replaces run.yaml; () if there is none."""
        with suppress(OSError):
            state = (self.path / "run.yaml").stat()
            return state.st_ino, state.st_mtime_ns, state.st_size
        return ()

    def _last_written(self) -> str:
        newest = max(path.lstat().st_mtime for path in (self.path, *self.path.iterdir()))
        return _iso(datetime.fromtimestamp(newest, UTC))

    def update(self, **changes: Unpack[RunFile]) -> None:
        """Change keys of run.yaml."""
        self.write({**self.read(), **changes})

    @contextmanager
    def filled(self) -> Iterator[None]:
        """Guard the execution of a run: Ctrl-C, or an error, which counts as a failure, is noted in run.yaml."""
        try:
            with failing():
                yield
        except KeyboardInterrupt:
            with suppress(HricError, OSError):
                self.update(status=INTERRUPTED, finished=iso_now())
            raise
        except BaseException as error:
            with suppress(HricError, OSError):  # disk full: the next reader notes the end of the run
                self.update(status=FAILED, finished=iso_now(), error=f"{type(error).__name__}: {error}")
            raise


def _read_back(value: Any) -> Any:
    """Return a copy of a value as it is read from the YAML file to which it was written."""
    if type(value) is dict:
        return {key: _read_back(part) for key, part in value.items()}
    return [_read_back(part) for part in value] if type(value) in (list, tuple) else value


def _lock(folder: Path) -> int | None:
    """Lock a run folder for its writer; return the descriptor, or None if it is locked or the disk has no locks."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def _make_unique(root: Path, name: str) -> Path:
    for attempt in range(1, 1000):
        folder = root / (name if attempt == 1 else f"{name}-{attempt}")
        try:
            folder.mkdir()
        except FileExistsError:
            continue
        return folder
    raise RunFolderError(f"{root} already has 999 runs named {name}")
