"""Draws figures as PNG."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from hric_bags import files
from hric_experiments.report.figure import Figure, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

MEASURED, SETPOINT, DESIRED, RAW, LIMIT = "#1f5fa8", "#222222", "#d98c1f", "#d9a7a0", "#b3261e"
ALIKE = (MEASURED, "#d9601f", "#2c8c4a", "#8a4fb5", "#a86f1f", "#c23b7a", "#1c8f96", "#6b7280", "#7d8f1a", "#4a4fd0")
STYLES: dict[str, dict[str, Any]] = {
    "measured": {"color": MEASURED, "linewidth": 1.1},
    "setpoint": {"color": SETPOINT, "linewidth": 1.0, "linestyle": "--"},
    "desired": {"color": DESIRED, "linewidth": 2.6, "alpha": 0.7},
    "raw": {"color": RAW, "linewidth": 2.3},
    "other": {"color": ALIKE[1], "linestyle": (0, (5, 2))},
    "samples": {"color": RAW, "linestyle": "none", "marker": ".", "markersize": 1.5},
    **{f"s{k}": {"color": color} for k, color in enumerate(ALIKE)},
}
"""Of a curve's role; the colours are those of page.css."""
STYLE = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "font.size": 9,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
}
WIDTH, ROW, TALL_ROW, MARGIN = 11.0, 2.0, 3.1, 0.75
"""Of a figure, of a row of two panels, of another row, above and below the panels [inch]."""


def draw(folder: Path, figures: Iterable[Figure], title: str) -> list[Path]:
    """Draw figures into a folder, `<key>.png` each; one without panels is left out.

    Args:
        folder: where the files go.
        figures: what to draw.
        title: of the run, above each figure.

    Returns:
        The files.
    """
    with plt.rc_context(STYLE):
        return [save(_drawn(figure, title), folder / f"{figure.key}.png") for figure in figures if figure.panels]


def save(drawing: Drawing, path: Path) -> Path:
    """Write a drawing, whole or not at all, and close it."""
    with files.atomic(path) as temporary:
        drawing.savefig(temporary, dpi=130, metadata={"Software": None})
    plt.close(drawing)
    return path


def _drawn(figure: Figure, title: str) -> Drawing:
    count = len(figure.panels)
    columns = min(figure.columns, count)
    rows = -(-count // columns)
    height = 2 * MARGIN + (ROW if columns == 2 else TALL_ROW) * rows
    # Fixed margins: matplotlib's own layout engines take longer than all the drawing.
    margins = {"left": 0.85 / WIDTH, "right": 1 - 0.2 / WIDTH, "bottom": MARGIN / height, "top": 1 - MARGIN / height}
    drawing: Drawing
    drawing, grid = plt.subplots(
        rows,
        columns,
        figsize=(WIDTH, height),
        sharex=not figure.equal,
        squeeze=False,
        gridspec_kw={**margins, "wspace": 0.3 if figure.equal else 0.2, "hspace": 0.32},
    )
    drawing.suptitle(f"{title}: {figure.title[0].lower()}{figure.title[1:]}", fontsize=12, y=1 - 0.25 / height)
    axes = list(grid.flat)
    for k, (ax, panel) in enumerate(zip(axes, figure.panels, strict=False)):
        _draw_panel(ax, figure, panel)
        if k + columns >= count:
            ax.tick_params(labelbottom=True)
            ax.set_xlabel(panel.abscissa or figure.abscissa)
    for ax in axes[count:]:
        ax.set_axis_off()
    legend(drawing, axes, count)
    return drawing


def _draw_panel(ax: Axes, figure: Figure, panel: Panel) -> None:
    for curve in panel.curves:
        ax.plot(curve.time, curve.values, label=curve.name, **STYLES[curve.role])
    for name, begin, end in figure.bands:
        ax.axvspan(begin, end, color=LIMIT, alpha=0.12, linewidth=0, label=name)
    ax.set_title(panel.title, loc="left", y=1.0)
    ax.set_ylabel(panel.unit or figure.unit)
    ax.margins(x=0.0)
    ax.set_yscale("log" if figure.logarithmic else "linear")
    low, high = figure.vertical_range(panel)
    ax.set_ylim(low, high)
    if figure.equal:
        middle, half = 0.5 * sum(ax.dataLim.intervalx), 0.5 * (high - low)
        ax.set_xlim(middle - half, middle + half)
        ax.set_aspect("equal")
    elif low < 0.0 < high:
        ax.axhline(0.0, color=SETPOINT, linewidth=0.8, alpha=0.3)
    for name, bound in panel.bounds:
        if low <= bound <= high:
            ax.axhline(bound, color=LIMIT, linestyle=":", linewidth=1.2)
            ax.annotate(name, (1.0, bound), xycoords=("axes fraction", "data"), ha="right", va="bottom", color=LIMIT)


def legend(drawing: Drawing, axes: list[Axes], count: int) -> None:
    """One legend for all panels: in the empty one if there is one, else below them."""
    entries: dict[str, Any] = {}
    for ax in axes[:count]:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    shown = list(entries.values()), list(entries)
    if len(axes) > count:
        axes[count].legend(*shown, loc="center", fontsize=10)
    else:
        drawing.legend(*shown, loc="lower center", ncols=len(entries))
