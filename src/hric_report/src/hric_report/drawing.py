"""Drawing of figures for print: SVG and PNG in the column widths of journals, with captions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import EngFormatter

from hric_bags import files
from hric_core.processes import quiet_collector
from hric_report import heat, style
from hric_report.figure import Figure, Panel
from hric_report.thinning import limited

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

FOLDER, CAPTIONS = "figures", "captions.md"
"""Subfolder of a run or comparison for figures, and name of the file with their captions in it."""
POINTS = 1500
"""Maximum number of points of a curve; more than a journal column has dots at 300 dpi. Project default, unconfirmed."""
INCH = 25.4
"""Length of an inch [mm]."""
LEFT, RIGHT, BOTTOM, TOP, TITLE, LEGEND, GAP, BETWEEN = 16.0, 2.5, 9.5, 2.0, 3.5, 3.6, 16.0, 6.5
"""Margins left, right, below and above the panels, heights of a panel title and of a legend row, and gaps between the
columns and between the rows of panels [mm]."""
LABEL, BELOW = 12.0, 5.468
"""Distances of the axis labels from the vertical axis (wide enough for tick labels of six characters) and from the
horizontal axis [mm]. They are fixed because matplotlib otherwise measures all tick labels, which is slow."""
SMALL = 5e-3
"""Largest absolute value on an axis below which tick labels have an SI prefix, such as 200µ, as on the HTML page."""
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
ROW, ALONE = 24.0, 52.0
"""Height of a panel in a figure with several rows of panels, and in a figure with one row [mm]."""
Sheets: TypeAlias = "dict[PanelLayout, tuple[Drawing, list[Axes]]]"
STYLE = {
    "axes.grid": True,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": style.TYPE,
    "axes.titleweight": "bold",
    "axes.titlepad": 3.0,
    "axes.labelpad": 2.0,
    "font.size": style.TYPE,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "svg.fonttype": "none",
    "svg.hashsalt": "hric",
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
}


class PanelLayout(NamedTuple):
    """Arrangement of panels: number of panels and of columns, figure width and top margin [mm], equal axis scales."""

    panels: int
    columns: int
    width: float
    top: float
    equal: bool


def stroke(role: str) -> dict[str, Any]:
    """Return the matplotlib line properties of a curve; `role`: its role, such as measured (see `style.ROLES`)."""
    look = style.ROLES[role]
    if not look.width:
        return {"color": look.light, "linestyle": "none", "marker": ".", "markersize": 1.2}
    line = (0, look.dash) if look.dash else "-"
    return {"color": look.light, "linewidth": look.width, "linestyle": line, "alpha": look.opacity}


def draw(folder: Path, figures: Iterable[Figure], title: str) -> list[Path]:
    """Draw figures into a folder as `<key>.png` and `<key>.svg`, and write their captions to `captions.md`.

    Figures without panels are skipped. A figure with a single panel is one journal column wide, others are two.

    Args:
        folder: target folder; created if missing.
        figures: figures to draw.
        title: title of the run, for the captions.

    Returns:
        The PNG files.
    """
    shown = [figure for figure in figures if figure.panels]
    if not shown:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE), quiet_collector():
        sheets: Sheets = {}
        made = [save(drawn(figure, sheets), folder / f"{figure.key}.png", caption(figure, title)) for figure in shown]
    lines = [f"# Captions: {title}"]
    lines += [f"**{figure.key}.png, {figure.key}.svg.** {caption(figure, title)}" for figure in shown]
    files.write_text(folder / CAPTIONS, "\n\n".join(lines) + "\n")
    return made


def caption(figure: Figure, title: str) -> str:
    """Return the caption of a figure for a paper; `title`: title of the run."""
    return f"{figure.title} ({title}). {figure.caption}".strip()


def save(drawing: Drawing, path: Path, words: str = "") -> Path:
    """Write a drawing atomically as PNG and as SVG next to it, then close it.

    Args:
        drawing: matplotlib figure.
        path: PNG file.
        words: caption that is stored in the metadata of both files.
    """
    about = {"Title": path.stem, "Description": words}
    # With less compression, writing a PNG takes two thirds of the time; the file is a quarter larger.
    formats: dict[Path, dict[str, Any]] = {
        path: {"metadata": {**about, "Software": None}, "pil_kwargs": {"compress_level": 1}},
        path.with_suffix(".svg"): {"metadata": {**about, "Date": None}},
    }
    for target, options in formats.items():
        with files.atomic(target) as temporary:
            drawing.savefig(temporary, format=target.suffix[1:], dpi=style.RESOLUTION, **options)
    plt.close(drawing)
    return path


def drawn(figure: Figure, sheets: Sheets) -> Drawing:
    """Draw a figure and return the drawing; must be called within `plt.rc_context(STYLE)`.

    Args:
        figure: figure to draw.
        sheets: cache of matplotlib figures by layout, extended here, since creating panels and ticks takes as long as
            drawing in them. A figure that reuses one replaces the figure drawn before in it.
    """
    if (rows := figure.panels[0].heat) is not None:
        return heat.drawn(rows, figure.abscissa)
    figure = limited(figure, POINTS)
    count = len(figure.panels)
    width = style.DOUBLE if count > 1 else style.SINGLE
    columns = min(figure.columns, count)
    names = list(dict.fromkeys(name for panel in figure.panels for name in _names(figure, panel)))
    # Fixed margins: matplotlib's layout engines take longer than all the drawing.
    per_row, legend_rows = _legend_rows(names, width)
    top = TOP + TITLE * any(panel.title for panel in figure.panels) + LEGEND * legend_rows
    layout = PanelLayout(count, columns, width, top, equal=figure.equal)
    if layout in sheets:
        _wipe(*sheets[layout])
    else:
        sheets[layout] = _sheet(layout)
    drawing, axes = sheets[layout]
    for k, (ax, panel) in enumerate(zip(axes, figure.panels, strict=True)):
        _draw_panel(ax, figure, panel, first=k % columns == 0)
        if k + columns >= count:
            ax.set_xlabel(panel.abscissa or figure.abscissa)
    if legend_rows:
        _legend(drawing, axes, per_row, LEFT / width)
    return drawing


def _sheet(layout: PanelLayout) -> tuple[Drawing, list[Axes]]:
    """Return a new matplotlib figure with empty panels, and their axes."""
    count, columns, width, top, equal = layout
    rows = -(-count // columns)
    panel_width = (width - LEFT - RIGHT - GAP * (columns - 1)) / columns
    panel_height = panel_width if equal else ROW if rows > 1 else ALONE
    height = BOTTOM + top + rows * panel_height + BETWEEN * (rows - 1)
    grid = {"wspace": GAP / panel_width, "hspace": BETWEEN / panel_height}
    margins = {"left": LEFT / width, "right": 1 - RIGHT / width, "bottom": BOTTOM / height, "top": 1 - top / height}
    drawing, axes = plt.subplots(
        rows,
        columns,
        figsize=(width / INCH, height / INCH),
        sharex=not equal,
        squeeze=False,
        gridspec_kw={**margins, **grid},
    )
    flat = list(axes.flat)
    for k, ax in enumerate(flat):
        ax.yaxis.set_label_coords(-LABEL / panel_width, 0.5)
        ax.xaxis.set_label_coords(0.5, -BELOW / panel_height)
        if k + columns >= count:
            ax.tick_params(labelbottom=True)
    for ax in flat[count:]:
        ax.set_axis_off()
    return drawing, flat[:count]


def _wipe(drawing: Drawing, axes: Sequence[Axes]) -> None:
    """Remove curves, bands, texts and legends from a reused matplotlib figure; `drawn` sets everything else again."""
    for ax in axes:
        for artist in (*ax.lines, *ax.patches, *ax.texts):
            artist.remove()
        ax.relim()
        ax.set_ylabel("")
    for legend in [*drawing.legends]:
        legend.remove()


def _names(figure: Figure, panel: Panel) -> list[str]:
    return [*(curve.name for curve in panel.curves), *(name for name, _, _ in figure.bands)]


def _legend_rows(names: Sequence[str], width: float) -> tuple[int, int]:
    """Return entries per row and number of rows of a legend of a given width [mm]; (1, 0) for fewer than two names."""
    if len(names) < 2:
        return 1, 0
    per_row = max(1, min(len(names), int((width - 4.0) / (11.0 + 1.35 * max(map(len, names))))))
    return per_row, math.ceil(len(names) / per_row)


def _draw_panel(ax: Axes, figure: Figure, panel: Panel, *, first: bool) -> None:
    for curve in panel.curves:
        ax.plot(curve.time, curve.values, label=curve.name, **stroke(curve.role))
    for name, begin, end in figure.bands:
        ax.axvspan(begin, end, color=style.LIMIT[0], alpha=0.12, linewidth=0, label=name)
    ax.set_title(panel.title, loc="left", y=1.0)  # a fixed height: otherwise matplotlib measures all labels
    if first or panel.unit:
        ax.set_ylabel(panel.unit or figure.unit)
    ax.margins(x=0.0)
    ax.set_yscale("log" if figure.logarithmic else "linear")
    low, high = figure.vertical_range(panel)
    ax.set_ylim(low, high)
    if figure.logarithmic:
        ax.yaxis.set_major_formatter(_power)
    else:
        ax.locator_params(axis="both" if figure.equal else "y", nbins=5)
        if max(abs(low), abs(high)) < SMALL:
            ax.yaxis.set_major_formatter(EngFormatter(sep=""))
    if figure.equal:
        ax.set_xlim(*figure.horizontal_range(panel))
        ax.set_aspect("equal")
    elif low < 0.0 < high:
        ax.axhline(0.0, color=style.ROLES["setpoint"].light, linewidth=0.5, alpha=0.3)
    for name, bound in panel.bounds:
        if low <= bound <= high:
            _draw_bound(ax, name, bound)


def _power(value: float, _: float) -> str:
    """Return a power of ten as plain text; matplotlib's math text would take longer than drawing a panel."""
    return "10" + str(round(math.log10(value))).translate(RAISED)


def _draw_bound(ax: Axes, name: str, bound: float) -> None:
    """Draw the horizontal line of a limit, with its name on the side towards the middle of the panel."""
    upper = ax.transData.transform((0.0, bound))[1] > ax.transAxes.transform((0.0, 0.5))[1]
    ax.axhline(bound, color=style.LIMIT[0], linestyle=":", linewidth=0.9)
    ax.annotate(
        name,
        (1.0, bound),
        (0.0, -1.0 if upper else 1.0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="right",
        va="top" if upper else "bottom",
        color=style.LIMIT[0],
        fontsize=style.TYPE - 1.0,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.3},
    )


def _legend(drawing: Drawing, axes: Sequence[Axes], per_row: int, left: float) -> None:
    """Draw one legend above all panels; `per_row`: entries per row; `left`: its left end [share of the width]."""
    entries: dict[str, Artist] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    drawing.legend(
        list(entries.values()),
        list(entries),
        loc="upper left",
        bbox_to_anchor=(left, 1.0),
        ncols=per_row,
        borderpad=0.0,
        borderaxespad=0.2,
        handlelength=2.2,
        columnspacing=1.5,
        labelspacing=0.3,
    )
