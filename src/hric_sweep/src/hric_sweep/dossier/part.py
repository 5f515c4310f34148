"""Part of a dossier: its content about one run or one sweep."""

import hashlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from hric_report.html.table import PageTable
from hric_report.html.tables import flat


class AssessmentGap(NamedTuple):
    """Subject that was not assessed, with the reason, and a remedy that would make it known ("": none is known)."""

    subject: str
    reason: str
    remedy: str


class StatedReply(NamedTuple):
    """Reply to a question of the verdict, with its CSS class, number with limit, subject of the number, and reason."""

    reply: str
    look: str
    number: str
    subject: str
    reason: str


@dataclass(frozen=True)
class DossierPart:
    """Content of a dossier about one run or one sweep.

    Attributes:
        folder: run folder.
        kind: "run" or "sweep": the HTML template that shows the data.
        data: data of the run or sweep, for the templates.
        label: overall result, as (CSS class, text).
        replies: replies to the questions of the verdict, by question.
        gaps: subjects that were not assessed.
        groups, regions, titles: groups of findings, body regions, and titles of the tables of limits that occur in the
            results; the dossier describes their methods.
        enclosed: paths of the files that are copied to the dossier.
        kept: paths of large files that stay in the run folder; the dossier has their hashes.
        origin: tables with definition, versions and other origins of the results.
    """

    folder: Path
    kind: str
    data: Mapping[str, object]
    label: tuple[str, str]
    replies: Mapping[str, StatedReply]
    gaps: Sequence[AssessmentGap]
    groups: Collection[str]
    regions: Collection[str]
    titles: Collection[str]
    enclosed: Sequence[Path]
    kept: Sequence[Path]
    origin: Sequence[PageTable]

    @property
    def name(self) -> str:
        """Name of the run folder."""
        return self.folder.name


def present(folder: Path, *names: str) -> list[Path]:
    """Return the paths of those files that exist in a folder."""
    return [path for name in names if (path := folder / name).is_file()]


def sha256(path: Path) -> str:
    """Return the SHA-256 hash of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def listed(title: str, tree: object) -> PageTable:
    """Return a table of all values in nested mappings, each with its dotted key."""
    return PageTable(title, ("key", "value"), flat(tree))
