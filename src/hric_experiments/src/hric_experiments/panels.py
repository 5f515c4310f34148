"""What the figures share: style, one panel per joint, one legend."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = npt.NDArray[np.float64]
MEASURED, WANTED, PROFILE, RAW, LIMIT = "#1f5fa8", "#222222", "#d98c1f", "#d9a7a0", "#b3261e"
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
COLUMNS = 2


def save(figure: Figure, path: Path) -> Path:
    """Write a figure, whole or not at all, and close it."""
    temporary = path.with_name(f".{path.stem}.tmp.png")
    figure.savefig(temporary, dpi=130, metadata={"Software": None})
    plt.close(figure)
    temporary.replace(path)
    return path


def panels(joint_names: Sequence[str], time: FloatArray, title: str, unit: str) -> tuple[Figure, list[Axes]]:
    """A figure with one panel per joint and an empty one behind them where the number is odd.

    Args:
        joint_names: one panel each.
        time: its ends are those of the time axis [s].
        title: above the figure.
        unit: label of the vertical axes.
    """
    count = len(joint_names)
    rows = -(-count // COLUMNS)
    width, height = 11.0, 1.3 + 2.0 * rows
    # Fixed margins in inches: matplotlib's own layout engines take longer than all the drawing.
    margins = {"left": 0.85 / width, "right": 1 - 0.2 / width, "bottom": 0.75 / height, "top": 1 - 0.75 / height, "wspace": 0.2, "hspace": 0.32}
    figure, grid = plt.subplots(rows, COLUMNS, figsize=(width, height), sharex=True, squeeze=False, gridspec_kw=margins)
    figure.suptitle(title, fontsize=12, y=1 - 0.25 / height)
    axes = list(grid.flat)
    for i, ax in enumerate(axes):
        if i >= count:
            ax.set_axis_off()
            continue
        ax.set_title(joint_names[i], loc="left", y=1.0)
        ax.set_ylabel(unit)
        if i + COLUMNS >= count:
            ax.tick_params(labelbottom=True)
            ax.set_xlabel("time [s]")
    axes[0].set_xlim(time[0], time[-1])
    return figure, axes


def legend(figure: Figure, axes: list[Axes], count: int) -> None:
    """One legend for all panels: in the empty panel if there is one, else below the title."""
    entries: dict[str, Any] = {}
    for ax in axes[:count]:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if len(axes) > count:
        axes[count].legend(list(entries.values()), list(entries), loc="center", fontsize=10)
    else:
        figure.legend(list(entries.values()), list(entries), loc="lower center", ncols=len(entries))


def widen(ax: Axes, least: float) -> None:
    """At least this much height, so that rounding errors do not fill a panel."""
    low, high = ax.get_ylim()
    if high - low < least:
        middle = 0.5 * (low + high)
        ax.set_ylim(middle - 0.5 * least, middle + 0.5 * least)
