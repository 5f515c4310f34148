"""Heat maps for many similar signals, with one row of colours over time per signal: data, and drawing for print."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hric_bags.reader import FloatArray
from hric_report import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

COLUMNS = 600
"""Maximum number of columns of a heat map; a column shows the largest value in its time span. Project default."""
ROW_HEIGHT, LETTER = 2.7, 1.15
"""Height of a row, and assumed width of a letter of the row's name [mm]."""
BELOW, ABOVE, SCALE, BAR = 9.5, 2.0, 17.0, 3.0
"""Margins below and above, margin on the right for the colour scale, and width of the scale [mm]."""
INCH = 25.4
"""Length of an inch [mm]."""


@dataclass(frozen=True)
class HeatMap:
    """Heat map of k signals at n instants.

    Attributes:
        rows: names of the signals, from top to bottom.
        time: increasing times, shape (n,) [s].
        values: values, shape (n, k); NaN: not known.
        unit: quantity and unit of the values, such as "activation [1]".
        scale: colour scale as pairs of value and colour; values above the last one have its colour.
    """

    rows: tuple[str, ...]
    time: FloatArray
    values: FloatArray
    unit: str
    scale: style.Stops

    @property
    def top(self) -> float:
        """Largest value of the colour scale."""
        return self.scale[-1][0]


def heat_map(rows: tuple[str, ...], time: FloatArray, values: FloatArray, unit: str, scale: style.Stops) -> HeatMap:
    """Return the heat map of values of shape (n, k), reduced to at most COLUMNS instants by their maxima."""
    if len(time) > COLUMNS:
        first = np.linspace(0, len(time), COLUMNS + 1).astype(np.int64)[:-1]
        time, values = time[first], np.fmax.reduceat(values, first, axis=0)
    return HeatMap(rows, time, values, unit, scale)


def drawn(heat: HeatMap, abscissa: str) -> Drawing:
    """Draw a heat map for print, two journal columns wide; `abscissa`: label of the time axis."""
    import matplotlib.pyplot as plt
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    count, width, left = len(heat.rows), style.DOUBLE, 4.0 + LETTER * max(map(len, heat.rows))
    height = BELOW + ABOVE + ROW_HEIGHT * count
    drawing: Drawing
    drawing, ax = plt.subplots(figsize=(width / INCH, height / INCH))
    right, tall = (left, width - SCALE), ROW_HEIGHT * count / height
    ax.set_position((right[0] / width, BELOW / height, (right[1] - right[0]) / width, tall))
    shares = [(value / heat.top, colour) for value, colour in heat.scale]
    colours, norm = LinearSegmentedColormap.from_list("scale", shares), Normalize(0.0, heat.top)
    ends = heat.time[0], heat.time[-1]
    ax.imshow(heat.values.T, aspect="auto", interpolation="nearest", cmap=colours, norm=norm, extent=(*ends, count, 0))
    ax.set_yticks(np.arange(count) + 0.5, heat.rows, fontsize=style.TYPE - 1.5)
    ax.tick_params(axis="y", length=0.0)
    ax.grid(visible=False)
    ax.set_xlabel(abscissa)
    scale_axes = drawing.add_axes(((right[1] + 3.0) / width, BELOW / height, BAR / width, tall))
    drawing.colorbar(ScalarMappable(norm, colours), cax=scale_axes, extend="max").set_label(heat.unit)
    return drawing
