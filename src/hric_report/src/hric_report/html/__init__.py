"""From a run folder to report.html: one file with plots, tables and a replay, which needs no network."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hric_bags import files
from hric_bags.run_folder import RunFolder, RunFolderError
from hric_report.run import analyse

if TYPE_CHECKING:
    from hric_report.html.page import Page

NAME = "report.html"


def write(folder: RunFolder, *, progress: bool = False) -> Path:
    """Write the page of a run into its folder, replacing one that is there; and its verdict.json, where a person was in
    the run and there is none.

    Args:
        folder: of the run.
        progress: show a progress bar while the bag is read.

    Raises:
        HricError: the bag or the description cannot be used, or a library of the page is not installed.
    """
    from hric_report.html import run_data, run_page
    from hric_report.html.verdict import verdict_of

    data = run_data.load(folder, metrics_of(folder), progress=progress)
    return _write(folder.path, run_page.build(replace(data, verdict=verdict_of(folder))))


def write_comparison(
    runs: Sequence[RunFolder], labels: Sequence[str], target: Path, *, fit: bool = False, progress: bool = False
) -> Path:
    """Write the page of two or more runs of the same motion, overlaid on the first of them.

    Args:
        runs: their folders.
        labels: what to call them, one per run.
        target: folder in which the page is written; made if missing.
        fit: lay the runs over each other by their positions instead of the setpoints' time.
        progress: show a progress bar while the bags are read.

    Raises:
        HricError: as `write`; or the runs do not match.
    """
    from hric_report.compare import settings_of
    from hric_report.html import comparison_page, run_data

    data = [run_data.load(folder, metrics_of(folder), progress=progress) for folder in runs]
    laid = comparison_page.lay(data, labels, fit=fit)
    return _write(
        target, comparison_page.build(laid, comparison_page.differing([settings_of(one.run) for one in data]))
    )


def metrics_of(folder: RunFolder) -> dict[str, Any]:
    """Contents of metrics.json, computed first where there is none."""
    if not folder.metrics_path.is_file():
        analyse(folder, figures=False)
    try:
        found: dict[str, Any] = json.loads(folder.metrics_path.read_text())
    except (OSError, ValueError) as error:
        raise RunFolderError(f"cannot read {folder.metrics_path}: {error}; `report` writes it again") from error
    return found


def _write(folder: Path, page: Page) -> Path:
    from hric_report.html.page import render_page

    return write_text(folder, render_page(page))


def write_text(folder: Path, text: str) -> Path:
    """Write the text of a page into a folder, made if missing. Raises HricError: it cannot be written."""
    path = folder / NAME
    files.make_folder(folder)
    files.write_text(path, text)
    return path
