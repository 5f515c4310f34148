"""HTML report of a run folder: report.html, one file with plots, tables and a 3D replay; needs no network."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from hric_assessment.typed_json import JsonObject
from hric_bags import files
from hric_bags.run_folder import RunFolder, RunFolderError
from hric_report.run import analyse

if TYPE_CHECKING:
    from hric_report.html.page import Page

NAME = "report.html"


def write(folder: RunFolder, *, progress: bool = False) -> Path:
    """Write the page of a run into its folder, overwriting an earlier one; return its path.

    Also writes verdict.json if a person was in the run and the file does not exist yet.

    Args:
        folder: run folder.
        progress: show a progress bar while the bag is read.

    Raises:
        HricError: the bag or the robot description cannot be read, or a library for the page is not installed.
    """
    return _write(folder.path, page_of(folder, progress=progress))


def page_of(folder: RunFolder, *, progress: bool = False) -> Page:
    """Return the contents of the report page of a run; `progress`: show a progress bar. See also `write`."""
    from hric_report.html import run_data, run_page
    from hric_report.html.verdict import verdict_of

    data = run_data.load(folder, metrics_of(folder), progress=progress)
    return run_page.build(replace(data, verdict=verdict_of(folder)))


def write_comparison(
    runs: Sequence[RunFolder], labels: Sequence[str], target: Path, *, fit: bool = False, progress: bool = False
) -> Path:
    """Write the page that compares two or more runs of the same motion, aligned with the first run; return its path.

    Args:
        runs: run folders.
        labels: labels of the runs.
        target: folder of the page; created if missing.
        fit: align the runs by their positions instead of the times of the setpoints.
        progress: show a progress bar while the bags are read.

    Raises:
        HricError: a bag or robot description cannot be read, a library is not installed, or the runs do not match.
    """
    return _write(target, comparison_of(runs, labels, fit=fit, progress=progress))


def comparison_of(
    runs: Sequence[RunFolder], labels: Sequence[str] = (), *, fit: bool = False, progress: bool = False
) -> Page:
    """Return the contents of the page that compares runs; see `write_comparison`. labels: empty: folder names."""
    from hric_report.compare import settings_of
    from hric_report.html import comparison_page, run_data

    data = [run_data.load(folder, metrics_of(folder), progress=progress) for folder in runs]
    overlaid = comparison_page.lay(data, labels or [folder.path.name for folder in runs], fit=fit)
    return comparison_page.build(overlaid, comparison_page.differing([settings_of(item.run) for item in data]))


def metrics_of(folder: RunFolder) -> JsonObject:
    """Return the contents of metrics.json; computes the file first if it is missing."""
    if not folder.metrics_path.is_file():
        analyse(folder, figures=False)
    try:
        values: JsonObject = json.loads(folder.metrics_path.read_text())
    except (OSError, ValueError) as error:
        raise RunFolderError(
            f"cannot read {folder.metrics_path}: {error}; the command `report` writes the file again"
        ) from error
    return values


def _write(folder: Path, page: Page) -> Path:
    from hric_report.html.page import render_page

    return write_text(folder, render_page(page))


def write_text(folder: Path, text: str) -> Path:
    """Write the HTML of a page into a folder, created if missing; return its path. Raises HricError if that fails."""
    path = folder / NAME
    files.make_folder(folder)
    files.write_text(path, text)
    return path
