"""HTML page of a sweep, report.html: built from the sweep's table and settings only; needs no network."""

from pathlib import Path

from hric_report import html as report_html
from hric_report.html import templates
from hric_report.html.scene import Blob
from hric_report.html.table import PageTable
from hric_report.html.tables import flat
from hric_sweep.page import drawn, estimate, indices, lists, sample, sensitivity, spread, words
from hric_sweep.page.study import RecordedSweep, load

ASSETS = Path(__file__).parent / "assets"
PERIOD, RUNS_PER_SECOND = 10.0, 2000.0
"""Reload interval of the page of a running sweep: minimum [s], and number of runs that add one second."""
TEMPLATES = templates.environment(
    ASSETS, figure=words.figure, quantile=spread.with_interval, rounded=sensitivity.rounded
)
TABLES = {"Versions": "versions", "Definition": "definition", "Experiment": "experiment"}
"""Keys of sweep.yaml that the page shows in separate tables, by title of the table."""


def write(folder: Path, *, running: bool = False) -> Path:
    """Write the page of a sweep into its folder, replacing an existing page; return its path.

    Args:
        folder: run folder of the sweep, with runs.parquet and sweep.yaml.
        running: True if the sweep is still running; the page then says so and reloads itself.

    Raises:
        HricError: the folder has no table, or one that was not written by a sweep; or the page cannot be written.
    """
    return report_html.write_text(folder, render_page(load(folder), running=running))


def render_page(study: RecordedSweep, *, running: bool) -> str:
    """Return the HTML page of a sweep; `running`: the sweep is still running, so the page reloads itself."""
    blob, rows, counted = Blob(), drawn.chosen(study), sample.of(study)
    rank, spreads = sensitivity.ranks(study, counted), spread.spreads(study, counted)
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
    return TEMPLATES.get_template("sweep.html").render(
        title=study.folder.resolve().name,
        subtitle=study.definition.get("description") or "a sweep",
        study=study,
        running=running,
        condition=estimate.condition(study),
        estimate=estimate.lines(study, "given the distributions below"),
        by_value=estimate.by_value(study),
        sampler=words.sampler(study),
        varied=words.varied(study),
        sample=counted,
        sampled=drawn.caption(study, rows),
        spreads=spreads,
        quantiles=spread.table(study, counted, spreads),
        sobol=indices.outputs(study),
        rank=rank,
        correlated=any(rank.get(name, {}).get(output) for name in study.variables for output in study.outputs),
        fewest=sensitivity.FEWEST,
        likely=sensitivity.LIKELY,
        failures=lists.failures(study),
        reasons=lists.REASONS,
        worst=lists.WORST,
        command=lists.command(study),
        cost=lists.cost(study),
        made=_made(study),
        data=data,
        numbers=blob.text(),
        ids=" ".join(study.columns["id"][rows]),
    )


def _made(study: RecordedSweep) -> list[PageTable]:
    """Return tables of the content of sweep.yaml, without empty ones; the definition is taken from runs.parquet."""
    made = {**study.made, "definition": study.definition}
    trees: dict[str, object] = {title: made.pop(key, None) for title, key in TABLES.items()}
    head = ("what", "value")
    return [
        PageTable(title, head, tuple(flat(tree)), folded=bool(title))
        for title, tree in {"": made, **trees}.items()
        if tree
    ]
