"""Figures of a study, in the form of the thesis's figures 17 and 18; its figure 19 is the comparison's
`figures/positions.png`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from hric_bags.reader import FloatArray
from hric_experiments.report.drawing import INCH, STYLE, save
from hric_experiments.report.figure import Curve, Figure, Panel
from hric_experiments.report.style import DOUBLE, SINGLE

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

AXES = ("#b3261e", "#2e7d32", "#1f5fa8")
AXIS_LENGTH = 0.07
"""Of the drawn frames [m]."""


def times(of_runs: Mapping[str, FloatArray]) -> Figure:
    """Thesis fig. 17: the time that the control law saw, over its calls."""
    panels = []
    for name, time in of_runs.items():
        back = int(np.count_nonzero(np.diff(time) <= 0.0))
        calls = Curve("", "samples", np.arange(len(time), dtype=float), time)
        panels.append(Panel(f"{name}: {back} steps back", (calls,)))
    return Figure(
        "law_times",
        "Time of the law",
        "time seen by the law [s]",
        tuple(panels),
        abscissa="call of the law",
        caption="Time that the control law saw at each of its calls.",
    )


def draw_poses(folder: Path, poses: Mapping[str, Mapping[str, FloatArray]], title: str) -> Path:
    """Thesis fig. 18: the link frames at the start, as each engine has them."""
    folder.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE):
        width = DOUBLE if len(poses) > 1 else SINGLE
        figure = plt.figure(figsize=(width / INCH, min(SINGLE, width / len(poses)) / INCH))
        for i, (name, frames) in enumerate(poses.items(), 1):
            ax: Axes3D = figure.add_subplot(1, len(poses), i, projection="3d")
            _draw_frames(ax, list(frames.values()))
            ax.set_title(name, loc="left")
        figure.subplots_adjust(left=0.02, right=0.94, bottom=0.06, top=0.92, wspace=0.15)
        return save(figure, folder / "initial_poses.png", f"{title}: initial pose")


def _draw_frames(ax: Axes3D, frames: list[FloatArray]) -> None:
    origins = np.array([T[:3, 3] for T in frames])
    ax.plot(*origins.T, "-o", color="#222222", linewidth=2.0, markersize=3.0)
    for T in frames:
        for axis, color in enumerate(AXES):
            line = np.stack([T[:3, 3], T[:3, 3] + AXIS_LENGTH * T[:3, axis]])
            ax.plot(*line.T, color=color, linewidth=1.2)
    middle, half = origins.mean(axis=0), max(0.5 * float(np.ptp(origins, axis=0).max()), 0.1) + AXIS_LENGTH
    for limits, value in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), middle, strict=True):
        limits(value - half, value + half)
    ax.set_box_aspect((1.0, 1.0, 1.0))
    for label, letter in zip((ax.set_xlabel, ax.set_ylabel, ax.set_zlabel), "xyz", strict=True):
        label(f"{letter} [m]")
