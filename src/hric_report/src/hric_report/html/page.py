"""Rendering of a report page as one HTML file with sections, scripts, libraries and data; needs no network."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from markupsafe import Markup

from hric_analysis.recordings import RunEvent
from hric_report import sections, style
from hric_report.figure import Figure
from hric_report.headline import KeyFigure
from hric_report.heat import HeatMap
from hric_report.html import libraries, tables, templates
from hric_report.html.run_data import RunData
from hric_report.html.scene import Blob, PageScene, SceneRobot
from hric_report.html.strip import Strip
from hric_report.thinning import thin

PLOT_VALUES, REPLAY_VALUES = 1_100_000, 600_000
"""Maximum number of values in the plots and in the replay, so that a page stays below 20 MB for runs of any length: as
single precision in base64 they take 5.9 MB and 3.2 MB, plus times, plus 6 MB of libraries and meshes. Project default,
unconfirmed."""
REPLAY_RATE = 60.0
"""Maximum rate of the joint positions in the replay: the refresh rate of a screen [Hz]."""


@dataclass
class Page:
    """Contents of a report page.

    Attributes:
        title: title of the run.
        subtitle: line below the title.
        verdicts: short labels below the title, as (kind, text); kind: good, bad, plain, or of `verdict.KINDS`.
        findings: key figures.
        figures: figures, shown in their sections in this order; a figure without panels is skipped.
        robots: robots, persons and objects of the replay.
        notes: remarks on the page itself, e.g. parts that could not be drawn.
        run: data of the run, for its tables; None: the page shows several runs or a recording without run folder.
        events: events of the run.
        compared: compared runs, for their tables; None: the page shows no comparison.
        verdict: HTML on safety and ergonomics of the person; empty: there was no person.
        supervisor: chart of the supervisor's states over time; None: there was no supervisor.
        name: name of the run, for captions and file names; "": the title.
    """

    title: str
    subtitle: str
    verdicts: list[tuple[str, str]] = field(default_factory=list)
    findings: list[KeyFigure] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    robots: list[SceneRobot] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    run: RunData | None = None
    events: Sequence[RunEvent] = ()
    compared: Mapping[str, object] | None = None
    verdict: Markup = field(default_factory=Markup)
    supervisor: Strip | None = None
    name: str = ""


def render_page(page: Page) -> str:
    """Return the HTML of a report page.

    Raises:
        HricError: a library for the page is not installed, or the description of a robot cannot be read.
    """
    blob = Blob()
    notes = list(page.notes)
    figures, points = thin([figure for figure in page.figures if figure.panels], PLOT_VALUES)
    if points is not None:
        notes.append(
            f"Long curves are reduced to {points} points: the smallest and the largest value in each of {points // 2} "
            "equal time spans. The bag contains all values."
        )
    scene = PageScene(blob)
    for robot in page.robots:
        scene.add(robot)
    roles = {name: {"width": r.width, "dash": r.dash, "opacity": r.opacity} for name, r in style.ROLES.items()}
    plots = [_figure(figure, blob) for figure in figures]
    data = {"plots": plots, "roles": roles, "scene": scene.data(), "name": page.name or page.title}
    environment = templates.environment(
        contact_table=tables.contact_table,
        flat=tables.flat,
        known=tables.known,
        notes_table=tables.notes_table,
        overview=tables.overview,
        setpoint_table=tables.setpoint_table,
        sync_tables=tables.sync_tables,
    )
    return environment.get_template("report.html").render(
        page=page,
        sections=sections,
        figures=figures,
        notes=[*notes, *dict.fromkeys(scene.notes)],
        libraries=(libraries.plotly(), libraries.three()),
        data=data,
        numbers=blob.text(),
        most_events=tables.SHOWN_EVENTS,
    )


def _figure(figure: Figure, blob: Blob) -> dict[str, object]:
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
        shown = {
            "title": panel.title,
            "unit": panel.unit or figure.unit,
            "own": bool(panel.unit),
            "abscissa": panel.abscissa or figure.abscissa,
            "range": figure.vertical_range(panel),
        }
        if not figure.timed:
            shown["xrange"] = figure.horizontal_range(panel)
        panels.append({**shown, "curves": lines, "bounds": panel.bounds, "heat": _heat(panel.heat, blob)})
    words = {"key": figure.key, "title": figure.title, "caption": figure.caption, "columns": figure.columns}
    looks = {"bands": figure.bands, "logarithmic": figure.logarithmic, "equal": figure.equal, "timed": figure.timed}
    return {**words, **looks, "panels": panels}


def _heat(heat: HeatMap | None, blob: Blob) -> dict[str, object] | None:
    """Return the data of a heat map for the page's scripts, with values stored row by row; None: no heat map."""
    if heat is None:
        return None
    words = {"rows": heat.rows, "unit": heat.unit, "scale": heat.scale}
    return {**words, "time": blob.add(heat.time, "f8"), "values": blob.add(heat.values.T, "f4")}


def replay_rate(duration: float, columns: int) -> float:
    """Return the rate [Hz] at which a replay has at most REPLAY_VALUES values; at most REPLAY_RATE.

    Args:
        duration: duration of the run [s].
        columns: number of values per instant.
    """
    return min(REPLAY_RATE, REPLAY_VALUES / max(duration * max(columns, 1), 1e-9))
