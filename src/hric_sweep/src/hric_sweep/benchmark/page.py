"""HTML page of a benchmark: one file that needs no network and no JavaScript."""

import math
from collections.abc import Iterator
from pathlib import Path

from hric_bags import files
from hric_report.html import templates
from hric_report.html.chart import Axis
from hric_report.html.table import PageTable
from hric_sweep.benchmark import text
from hric_sweep.benchmark.results import predicted
from hric_sweep.page.words import figure
from hric_sweep.records import PlainData

NAME, ASSETS = "report.html", Path(__file__).parent / "assets"
LEFT, RIGHT = 150, 770
"""Horizontal ends of a chart's axis [px]."""


def write(folder: Path, results: PlainData) -> Path:
    """Write the HTML page of a benchmark's results to a folder; return its path."""
    path = folder / NAME
    files.write_text(path, build(results))
    return path


def build(results: PlainData) -> str:
    """Return the HTML page of a benchmark's results."""
    note = "Medians over all bodies and seeds, smallest and largest value in brackets."
    medians = {name: text.by_collaboration(results, name) for name in results["collaborations"]}
    template = templates.environment(ASSETS, axis=_axis, figure=figure).get_template("benchmark.html")
    return template.render(
        results=results,
        verdicts=[
            ("good" if expected == rank else "bad", f"{name}: predicted rank {expected}, actual rank {rank}")
            for name, expected, rank in predicted(results)
        ],
        overview=list(_overview(results)),
        medians={name: PageTable("", head, tuple(rows), note) for name, (head, rows) in medians.items()},
        made=list(_made(results)),
    )


def _overview(results: PlainData) -> Iterator[PageTable]:
    """Yield the table of controllers in order, then one table of mean ranks for each category."""
    yield PageTable("", text.HEAD, tuple(text.rows(results)))
    order = [standing["name"] for standing in results["standings"]]
    for category in ("ergonomics", "task", "robustness"):
        rows = tuple(
            (_spaced(name), *(f"{collaboration['controllers'][who]['ranks'][category]:.2f}" for who in order))
            for name, collaboration in results["collaborations"].items()
        )
        yield PageTable(f"Mean rank in {category}", ("collaboration", *order), rows, folded=True)


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def _axis(collaboration: PlainData, key: str) -> Axis:
    """Return the chart axis of a score; its range includes 0, the limit and all finite values in a collaboration."""
    scores = [controller["scores"][key] for controller in collaboration["controllers"].values()]
    values = [score[end] for score in scores for end in ("lowest", "highest")]
    ends = [0.0, collaboration["scores"][key]["limit"] or 0.0, *(value for value in values if value is not None)]
    finite = [float(value) for value in ends if math.isfinite(value)]
    return Axis(min(finite), max(finite) or 1.0, LEFT, RIGHT)


def _made(results: PlainData) -> Iterator[PageTable]:
    """Yield a table of the benchmark's versions and bodies, then a table of overrides for each controller."""
    hashes, bodies = results["hashes"], results["part"]["bodies"]
    rows = (
        ("hash of the definition", hashes["definition"]),
        ("hash of the tables of limits", hashes["tables"]),
        ("code", hashes["code"]),
        ("bodies", ", ".join(f"{name}: {who}" for name, who in bodies.items())),
        ("percentiles", results["population"]["source"]),
        ("values count as equal", f"if they differ by at most {100.0 * results['tolerance']:g} %"),
    )
    yield PageTable("", ("what", ""), rows)
    for name, controller in results["controllers"].items():
        changes = tuple(
            (_spaced(collaboration), " ".join(words)) for collaboration, words in controller["changes"].items()
        )
        prediction = controller["prediction"]
        note = controller["description"]
        if prediction is not None:
            note += f". Predicted rank {prediction['rank']}: {prediction['text']}"
        yield PageTable(f"Controller {name}", ("collaboration", "overrides"), changes, note)
