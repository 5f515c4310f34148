"""Functions shared by the commands that run OpenSim's tools."""

import contextlib
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from hric_bags import files
from hric_bags.export.exporting import ExportRequest, export
from hric_bags.export.recording import ExportSource
from hric_bags.export.table import ExportError, TopicTable
from hric_core.errors import HricError, failing


class SolveError(HricError):
    """Error for a tool of OpenSim that failed, or data that it cannot take."""


def only(tables: Mapping[str, TopicTable], topic: str, what: str) -> TopicTable:
    """Return the only table of a topic.

    Args:
        tables: tables of the right type, by topic.
        topic: topic name; "": there is one table.
        what: name of the type in the error message.

    Raises:
        SolveError: there is none, or more than one.
    """
    matches = [table for name, table in tables.items() if topic in ("", name)]
    if len(matches) != 1:
        named = f" {topic}" if topic else ""
        raise SolveError(f"one {what}{named} is needed; the bag has: {', '.join(tables) or 'none'}")
    return matches[0]


def exported(source: ExportSource, kind: str, topic: str) -> Path:
    """Return the exported file of a topic, written now if it does not exist.

    Raises:
        ExportError: the file cannot be written.
    """
    name = topic.strip("/").replace("/", ".")
    result = export(source, ExportRequest((kind,)))
    if kind in result.failures:
        with failing():
            raise ExportError(result.failures[kind])
    return next(path for path in result.files[kind] if path.name == f"{name}.{kind}")


def output_folder(source: ExportSource, name: str, requested: Path | None) -> Path:
    """Return the folder of the results, made if missing.

    Raises:
        FileError: the folder cannot be made.
    """
    folder = (requested or (source.output.parent if source.folder is not None else source.output) / name).absolute()
    files.make_folder(folder)
    return folder


@contextlib.contextmanager
def output_to(log: Path) -> Iterator[None]:
    """Redirect OpenSim's output to a file: its tools write to the process's own stdout and stderr."""
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
    """Return a model from its file, ready for a tool; OpenSim's output is dropped."""
    import opensim

    with output_to(Path(os.devnull)):
        model = opensim.Model(str(path))
        model.initSystem()
    return model


def run_tool(tool: Any, motion: Path, name: str) -> None:
    """Run a tool of OpenSim that has to write `motion`.

    Raises:
        SolveError: the tool fails.
    """
    log = motion.with_suffix(".log")
    motion.unlink(missing_ok=True)
    try:
        with output_to(log):
            done = tool.run()
    except RuntimeError as error:
        raise SolveError(
            f"OpenSim's {name} failed: {str(error).strip().splitlines()[0]}; its messages: {log}"
        ) from error
    if not done or not motion.is_file():
        raise SolveError(f"OpenSim's {name} failed; its messages: {log}")
