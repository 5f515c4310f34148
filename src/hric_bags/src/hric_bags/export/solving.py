"""Functions for commands that run OpenSim's inverse kinematics and dynamics tools on exported files."""

import contextlib
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hric_bags import files
from hric_bags.export import exporting, job
from hric_bags.export.recording import ExportSource
from hric_bags.export.table import ExportError, TopicTable
from hric_core.errors import HricError, failing


class SolveError(HricError):
    """Error for a tool of OpenSim that failed, or for data that the tool cannot process."""


def only(tables: Mapping[str, TopicTable], topic: str, what: str) -> TopicTable:
    """Return the table of a topic, or the only table there is.

    Args:
        tables: tables of the right type, by topic.
        topic: topic name; "": the only table.
        what: what the table contains, for the error message.

    Raises:
        SolveError: there is no such table, or more than one.
    """
    matches = [table for name, table in tables.items() if topic in ("", name)]
    if len(matches) != 1:
        named = f" {topic}" if topic else ""
        raise SolveError(f"one {what}{named} is needed; the bag has: {', '.join(tables) or 'none'}")
    return matches[0]


def exported(source: ExportSource, kind: str, topic: str) -> Path:
    """Return the exported file of a topic in a format; it is written if it does not exist.

    Raises:
        ExportError: the file cannot be written.
    """
    name = topic.strip("/").replace("/", ".")
    result = exporting.export(source, job.ExportRequest((kind,)))
    if kind in result.failures:
        with failing():
            raise ExportError(result.failures[kind])
    return next(path for path in result.files[kind] if path.name == f"{name}.{kind}")


def output_folder(source: ExportSource, name: str, requested: Path | None) -> Path:
    """Return the folder of a tool's results, created if missing.

    Raises:
        FileError: the folder cannot be created.
    """
    folder = (requested or (source.output.parent if source.folder is not None else source.output) / name).absolute()
    files.make_folder(folder)
    return folder


@contextlib.contextmanager
def output_to(log: Path) -> Iterator[None]:
    """Redirect output to a file within a block: OpenSim's tools write to the process' stdout and stderr."""
    sys.stdout.flush()
    copies = [os.dup(number) for number in (1, 2)]
    try:
        with log.open("wb") as file:
            for number in (1, 2):
                os.dup2(file.fileno(), number)
            yield
    finally:
        sys.stdout.flush()
        for number, copy in zip((1, 2), copies, strict=True):
            os.dup2(copy, number)
            os.close(copy)


def load_model(path: Path) -> Any:
    """Load an OpenSim model from its file, ready for a tool; OpenSim's output is dropped."""
    import opensim

    with output_to(Path(os.devnull)):
        model = opensim.Model(str(path))
        model.initSystem()
    return model


def run_tool(tool: Any, motion: Path, name: str) -> None:
    """Run a tool of OpenSim that writes the file `motion`; its output goes to a .log file beside it.

    Raises:
        SolveError: the tool fails, or does not write the file.
    """
    log = motion.with_suffix(".log")
    motion.unlink(missing_ok=True)
    try:
        with output_to(log):
            done = tool.run()
    except RuntimeError as error:
        raise SolveError(
            f"OpenSim's {name} failed: {str(error).strip().splitlines()[0]}; its messages are in {log}"
        ) from error
    if not done or not motion.is_file():
        raise SolveError(f"OpenSim's {name} failed; its messages are in {log}")
