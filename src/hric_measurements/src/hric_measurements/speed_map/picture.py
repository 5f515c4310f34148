"""Picture of a speed map: for each height, the lowest limit speed over all directions at each point."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from hric_assessment.findings import DISCLAIMER
from hric_measurements.speed_map.measured import MapCell, alone, by_height
from hric_report import style
from hric_report.drawing import INCH, STYLE, save

COLOURS = "viridis"
COLUMNS = 3
"""Maximum number of panels (one per height) in a row."""
BESIDE, BETWEEN, BELOW = 30.0, 11.0, 14.0
"""Space for the colour scale, around each row of panels, and for title and note [mm]."""
MARGIN = 0.5
"""Margin around the outermost points, as multiple of the distance between points."""


def draw(path: Path, cells_by_point: Mapping[tuple[float, ...], list[MapCell]], title: str) -> None:
    """Write the picture of a speed map as PNG and SVG.

    Args:
        path: path of the PNG file.
        cells_by_point: results in all directions, by point (x, y, z) [m].
        title: region, arm and limit, for the title.
    """
    heights = by_height(cells_by_point)
    speeds = [cell.speed for cells in heights.values() for cell in cells]
    low, high = min(speeds), max(max(speeds), min(speeds) + 1e-3)
    lines = {axis: sorted({point[axis] for point in cells_by_point}) for axis in (0, 1)}
    columns = min(len(heights), COLUMNS)
    rows = -(-len(heights) // columns)
    panel = (style.DOUBLE - BESIDE) / columns
    tall = panel * max(0.25, np.ptp(_edges(lines[0])) / np.ptp(_edges(lines[1]))) + BETWEEN
    with plt.rc_context({**STYLE, "axes.grid": False}):
        drawing, axes = plt.subplots(
            rows,
            columns,
            figsize=(style.DOUBLE / INCH, (rows * tall + BELOW) / INCH),
            sharex=True,
            sharey=True,
            squeeze=False,
            layout="constrained",
        )
        for ax in axes.flat[len(heights) :]:
            ax.set_axis_off()
        for ax, (height, cells) in zip(axes.flat, heights.items(), strict=False):
            _level(ax, cells, lines, (low, high))
            ax.set_title(f"z = {height:.2f} m")
            ax.set_xlabel("y [m]")
        for row in axes:
            row[0].set_ylabel("x [m]")
        scale = plt.cm.ScalarMappable(plt.Normalize(low, high), COLOURS)
        drawing.colorbar(scale, ax=axes, label="lowest limit speed [m/s]", shrink=0.9)
        drawing.suptitle(f"Estimated limit speed: {title}", fontsize=style.TYPE + 1.0, fontweight="bold")
        drawing.supxlabel(
            "Below each speed: direction of the lowest limit. *: above the arm's own maximum speed there.\n"
            f"{DISCLAIMER}",
            fontsize=style.TYPE - 1.5,
            color="0.35",
        )
        save(drawing, path, f"Estimated limit speed over the workspace, {title}. {DISCLAIMER}")


def _level(ax: Axes, cells: list[MapCell], lines: Mapping[int, list[float]], ends: tuple[float, float]) -> None:
    """Draw the panel of one height: x upwards, y to the left, as seen from the base along x."""
    xs, ys = lines[0], lines[1]
    image = np.full((len(xs), len(ys)), np.nan)
    for cell in cells:
        image[xs.index(float(cell.point[0])), ys.index(float(cell.point[1]))] = cell.speed
    edges = [_edges(ys), _edges(xs)]
    ax.pcolormesh(*edges, image, cmap=COLOURS, vmin=ends[0], vmax=ends[1])
    ax.set_xlim(edges[0][-1], edges[0][0])
    ax.set_ylim(edges[1][0], edges[1][-1])
    ax.set_aspect("equal")
    for cell in cells:
        dark = cell.speed < 0.5 * (ends[0] + ends[1])
        words = f"{cell.speed:.2f}{'' if alone(cell) else '*'}\n{cell.direction}"
        ax.text(cell.point[1], cell.point[0], words, ha="center", va="center", size=5.0, color="w" if dark else "k")


def _edges(values: list[float]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return the edges of the grid cells along an axis: midway between its points, and beyond both ends."""
    if len(values) == 1:
        return np.array([values[0] - 0.05, values[0] + 0.05])
    middles = 0.5 * (np.array(values[1:]) + np.array(values[:-1]))
    first, last = values[0] - MARGIN * (values[1] - values[0]), values[-1] + MARGIN * (values[-1] - values[-2])
    return np.array([first, *middles, last])
