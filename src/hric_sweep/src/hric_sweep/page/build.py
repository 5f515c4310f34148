"""Page of a sweep: report.html, made from its table and settings only, one file that needs no network."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from string import Template

import numpy as np

from hric_report import html as report_html
from hric_report.html.document import ASSETS, document, embedded, links, script, titled
from hric_report.html.scene import Blob
from hric_report.html.tables import Table, escape, flat, render
from hric_sweep.page import drawn, estimate, indices, lists, sample, sensitivity, spread, words
from hric_sweep.page.sample import Sample
from hric_sweep.page.study import EXCEEDED, FAILED, FINE, Study, load

OWN = Path(__file__).parent / "assets"
SCRIPTS = ("columns.js", "density.js", "parallel.js", "matrix.js", "sweep.js")
PERIOD, RUNS_PER_SECOND = 10.0, 2000.0
"""Reload interval of the page of a running sweep: minimum [s], and number of runs that add one second."""
CONTENTS, VERSIONS = ("definition", "experiment"), "versions"
"""Keys of sweep.yaml that have separate tables."""
COLOURS = {"fine": "measured", "exceeded": "limit", "failed": "desired"}


def write(folder: Path, *, running: bool = False) -> Path:
    """Write the page of a sweep into its folder, replacing an existing one, and return its path.

    Args:
        folder: run folder of the sweep, with runs.parquet and sweep.yaml.
        running: True if the sweep is still running; the page then says so and reloads itself.

    Raises:
        HricError: the folder has no table, or one that was not written by a sweep; or the page cannot be written.
    """
    return report_html.write_text(folder, render_page(load(folder), running=running))


def render_page(study: Study, *, running: bool) -> str:
    """Return the text of the page; `running`: the sweep is still running, so that the page reloads itself."""
    blob, rows = Blob(), drawn.chosen(study)
    counted = sample.of(study)
    rank = sensitivity.ranks(study, counted)
    data = {
        "columns": drawn.columns(study, rows, rank, blob),
        "counts": None if counted.refused else drawn.counts(counted, rows, blob),
        "spread": not counted.refused,
        "kinds": blob.add(study.kinds[rows], "u4"),
        "index": blob.add(study.columns["index"][rows], "u4"),
        "command": lists.command(study),
        "words": {"exceeded": estimate.condition(study)},
        "pairs": drawn.PAIRS,
        "running": running,
        "period": PERIOD + study.runs / RUNS_PER_SECOND,
    }
    parts = dict(_parts(study, counted, drawn.said(study, rows), rank))
    head = f"<p class=running>{_progress(study)}</p>" if running else ""
    return document(
        study.folder.resolve().name,
        study.definition.get("description") or "a sweep",
        _verdicts(study, running),
        f"<main class=sweep>{links(parts)}{head}{titled(parts)}</main><div id=tip hidden></div>",
        foot=escape(f"Made from {study.runs} rows of runs.parquet."),
        css=[OWN / "sweep.css"],
        scripts=[
            embedded("data", data),
            embedded("numbers", blob.text()),
            embedded("ids", " ".join(study.columns["id"][rows])),
            script((ASSETS / "data.js").read_text(), *((OWN / name).read_text() for name in SCRIPTS)),
        ],
    )


def _parts(study: Study, counted: Sample, sampled: str, rank: sensitivity.Ranks) -> Iterator[tuple[str, str]]:
    """Yield title and content of each part that is not empty."""
    yield "Estimate", estimate.part(study)
    yield "What was varied", f"<p>{escape(_how_many(study))}</p>{render(words.varied(study))}"
    yield "Runs", _runs(study, counted, sampled)
    found = spread.part(study, counted)
    if found:
        yield "Distribution of the outputs", found
    found = indices.part(study) + sensitivity.part(study, counted, rank)
    if found:
        yield "What the outputs depend on", found
    yield "Failures", lists.failures(study)
    yield "Worst runs", lists.worst(study)
    yield "Cost", render(lists.cost(study))
    yield "How it was made", _made(study)


def _how_many(study: Study) -> str:
    base = study.definition.get("extends")
    of = f" of {base}" if base else ""
    return f"{study.runs} runs{of}; points chosen by {words.sampler(study)}."


def _verdicts(study: Study, running: bool) -> Iterator[tuple[str, str]]:
    failed = int((study.kinds == FAILED).sum())
    planned = study.planned
    state = "running" if running else "whole" if planned is None or study.runs >= planned else "stopped before its end"
    yield "plain", state
    yield "plain", f"{study.runs}{'' if planned is None else f' of {planned}'} runs"
    if failed:
        yield "bad", f"{failed} failed"


def _progress(study: Study) -> str:
    planned, period = study.planned, PERIOD + study.runs / RUNS_PER_SECOND
    bar = "" if not planned else f'<progress max="{planned}" value="{study.runs}"></progress>'
    of = "" if planned is None else f" of {planned}"
    return (
        f"This sweep is running: {study.runs}{of} runs so far.{bar} All below is of these. "
        f"<label><input type=checkbox id=reload checked> load again every {period:.0f} s</label>"
    )


def _runs(study: Study, counted: Sample, sampled: str) -> str:
    names = {"fine": "within" if study.limit else "ended", "exceeded": estimate.condition(study), "failed": "failed"}
    kinds = {"fine": FINE, "exceeded": EXCEEDED, "failed": FAILED}
    buttons = "".join(
        f'<button type=button data-kind={kind} aria-pressed=true><i style="background:var(--{COLOURS[kind]})"></i>'
        f"{escape(names[kind])}: {int((study.kinds == number).sum())}</button> "
        for kind, number in kinds.items()
        if (study.kinds == number).any()
    )
    pairs = f"The first {drawn.PAIRS} of the columns above, drawn likewise; {_pairs(counted)}"
    return Template((OWN / "runs.html").read_text()).substitute(
        sampled=escape(sampled), kinds=buttons, pairs=escape(pairs)
    )


def _pairs(counted: Sample) -> str:
    """Return the description of the scatter matrix: its diagonal and the cells above it."""
    if counted.refused:
        return f"a point is a run. {counted.refused}"
    shown = "above the diagonal their rank correlation (Spearman), on it all runs in grey and the kept ones in blue."
    alike = np.all(counted.counts == 1.0)
    return shown if alike else f"{shown} A point is a run, whatever it counts. {counted.note}"


def _made(study: Study) -> str:
    leaves = flat({key: value for key, value in study.made.items() if key not in (*CONTENTS, VERSIONS)})
    head = ("what", "value")
    shown = [Table("", head, tuple(leaves))] if leaves else []
    if versions := flat(study.made.get(VERSIONS) or {}):
        shown.append(Table("Versions", head, tuple(versions), folded=True))
    shown.append(Table("Definition", head, tuple(flat(study.definition)), folded=True))
    experiment = study.made.get("experiment")
    if isinstance(experiment, Mapping):
        shown.append(Table("Experiment", head, tuple(flat(experiment)), folded=True))
    return "".join(map(render, shown))
