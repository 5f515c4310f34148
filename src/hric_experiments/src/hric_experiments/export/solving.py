"""What the commands that run OpenSim's tools share."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hric_control.errors import HricError
from hric_experiments.export.exporting import Request, export
from hric_experiments.export.recording import Source
from hric_experiments.export.table import ExportError


class SolveError(HricError):
    """A tool of OpenSim that failed, or data that it cannot take."""


def exported(source: Source, kind: str, topic: str) -> Path:
    """The exported file of a topic, written now if it is not there yet.

    Raises:
        ExportError: it cannot be written.
    """
    name = topic.strip("/").replace("/", ".")
    result = export(source, Request((kind,)))
    if kind in result.failures:
        raise ExportError(result.failures[kind])
    return next(path for path in result.files[kind] if path.name == f"{name}.{kind}")


def output_folder(source: Source, name: str, given: Path | None) -> Path:
    """Folder of the results, made if missing.

    Raises:
        SolveError: it cannot be made.
    """
    folder = (given or (source.output.parent if source.folder is not None else source.output) / name).absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SolveError(f"cannot write to {folder}: {error.strerror or error}") from error
    return folder


@contextlib.contextmanager
def told_to(log: Path) -> Iterator[None]:
    """What OpenSim prints goes to a file: its tools write to the process's own outputs."""
    sys.stdout.flush()
    kept = [os.dup(number) for number in (1, 2)]
    try:
        with log.open("wb") as file:
            for number in (1, 2):
                os.dup2(file.fileno(), number)
            yield
    finally:
        sys.stdout.flush()
        for number, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, number)
            os.close(copy)


def load_model(path: Path) -> Any:
    """A model from its file, ready for a tool; what it says on the way is not told."""
    import opensim

    with told_to(Path(os.devnull)):
        model = opensim.Model(str(path))
        model.initSystem()
    return model


def run_tool(tool: Any, motion: Path, name: str) -> None:
    """Run a tool of OpenSim that is to write `motion`.

    Raises:
        SolveError: it fails.
    """
    log = motion.with_suffix(".log")
    motion.unlink(missing_ok=True)
    try:
        with told_to(log):
            done = tool.run()
    except RuntimeError as error:
        raise SolveError(f"OpenSim's {name} failed: {str(error).strip().splitlines()[0]}; its messages: {log}") from error
    if not done or not motion.is_file():
        raise SolveError(f"OpenSim's {name} failed; its messages: {log}")
