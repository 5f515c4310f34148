"""Export of a bag in several formats into a folder; files that exist already are not written again."""

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from hric_bags import files
from hric_bags.export import recording
from hric_bags.export.anonymous import Anonymiser
from hric_bags.export.job import BAGS, LEROBOT, NEEDED, ExportJob, ExportRequest
from hric_bags.export.output import ExportFolder
from hric_bags.export.table import ExportError, TopicTable
from hric_core.errors import HricError, ParameterError


@dataclass
class ExportResult:
    """Outcome of an export.

    Attributes:
        files: files of each format, written now or before.
        seconds: time to write each format [s], for BAGS with reading the bag; absent: the format existed already.
        reading: time to read the bag into tables [s].
        notes: sentences on how a format was made, or why there was nothing to write.
        failures: reason why a format could not be written, by format.
    """

    files: dict[str, list[Path]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    reading: float = 0.0
    notes: list[str] = field(default_factory=list)
    failures: dict[str, str] = field(default_factory=dict)


ABOUT = "about"
"""Subfolder of an anonymised export with run.yaml, metrics.json and the list of what was changed."""


def default_folder(source: recording.ExportSource, request: ExportRequest) -> Path:
    """Return the default folder of an export.

    Raises:
        ExportError: a bag without a run folder is to be anonymised, but its name may identify person and date.
    """
    if request.anonymise is None:
        return source.output
    if source.folder is None:
        raise ExportError(
            f"--anonymise of a bag needs --output DIR: the name {source.bag.name} may identify person and date"
        )
    return source.folder.path / "anonymised"


def export(
    source: recording.ExportSource,
    request: ExportRequest,
    folder: Path | None = None,
    others: Sequence[recording.ExportSource] = (),
    *,
    again: bool = False,
    progress: bool = False,
) -> ExportResult:
    """Write the formats that do not exist yet; if one cannot be written, the others still are.

    Args:
        source: bag to be exported, from `recording.find`.
        request: formats and settings.
        folder: output folder; None: that of `default_folder`.
        others: bags of further episodes of a LeRobot data set, not anonymised.
        again: True: write existing files again.
        progress: True to draw progress bars.

    Raises:
        HricError: the bag is damaged, or does not have a requested topic.
    """
    output = _output((source, *others), request, folder, again)
    anonymiser = None if request.anonymise is None else _anonymiser(source, request.anonymise)
    if anonymiser is not None:
        source = replace(source, run=anonymiser.run, urdf=anonymiser.urdf(source.urdf))
    result = ExportResult()
    missing = [kind for kind in request.formats if output.done(kind) is None]
    tables, result.reading = _tables(source, request, missing, anonymiser, progress)
    job = ExportJob(source, request, output, tables, result.notes, progress, anonymiser, others)
    for kind in request.formats:
        begin = time.perf_counter()
        try:
            if kind in missing and job.write(kind):
                output.finish(kind)
                result.seconds[kind] = time.perf_counter() - begin
        except Exception as error:  # includes errors of a library that only one format needs
            text = " ".join(str(error).split())
            result.failures[kind] = text if isinstance(error, HricError) else f"{type(error).__name__}: {text}"
        if (done := output.done(kind)) is not None:
            result.files[kind] = done
    if anonymiser is not None:
        _write_about(output, anonymiser, source)
        result.notes += anonymiser.done
    return result


def _output(
    sources: Sequence[recording.ExportSource], request: ExportRequest, folder: Path | None, again: bool
) -> ExportFolder:
    """Return the folder of an export with its list of files; notes on a run are among the settings."""
    if len(sources) > 1 and (request.anonymise is not None or set(request.formats) != {LEROBOT}):
        raise ParameterError("several runs are given; valid: only --format lerobot, and no --anonymise")
    settings = {"topics": sorted(request.topics), "load_body": request.load_body, "surface": request.surface}
    settings |= {"rate": request.rate} if LEROBOT in request.formats else {}
    if request.anonymise is None and (notes := [str(note) for each in sources for note in recording.notes(each)]):
        settings["notes"] = notes
    bags = [bag for each in sources for bag in each.bags]
    return ExportFolder(folder or default_folder(sources[0], request), bags, settings, again, request.anonymise)


def _tables(
    source: recording.ExportSource,
    request: ExportRequest,
    missing: Sequence[str],
    anonymiser: Anonymiser | None,
    progress: bool,
) -> tuple[dict[str, TopicTable], float]:
    """Return the tables from which missing formats are written, and the time to read them [s]; bags need none."""
    kinds, begin = [kind for kind in missing if kind not in BAGS], time.perf_counter()
    if not kinds:
        return {}, 0.0
    types = () if set(kinds) - set(NEEDED) else tuple(name for kind in kinds for name in NEEDED[kind])
    tables = recording.read(source, request.topics, progress=progress, types=types, anonymous=anonymiser)
    return tables, time.perf_counter() - begin


def _anonymiser(source: recording.ExportSource, names: Sequence[str]) -> Anonymiser:
    metrics: dict[str, object] = {}
    if source.folder is not None and source.folder.metrics_path.is_file():
        metrics = _json(source.folder.metrics_path)
    with recording.open_reader(source) as reader:
        begin = reader.start_time if reader.message_count else 0
    return Anonymiser(source.run, metrics, names, begin)


def _json(path: Path) -> dict[str, object]:
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise ExportError(f"cannot read {path}: {error}; `hric report` writes it again") from error
    if not isinstance(content, dict):
        raise ExportError(f"{path} is not a mapping; `hric report` writes it again")
    return content


def _write_about(output: ExportFolder, anonymiser: Anonymiser, source: recording.ExportSource) -> None:
    """Write the anonymised run.yaml and metrics.json, and the list of what was changed."""
    path = output.folder / ABOUT / "anonymised.txt"  # keeps the lines of formats that existed already
    before = [] if output.done(ABOUT) is None else path.read_text().splitlines()
    if source.folder is not None:
        for name, content, write in (
            ("run.yaml", anonymiser.run, files.write_yaml),
            ("metrics.json", anonymiser.metrics, files.write_json),
        ):
            output.write(ABOUT, name, partial(write, data=content), again=True)
    lines = dict.fromkeys([*before, *(f"- {line}" for line in anonymiser.done)])
    text = "".join(f"{line}\n" for line in lines)
    output.write(ABOUT, path.name, lambda target: files.write_text(target, text), again=True)
    output.finish(ABOUT)
