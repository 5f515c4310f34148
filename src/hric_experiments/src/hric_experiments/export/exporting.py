"""One export: which formats, into which folder; what is there already is left alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tqdm import tqdm

from hric_control.errors import HricError, UnknownNameError
from hric_experiments.export import batches, c3d_trial, frames, opensim_formats, recording, unbatched
from hric_experiments.export.output import Output
from hric_experiments.export.recording import Source
from hric_experiments.export.table import ExportError, Table

PLAIN = ("npz", "csv", "parquet")
FORMATS = (*PLAIN, "trc", "mot", "sto", "external_loads", "c3d", "bag")
NEEDED: dict[str, tuple[str, ...]] = {
    "trc": (opensim_formats.MOCAP_TYPE, frames.STATIC),
    "mot": (batches.CONTROL_LOG, opensim_formats.JOINTS_TYPE),
    "sto": (*opensim_formats.SIGNALS, batches.LAYOUT),
    "external_loads": (batches.CHUNK, frames.STATIC),
    "c3d": (opensim_formats.MOCAP_TYPE, batches.CHUNK, frames.STATIC, c3d_trial.TRIGGER_TYPE, c3d_trial.PHASE_TYPE),
}
"""Message types that a format needs; other formats need all."""


@dataclass(frozen=True)
class Request:
    """What is wanted.

    Attributes:
        formats: some of FORMATS.
        topics: names; empty: all.
        load_body: body of a model that the plates' loads act on; empty: no set-up file for them.
        surface: height of the plates' surface over their electrical origin [m].
    """

    formats: Sequence[str]
    topics: tuple[str, ...] = ()
    load_body: str = ""
    surface: float = 0.0

    def __post_init__(self) -> None:
        for kind in self.formats:
            if kind not in FORMATS:
                raise UnknownNameError("format", kind, FORMATS)


@dataclass
class Result:
    """What was done.

    Attributes:
        files: per format, those that are there now.
        seconds: per format, what writing took, without reading the bag (but for "bag") [s]; absent: it was there already.
        reading: what reading the bag into tables took [s].
        notes: lines that tell how a format was made, or why there was nothing to write.
        failures: per format that could not be written, why: one line.
    """

    files: dict[str, list[Path]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    reading: float = 0.0
    notes: list[str] = field(default_factory=list)
    failures: dict[str, str] = field(default_factory=dict)


def export(source: Source, request: Request, folder: Path | None = None, *, again: bool = False, progress: bool = False) -> Result:
    """Write the formats that are not there yet; one that cannot be written does not keep the others from it.

    Args:
        source: see `recording.find`.
        request: what is wanted.
        folder: where to; default: `export` in the run folder, or `<bag>_export` beside a bag.
        again: write also what is there.
        progress: whether to draw bars.

    Raises:
        HricError: the bag is damaged, or has no such topic.
    """
    told = {"topics": sorted(request.topics), "load_body": request.load_body, "surface": request.surface}
    output = Output(folder or source.output, source.bags, told, again=again)
    result = Result()
    tables: dict[str, Table] | None = None
    for kind in request.formats:
        if (done := output.done(kind)) is not None:
            result.files[kind] = done
            continue
        if tables is None and kind != "bag":
            begin = time.perf_counter()
            tables = recording.read(source, request.topics, progress=progress, types=_types(output, request))
            result.reading = time.perf_counter() - begin
        begin = time.perf_counter()
        try:
            if _write(kind, source, request, tables or {}, output, progress, result.notes):
                result.files[kind] = output.finish(kind)
                result.seconds[kind] = time.perf_counter() - begin
        except Exception as error:  # also of a library that one format needs: the others do not
            text = " ".join(str(error).split())
            result.failures[kind] = text if isinstance(error, HricError) else f"{type(error).__name__}: {text}"
    return result


def _types(output: Output, request: Request) -> tuple[str, ...]:
    """Message types that are to be read; empty: all."""
    open_ = [kind for kind in request.formats if kind != "bag" and output.done(kind) is None]
    return () if set(open_) & set(PLAIN) else tuple(name for kind in open_ for name in NEEDED[kind])


def _write(kind: str, source: Source, request: Request, tables: dict[str, Table], output: Output, progress: bool, notes: list[str]) -> bool:
    """Whether there was something to write; notes: what else is to be told."""
    if kind == "bag":
        with output.file(kind, f"{source.bag.stem}_samples.bag") as path:
            if path is not None:
                unbatched.write(source, path, request.topics, progress=progress)
    elif kind in PLAIN:
        from hric_experiments.export import plain_formats

        _each(kind, list(tables.values()), plain_formats.WRITERS[kind], output, progress)
    elif kind == "sto":
        signals = [table for table in tables.values() if opensim_formats.is_signal(table)]
        _need(signals, kind, "joint states, a control log, chunks of samples, synchronised samples or wrenches", source)
        _each(kind, signals, opensim_formats.write_signals, output, progress)
    elif kind == "mot":
        joints = [table for table in tables.values() if opensim_formats.is_joints(table)]
        _need(joints, kind, "joint states or a control log", source)
        _each(kind, joints, opensim_formats.write_coordinates, output, progress)
    elif kind == "trc":
        _markers(source, tables, output)
    elif kind == "c3d":
        _c3d(source, request, tables, output, notes)
    else:
        return _loads(source, request, tables, output, notes)
    return True


def _each(kind: str, tables: list[Table], write: Callable[[Table, Path], None], output: Output, progress: bool) -> None:
    for table in tqdm(tables, unit=" topics", desc=kind, disable=not progress, leave=False):
        with output.file(kind, f"{table.name}.{kind}") as path:
            if path is not None:
                write(table, path)


def _markers(source: Source, tables: dict[str, Table], output: Output) -> None:
    captures = [table for table in tables.values() if table.type_name == opensim_formats.MOCAP_TYPE]
    _need(captures, "trc", "motion capture (hric_msgs/MocapData)", source)
    known = frames.of_run(source.urdf, tables, source.run)
    for table in captures:
        with output.file("trc", f"{table.name}.trc") as path:
            if path is not None:
                opensim_formats.write_markers(opensim_formats.markers_of(table, known), path, f"{table.name}.trc")


def _c3d(source: Source, request: Request, tables: dict[str, Table], output: Output, notes: list[str]) -> None:
    from hric_experiments.export import c3d_format

    trial = c3d_trial.collect(tables, frames.of_run(source.urdf, tables, source.run), source.run, request.surface)
    stem = source.bag.stem if source.folder is None else source.folder.path.name
    pieces = list(c3d_format.parts(trial))
    for number, piece in enumerate(pieces, 1):
        with output.file("c3d", f"{stem}_{number}.c3d" if len(pieces) > 1 else f"{stem}.c3d") as path:
            if path is not None:
                c3d_format.write(piece, path, str(source.run.get("started") or ""))
    notes.append(f"c3d: {c3d_trial.told(trial)}")


def _loads(source: Source, request: Request, tables: dict[str, Table], output: Output, notes: list[str]) -> bool:
    plates = [table for table in tables.values() if opensim_formats.is_plate(table)]
    if not plates:
        notes.append(f"external_loads: no force plate among the topics ({batches.CHUNK} with {' '.join(opensim_formats.CHANNELS)}), nothing to write")
        return False
    known = frames.of_run(source.urdf, tables, source.run)
    with output.file("external_loads", "external_loads.mot") as path:
        if path is not None:
            opensim_formats.write_loads(plates, known, path, request.surface)
    if request.load_body:
        with output.file("external_loads", "external_loads.xml") as path:
            if path is not None:
                path.write_text(opensim_formats.loads_setup(plates, request.load_body, "external_loads.mot"))
    return True


def _need(found: list[Table], kind: str, what: str, source: Source) -> None:
    if not found:
        with recording.open_reader(source) as reader:
            topics = sorted(reader.topics)
        raise ExportError(f"format {kind} needs {what}, among the topics asked for; the bag has: {', '.join(topics) or 'nothing'}")
