"""Files of a dossier: its page, copies of result files, and a list with the hashes of all files."""

import base64
import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from hric_assessment.contact.sources import CONFIRMED, sources
from hric_assessment.findings import DISCLAIMER
from hric_bags import files
from hric_core.errors import HricError
from hric_report.film.browser import Browser
from hric_report.html import templates
from hric_report.html import verdict as verdict_page
from hric_report.html.tables import flat
from hric_run import provenance
from hric_sweep.dossier.part import DossierPart, sha256

PAGE, PDF, HASHES = "index.html", "dossier.pdf", "SHA256SUMS"
ASSETS = Path(__file__).parent / "assets"
DATE = re.compile(rb"D:\d{14}\+00'00'")
"""Pattern of the printing time in a PDF, which NO_DATE replaces, so that the same dossier gives the same bytes."""
NO_DATE = b"D:19700101000000+00'00'"


def contents(parts: Sequence[DossierPart]) -> dict[str, bytes]:
    """Return the files of a dossier by their path in its folder, without the list of hashes.

    Raises:
        HricError: two parts have the same name, or a file cannot be read.
    """
    names = [part.name for part in parts]
    for name in names:
        if names.count(name) > 1:
            raise HricError(f"{names.count(name)} runs or sweeps have the name {name}; valid: each name once")
    used = [{item for part in parts for item in getattr(part, key)} for key in ("groups", "regions", "titles")]
    found = sources(*used)
    text = (
        templates.environment(ASSETS, sha256=sha256, flat=flat)
        .get_template("dossier.html")
        .render(
            parts=parts,
            tables=found,
            confirmed=CONFIRMED,
            foreign=sorted(used[2] - {one.table.title for one in found}),
            questions=verdict_page.BY_DEFAULT,
            disclaimer=DISCLAIMER,
            revision=provenance.revision(),
        )
    )
    enclosed = {f"{part.name}/{path.name}": path for part in parts for path in part.enclosed}
    enclosed |= {f"tables/{table.file.name}": table.file for table in found}
    return {PAGE: text.encode()} | {name: path.read_bytes() for name, path in enclosed.items()}


def printed(page: bytes) -> bytes:
    """Return an HTML page as PDF, printed with Chromium. Raises HricError if Chromium is not installed or fails."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / PAGE
        path.write_bytes(page)
        with Browser(Path(folder) / "profile") as browser:
            browser.open(path)
            data = browser.call("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"]
    return DATE.sub(NO_DATE, base64.b64decode(data))


def write(folder: Path, content: Mapping[str, bytes]) -> None:
    """Write a dossier into a folder, with the list of hashes; an earlier one with the same files is replaced.

    Raises:
        HricError: the folder contains other files, or cannot be written.
    """
    known = {*content, HASHES}
    others = [
        name for path in folder.rglob("*") if path.is_file() and (name := str(path.relative_to(folder))) not in known
    ]
    if others:
        raise HricError(
            f"{folder} contains {others[0]}, which is not part of this dossier; valid: an empty or new folder, or one "
            "with an earlier dossier of the same runs"
        )
    for name, data in content.items():
        files.make_folder((folder / name).parent)
        with files.atomic(folder / name) as temporary:
            temporary.write_bytes(data)
    lines = (f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in sorted(content.items()))
    files.write_text(folder / HASHES, "".join(lines))
