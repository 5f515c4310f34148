"""From what a page shows to one file without a network request: template, style, scripts, libraries and numbers."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from string import Template
from typing import Any

from hric_experiments.report.figure import Figure
from hric_experiments.report.thinning import thin
from hric_experiments.report_html import libraries
from hric_experiments.report_html.scene import Blob, Robot, Scene
from hric_experiments.report_html.tables import Table, escape, render

ASSETS = Path(__file__).parent / "assets"
SCRIPTS = ("data.js", "plots.js", "scene.js", "replay.js", "page.js")
PLOT_VALUES, REPLAY_VALUES = 1_100_000, 600_000
"""Numbers that plots and replay may take. As single precision in base64 they are 5.9 MB and 3.2 MB, times and what
rounding adds come on top; with 6 MB of libraries and meshes a page stays below 20 MB, however long the run. Project
default, unconfirmed."""
REPLAY_RATE = 60.0
"""Of joints in the replay, at most: what a screen shows [Hz]."""


@dataclass
class Page:
    """What a page shows.

    Attributes:
        title: of the run.
        subtitle: below it.
        verdicts: short words beside it, as (kind, text): good, bad or plain.
        head: tables above the figures, what ran.
        figures: in order; one without panels is left out.
        tables: below the figures.
        robots: in the replay.
        notes: what a reader must know, e.g. what could not be drawn.
    """

    title: str
    subtitle: str
    verdicts: list[tuple[str, str]] = field(default_factory=list)
    head: list[Table] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    robots: list[Robot] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def render_page(page: Page) -> str:
    """The file's text.

    Raises:
        HricError: a library of the page is not installed, or a robot's description cannot be read.
    """
    blob = Blob()
    notes = list(page.notes)
    figures, kept = thin([figure for figure in page.figures if figure.panels], PLOT_VALUES)
    if kept is not None:
        notes.append(
            f"Long curves are thinned to {kept} points: smallest and greatest value of {kept // 2} equal parts of "
            "time each. The bag has all."
        )
    scene = Scene(blob)
    for robot in page.robots:
        scene.add(robot)
    data = {"plots": [_figure(figure, blob) for figure in figures], "scene": scene.data()}
    used = (libraries.plotly(), libraries.three())
    return Template((ASSETS / "page.html").read_text()).substitute(
        title=escape(page.title),
        subtitle=escape(page.subtitle),
        verdicts="".join(f'<span class="verdict {kind}">{escape(text)}</span>' for kind, text in page.verdicts),
        notes="".join(f"<p class=note>{escape(note)}</p>" for note in [*notes, *dict.fromkeys(scene.notes)]),
        head="".join(map(render, page.head)),
        links=" ".join(f'<a href="#plot-{escape(figure.key)}">{escape(figure.title)}</a>' for figure in figures),
        tables="".join(map(render, page.tables)),
        libraries=escape("; ".join(library.name for library in used)),
        style=(ASSETS / "page.css").read_text(),
        plotly=used[0].text,
        three=used[1].text,
        data=_json(data),
        numbers=blob.text(),
        scripts="\n".join((ASSETS / name).read_text() for name in SCRIPTS),
    )


def _json(data: Any) -> str:
    """JSON without any tag in it, which would end the element around it."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _figure(figure: Figure, blob: Blob) -> dict[str, Any]:
    panels = []
    for panel in figure.panels:
        lines = [
            {
                "name": curve.name,
                "role": curve.role,
                "time": blob.add(curve.time, "f8"),
                "values": blob.add(curve.values, "f4"),
            }
            for curve in panel.curves
            if len(curve.values)
        ]
        shown = {"title": panel.title, "unit": panel.unit or figure.unit, "range": figure.vertical_range(panel)}
        panels.append({**shown, "curves": lines, "bounds": [value for _, value in panel.bounds]})
    words = {"key": figure.key, "title": figure.title, "timeTitle": figure.abscissa}
    bands = [(begin, end) for _, begin, end in figure.bands]
    return {**words, "panels": panels, "bands": bands, "logarithmic": figure.logarithmic}


def replay_rate(duration: float, columns: int) -> float:
    """Rate at which the replay's numbers stay within REPLAY_VALUES, REPLAY_RATE at most [Hz]; columns: numbers per
    instant."""
    return min(REPLAY_RATE, REPLAY_VALUES / max(duration * max(columns, 1), 1e-9))
