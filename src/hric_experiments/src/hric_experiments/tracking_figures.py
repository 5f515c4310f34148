"""Figures of a run that followed a marker: marker, desired and actual end effector over time and in space, and the error after the lag."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

from hric_experiments.panels import LIMIT, MEASURED, PROFILE, STYLE, WANTED, legend, panels, save, widen
from hric_experiments.tracking import STEP, Followed
from hric_experiments.tracking_record import TrackingRecord

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = npt.NDArray[np.float64]
AXES = ("x", "y", "z")


def draw_all(folder: Path, data: Followed, record: TrackingRecord, values: Mapping[str, Any], title: str) -> list[Path]:
    """Draw into a folder.

    Args:
        folder: where the PNG files go.
        data: marker and end effector on a common time.
        record: what the bag tells.
        values: of `tracking.metrics`.
        title: name of the run, above each figure.

    Returns:
        The files.
    """
    lag = round((values["lag"] or 0.0) / STEP)
    with plt.rc_context(STYLE):
        figures = {"tracking": _over_time(data, record, lag, title), "tracking_path": _in_space(data, record, lag, title)}
        return [save(figure, folder / f"{name}.png") for name, figure in figures.items()]


def _over_time(data: Followed, record: TrackingRecord, lag: int, title: str) -> Figure:
    names = [f"{axis} of the end effector in {record.base}" for axis in AXES] + [f"distance from the marker {lag * STEP * 1e3:.0f} ms ago"]
    figure, axes = panels(names, data.time, f"{title}: the end effector follows the marker", "position [m]")
    marker, states = data.wanted(0), record.states
    for k in range(3):
        axes[k].plot(data.time, marker[:, k], color=WANTED, linestyle="--", linewidth=1.0, label="marker, from the origins")
        axes[k].plot(states.time, states.desired[:, k], color=PROFILE, linewidth=2.8, alpha=0.7, label="desired")
        axes[k].plot(data.time, data.ee[:, k], color=MEASURED, linewidth=1.0, label="actual")
        widen(axes[k], 0.02)
    errors(axes[3], data, lag, "", MEASURED)
    _shade_losses(axes, record)
    legend(figure, axes, 4)
    return figure


def errors(ax: Axes, data: Followed, lag: int, label: str, color: str) -> None:
    """Length of the error after the lag [mm]."""
    ax.plot(data.time, 1e3 * np.linalg.norm(data.error(lag), axis=1), color=color, linewidth=0.9, label=label)
    ax.set_ylabel("error [mm]")
    ax.set_ylim(bottom=0.0)


def _shade_losses(axes: list[Axes], record: TrackingRecord) -> None:
    states = record.states
    lost = np.array([word == "lost" for word in states.tracking])
    if not lost.any():
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lost.astype(int), [0]])))
    for ax in axes[:4]:
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            label = "marker lost" if begin == edges[0] else None
            ax.axvspan(states.time[begin], states.time[min(end, len(states.time) - 1)], color=LIMIT, alpha=0.12, linewidth=0, label=label)


def _in_space(data: Followed, record: TrackingRecord, lag: int, title: str) -> Figure:
    """The same path seen along each axis, with equal scales."""
    margins = {"left": 0.08, "right": 0.98, "bottom": 0.16, "top": 0.86, "wspace": 0.32}
    figure: Figure
    figure, axes = plt.subplots(1, 3, figsize=(11, 4.4), gridspec_kw=margins)
    figure.suptitle(f"{title}: path of the end effector in {record.base}", fontsize=12)
    wanted, states = data.wanted(lag), record.states
    half = 0.55 * max(float(np.ptp(data.ee, axis=0).max()), float(np.nanmax(np.nanmax(wanted, axis=0) - np.nanmin(wanted, axis=0))), 0.02)
    middle = 0.5 * (data.ee.max(axis=0) + data.ee.min(axis=0))
    for ax, (a, b) in zip(axes, ((0, 1), (0, 2), (1, 2)), strict=True):
        ax.plot(wanted[:, a], wanted[:, b], color=WANTED, linestyle="--", linewidth=1.0, label="marker, from the origins")
        ax.plot(states.desired[:, a], states.desired[:, b], color=PROFILE, linewidth=2.8, alpha=0.7, label="desired")
        ax.plot(data.ee[:, a], data.ee[:, b], color=MEASURED, linewidth=1.0, label="actual")
        ax.set_xlabel(f"{AXES[a]} [m]")
        ax.set_ylabel(f"{AXES[b]} [m]")
        ax.set_xlim(middle[a] - half, middle[a] + half)
        ax.set_ylim(middle[b] - half, middle[b] + half)
        ax.set_aspect("equal")
    legend(figure, list(axes), 3)
    return figure
