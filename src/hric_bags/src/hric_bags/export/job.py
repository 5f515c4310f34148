"""Formats of an export, its settings, and the writer of the formats."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

from tqdm import tqdm

from hric_bags.export import anonymous, frames, loads, opensim_formats, recording, unbatched
from hric_bags.export.lerobot import dataset
from hric_bags.export.output import ExportFolder
from hric_bags.export.table import ExportError, TopicTable
from hric_bags.export.trial import c3d_trial, trial_formats
from hric_core import plugins
from hric_core.errors import ParameterError, UnknownNameError
from hric_core.parameters import number, whole

PLAIN = ("npz", "csv", "parquet")
BAGS = ("bag", "mcap", "ros2")
"""Formats that are written message by message, and need no tables."""
RATE = 100
"""Frames per second of a LeRobot data set, if not chosen otherwise [Hz]; project default, unconfirmed."""
LEROBOT = "lerobot"
"""Format with all runs of an export in one data set."""
FORMATS = (*PLAIN, "trc", "mot", "sto", "external_loads", *trial_formats.KINDS, LEROBOT, *BAGS)
NEEDED: dict[str, tuple[str, ...]] = {
    **opensim_formats.NEEDED,
    "external_loads": loads.NEEDED,
    LEROBOT: dataset.NEEDED,
    **dict.fromkeys(trial_formats.KINDS, c3d_trial.NEEDED),
}
"""Format -> message types that it is made from; other formats need all types."""


def formats() -> tuple[str, ...]:
    """Return the names of all formats, those of other packages last."""
    return tuple(dict.fromkeys((*FORMATS, *plugins.names(plugins.EXPORT))))


@dataclass(frozen=True)
class ExportRequest:
    """Settings of an export.

    Attributes:
        formats: names of formats, each one of `formats()`.
        topics: topic names; empty: all.
        load_body: body of a model on which the plates' loads act; empty: no set-up file has them.
        surface: height of the plates' surface above their electrical origin [m].
        anonymise: further words that identify the person, for an anonymised export; None: not anonymised.
        rate: frames per second of a LeRobot data set, a whole number [Hz].
    """

    formats: Sequence[str]
    topics: tuple[str, ...] = ()
    load_body: str = ""
    surface: float = 0.0
    anonymise: tuple[str, ...] | None = None
    rate: int = RATE

    def __post_init__(self) -> None:
        for kind in self.formats:
            if kind not in formats():
                raise UnknownNameError("format", kind, formats())
        number(minimum=-0.5, maximum=0.5, unit="m").checked(self.surface, "--surface")
        if self.surface and not {"external_loads", "c3d", "xdf"} & set(self.formats):
            raise ParameterError("--surface has no effect; valid: with --format external_loads, c3d or xdf")
        if self.load_body and "external_loads" not in self.formats:
            raise ParameterError("--load-body has no effect; valid: with --format external_loads")
        if self.rate != RATE and LEROBOT not in self.formats:
            raise ParameterError("--rate has no effect; valid: with --format lerobot")
        whole(minimum=1, unit="Hz").checked(self.rate, "--rate")


@dataclass(frozen=True)
class ExportJob:
    """Writer of the formats of one export.

    notes: list to which sentences for the user are added; others: bags of further episodes of a LeRobot data set.
    """

    source: recording.ExportSource
    request: ExportRequest
    output: ExportFolder
    tables: dict[str, TopicTable]
    notes: list[str]
    progress: bool
    anonymiser: anonymous.Anonymiser | None
    others: Sequence[recording.ExportSource]

    def write(self, kind: str) -> bool:
        """Write a format; return False if there is nothing to write."""
        match kind:
            case "bag":
                self.output.write(kind, f"{self._stem}_samples.bag", self._write_bag)
            case "mcap" | "ros2":
                self._write_ros2(kind)
            case "lerobot":
                self._write_episodes(kind)
            case "sto":
                what = "joint states, a control log, chunks of samples, synchronised samples or wrenches"
                self._write_each(kind, self._need(kind, what, opensim_formats.is_signal), opensim_formats.write_signals)
            case "mot":
                joints = self._need(kind, "joint states or a control log", opensim_formats.is_joints)
                self._write_each(kind, joints, opensim_formats.write_coordinates)
            case "trc":
                captures = self._need(kind, "motion capture (hric_msgs/MocapData)", opensim_formats.is_capture)
                self._write_each(kind, captures, self._write_markers)
            case "c3d" | "bids" | "xdf":
                self._write_trial(kind)
            case "external_loads":
                return self._write_loads()
            case _:
                from hric_bags.export import plain_formats

                writer = plain_formats.WRITERS.get(kind) or plugins.find(plugins.EXPORT, kind)().write
                self._write_each(kind, list(self.tables.values()), writer)
        return True

    @property
    def _frames(self) -> frames.FixedFrames:
        return frames.of_run(self.source.urdf, self.tables, self.source.run)

    def _need(self, kind: str, what: str, suits: Callable[[TopicTable], bool]) -> list[TopicTable]:
        chosen = [table for table in self.tables.values() if suits(table)]
        if not chosen:
            with recording.open_reader(self.source) as reader:
                topics = ", ".join(sorted(reader.topics))
            raise ExportError(
                f"format {kind} needs {what}, among the requested topics; the bag has: {topics or 'nothing'}"
            )
        return chosen

    def _write_each(self, kind: str, tables: list[TopicTable], write: Callable[[TopicTable, Path], None]) -> None:
        for table in tqdm(tables, unit=" topics", desc=kind, disable=not self.progress, leave=False):
            self.output.write(kind, f"{table.name}.{kind}", partial(write, table))

    @property
    def _stem(self) -> str:
        """File name, without extension, of files that are named after the bag."""
        return self.source.bag.stem if self.anonymiser is None else anonymous.NAME

    @property
    def _run_stem(self) -> str:
        """File name, without extension, of files that are named after the run."""
        folder = self.source.folder if self.anonymiser is None else None
        return self._stem if folder is None else folder.path.name

    @cached_property
    def _trial(self) -> c3d_trial.C3dTrial:
        """Markers, force plates and EMG on one time grid."""
        return c3d_trial.collect(self.tables, self._frames, self.source.run, self.request.surface)

    def _write_bag(self, path: Path) -> None:
        unbatched.write(self.source, path, self.request.topics, progress=self.progress, anonymous=self.anonymiser)

    def _write_ros2(self, kind: str) -> None:
        def write(folder: Path) -> None:
            topics = self.request.topics
            unbatched.write_ros2(self.source, folder, kind, topics, progress=self.progress, anonymous=self.anonymiser)

        self.output.write_all(kind, self._stem, write)

    def _write_episodes(self, kind: str) -> None:
        episodes = dataset.read(self.tables, self.source.run, self.others, self.request.rate)
        for name, writer in dataset.files(episodes, self.request.rate).items():
            self.output.write(kind, name, writer)
        pictures = {topic for each in (self.source, *self.others) for topic in recording.pictures(each)}
        notes = [*dataset.notes(episodes), *(f"pictures of {topic} are left out" for topic in sorted(pictures))]
        self.notes.extend(f"lerobot: {note}" for note in notes)

    def _write_markers(self, table: TopicTable, path: Path) -> None:
        markers = trial_formats.with_own_labels(opensim_formats.markers_of(table, self._frames), self.source.run)
        opensim_formats.write_markers(markers, path, f"{table.name}.trc")

    def _write_trial(self, kind: str) -> None:
        run = self.source.run
        started = str(run.get("started") or "") if self.anonymiser is None else ""
        for name, writer in trial_formats.trial_files(kind, self._trial, run, self._run_stem, started).items():
            self.output.write(kind, name, writer)
        if kind == "c3d":
            self.notes.append(f"c3d: {c3d_trial.describe(self._trial)}")

    def _write_loads(self) -> bool:
        plates = [table for table in self.tables.values() if opensim_formats.is_plate(table)]
        grips = [table for table in self.tables.values() if table.type_name == loads.GRIP]
        request = self.request
        all_loads = [loads.of_plate(table, self._frames, request.load_body, request.surface) for table in plates]
        all_loads += [load for table in grips for load in loads.of_grips(table, self._frames)]
        if not all_loads:
            self.notes.append(f"external_loads: {loads.NOTHING}")
            return False
        name, source = "external_loads", " ".join(table.topic for table in (*plates, *grips))
        self.output.write(name, f"{name}.mot", lambda path: loads.write(all_loads, path, source))
        if bodies := {load.name: load.body for load in all_loads if load.body}:
            setup = loads.setup(bodies, f"{name}.mot")
            self.output.write(name, f"{name}.xml", lambda path: path.write_text(setup))
        return True
