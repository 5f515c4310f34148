"""Figures of a comparison (PNG), in the form of the thesis's figures 13 and 14."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from hric_experiments.comparison import Comparison, FloatArray, Overlay, difference_metrics
from hric_experiments.panels import MEASURED, STYLE, WANTED, legend, panels, save, widen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OTHER = "#d9601f"


def draw_all(folder: Path, compared: Comparison, labels: tuple[str, str], joint: int, title: str) -> list[Path]:
    """Draw all figures into a folder.

    Args:
        folder: where the PNG files go.
        compared: the runs laid over each other.
        labels: what to call them.
        joint: column of the joint that is shown large.
        title: above each figure.

    Returns:
        The files.
    """
    with plt.rc_context(STYLE):
        figures = {
            "joint_states": _joint_states(compared, labels, joint, title),
            "positions": _positions(compared, labels, title),
            "differences": _differences(compared, labels, title),
        }
        return [save(figure, folder / f"{name}.png") for name, figure in figures.items()]


def _time(compared: Comparison, laid: Overlay) -> FloatArray:
    """Time since the first set point, in run A [s]."""
    time: FloatArray = laid.time + laid.start_a - compared.overlays[0].start_a
    return time


def _span(compared: Comparison) -> FloatArray:
    return np.concatenate([_time(compared, laid) for laid in compared.overlays])


def _both(ax: Axes, compared: Comparison, labels: tuple[str, str], joint: int, what: str) -> None:
    for laid in compared.overlays:
        time = _time(compared, laid)
        if what == "position" and laid.target is not None:
            ax.plot(time[[0, -1]], laid.target[[joint, joint]], color=WANTED, linestyle="--", linewidth=1.0, label="set point")
        ax.plot(time, getattr(laid, f"{what}_a")[:, joint], color=MEASURED, label=labels[0])
        ax.plot(time, getattr(laid, f"{what}_b")[:, joint], color=OTHER, linestyle=(0, (5, 2)), label=labels[1])


def _joint_states(compared: Comparison, labels: tuple[str, str], joint: int, title: str) -> Figure:
    """Thesis fig. 13: position and desired torque of one joint."""
    rows = 2 if compared.effort[joint] else 1
    grid = {"left": 0.09, "right": 0.97, "bottom": 0.15 / rows + 0.04, "top": 0.9, "hspace": 0.3}
    figure: Figure
    figure, axes = plt.subplots(rows, 1, figsize=(9.0, 1.5 + 2.8 * rows), sharex=True, squeeze=False, gridspec_kw=grid)
    name = compared.joint_names[joint]
    figure.suptitle(f"{title}: {name}", fontsize=12)
    for ax, what, unit in zip(axes[:, 0], ("position", "command"), ("(a) position [rad]", "(b) desired torque [N m]"), strict=False):
        _both(ax, compared, labels, joint, what)
        ax.set_ylabel(unit)
        ax.set_title(_numbers(compared, joint, "" if what == "position" else "effort_"), loc="left")
        widen(ax, 0.02)
    span = _span(compared)
    axes[0, 0].set_xlim(span[0], span[-1])
    axes[-1, 0].set_xlabel("time since the set point [s]")
    legend(figure, list(axes[:, 0]), rows)
    return figure


def _numbers(compared: Comparison, joint: int, kind: str) -> str:
    """What the thesis reads from its figure 13, for each set point."""
    found = []
    for move in difference_metrics(compared):
        one = move["joints"][compared.joint_names[joint]]
        peak, at, steady = (one[f"{kind}{key}"] for key in ("peak_difference", "peak_time", "steady_difference"))
        found.append(f"largest difference {abs(peak):.4g} at {at:.3f} s, steady {steady:.2g}")
    return "; ".join(found)


def _positions(compared: Comparison, labels: tuple[str, str], title: str) -> Figure:
    """Thesis fig. 14: positions of all joints."""
    figure, axes = panels(compared.joint_names, _span(compared), f"{title}: joint positions", "position [rad]")
    for j in range(len(compared.joint_names)):
        _both(axes[j], compared, labels, j, "position")
        widen(axes[j], 0.02)
    legend(figure, axes, len(compared.joint_names))
    return figure


def _differences(compared: Comparison, labels: tuple[str, str], title: str) -> Figure:
    figure, axes = panels(compared.joint_names, _span(compared), f"{title}: difference of the positions", "difference [rad]")
    for j in range(len(compared.joint_names)):
        for laid in compared.overlays:
            difference = laid.position_a[:, j] - laid.position_b[:, j]
            axes[j].plot(_time(compared, laid), difference, color=MEASURED, label=f"{labels[0]} minus {labels[1]}")
        axes[j].axhline(0.0, color=WANTED, linewidth=0.8)
        widen(axes[j], 1e-6)
    legend(figure, axes, len(compared.joint_names))
    return figure
