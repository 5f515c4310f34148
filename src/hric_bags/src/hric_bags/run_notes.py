"""Notes that people add to a run afterwards, in a file of their own next to the bag; and the command that adds one."""

import argparse
import contextlib
import getpass
import math
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hric_bags import files
from hric_bags.arguments import RUNS, run_names
from hric_bags.export.table import TopicColumn, TopicTable
from hric_bags.run_folder import RunFolder, RunFolderError, iso_now
from hric_core.command import Argument, Command
from hric_core.errors import HricError, ParameterError

FILE = "notes.yaml"
TOPIC, TYPE = "/added_notes", "notes added after the run"
"""Topic and type of the table of notes in exports; the bag has no such topic."""
NOT_IN_LINE = ("Cc", "Cs", "Zl", "Zp")
"""Unicode categories that a line of text cannot have: control characters, bytes that are not UTF-8, ends of lines."""


@dataclass(frozen=True)
class AddedNote:
    """Note on a run.

    Attributes:
        written: UTC date and time at which the note was added, ISO 8601.
        by: name of the author.
        at: robot time of what the note is about [s]; None: the complete run.
        text: text of the note.
    """

    written: str
    by: str
    at: float | None
    text: str

    @property
    def signature(self) -> str:
        """Author and date."""
        return f"{self.by}, {self.written}"

    def __str__(self) -> str:
        """Return the note as one line."""
        return f"{'' if self.at is None else f'at {self.at:.3f} s: '}{self.text} ({self.signature})"


def read(folder: Path) -> list[AddedNote]:
    """Return the notes in a run folder in the order in which they were added; empty: there are none.

    Raises:
        RunFolderError: the contents of the file are not notes.
    """
    from hric_core.parameters import read_yaml

    path = folder / FILE
    return _notes(read_yaml(path), path) if path.is_file() else []


def _notes(entries: Any, path: Path) -> list[AddedNote]:
    with contextlib.suppress(TypeError):
        notes = [AddedNote(**entry) for entry in entries or ()]
        if all(isinstance(text, str) for note in notes for text in (note.written, note.by, note.text)) and all(
            note.at is None or math.isfinite(note.at) for note in notes
        ):
            return notes
    raise RunFolderError(f"{path} is not a list of notes; valid keys: written, by, at [s], text")


def text(folder: Path) -> str:
    """Return the notes in a run folder as the end of a report; "": there are none."""
    notes = [f"- {note}" for note in read(folder)]
    return "\n".join(["\nnotes added after the run:", *notes, ""]) if notes else ""


def add(folder: RunFolder, words: str, by: str, at: float | None = None) -> AddedNote:
    """Append a note to the notes of a run; no other file of the run is changed.

    Args:
        folder: run folder.
        words: text of the note, in one line.
        by: name of the author.
        at: robot time of what the note is about [s]; None: the complete run.

    Raises:
        HricError: a text is empty, the run has no control cycle at that time, the file of notes cannot be extended, or
            the system refuses to write.
    """
    import yaml

    from hric_core import yaml_text

    for name, value in (("text", words), ("--by", by)):
        if not value.strip() or any(unicodedata.category(character) in NOT_IN_LINE for character in value):
            raise ParameterError(f"{name} of a note is {value!r}; valid: one line of text")
    if at is not None:
        _check_time(folder, at)
    path, before = folder.path / FILE, read(folder.path)
    content = path.read_text(encoding="utf-8") if path.is_file() else ""
    note = AddedNote(iso_now(), by.strip(), at, words.strip())
    entry = yaml.safe_dump([asdict(note)], sort_keys=False, allow_unicode=True, width=1000)
    entry = entry if content.endswith("\n") or not content else f"\n{entry}"
    try:
        extended = _notes(yaml_text.parse(content + entry, str(path)), path)
    except HricError:
        extended = []
    if extended != [*before, note]:
        raise RunFolderError(f"{path} cannot be extended; valid: a list with `- ` before each note")
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(entry)
    except OSError as error:
        raise files.cannot_write(path, error) from error
    return note


def _check_time(folder: RunFolder, at: float) -> None:
    from hric_bags import reader

    time = reader.read(folder.bag_of(folder.read())).log.time
    if not time[0] <= at <= time[-1]:
        raise ParameterError(f"--at {at:g}: valid: robot times of the run, {time[0]:.3f} to {time[-1]:.3f} s")


def table(notes: Sequence[AddedNote]) -> TopicTable:
    """Return the notes as a table for exports; the time of a note on the complete run is NaN."""
    time = np.array([np.nan if note.at is None else note.at for note in notes])
    stamp = np.array([-1 if note.at is None else round(1e9 * note.at) for note in notes], dtype=np.int64)
    columns = (
        TopicColumn("text", "", np.array([note.text for note in notes])),
        TopicColumn("by", "", np.array([note.by for note in notes])),
        TopicColumn("written", "", np.array([note.written for note in notes])),
    )
    return TopicTable(TOPIC, TYPE, "", time, stamp, columns, "the start of the run", ("stamp -1: on the complete run",))


def of_table(tables: Mapping[str, TopicTable]) -> list[AddedNote]:
    """Return the notes in the tables of an export; empty: there are none."""
    if TOPIC not in tables:
        return []
    named = tables[TOPIC].named()
    words = (map(str, named[name].values) for name in ("written", "by", "text"))
    times = [None if np.isnan(time) else float(time) for time in tables[TOPIC].time]
    return [AddedNote(written, by, at, text) for written, by, text, at in zip(*words, times, strict=True)]


class NoteCommand(Command):
    """Add a note to a run, with author and date, in the file notes.yaml of its folder.

    Reports, verdicts and exports that are written afterwards show it; bag and run.yaml are not changed.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments of the command."""
        return [
            Argument("run", metavar="RUN", help="run folder, its name, or latest", complete=run_names),
            Argument("text", metavar="TEXT", help="text of the note, in one line"),
            Argument("--at", type=float, metavar="T", help="robot time of what the note is about [s] (default: all)"),
            Argument("--by", metavar="NAME", help="name of the author (default: your login name)"),
            RUNS,
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Add a note, and print all notes of the run."""
        folder = RunFolder.open(arguments.run, arguments.runs)
        add(folder, arguments.text, _login() if arguments.by is None else arguments.by, arguments.at)
        print("\n".join(["notes:", *(f"- {note}" for note in read(folder.path)), f"file: {folder.path / FILE}"]))


def _login() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError) as error:
        raise HricError("the login name is not known; give the author by --by NAME") from error
