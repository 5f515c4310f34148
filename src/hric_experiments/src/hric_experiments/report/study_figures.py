"""Figures of a study (PNG), in the form of the thesis's figures 17 and 18; its figure 19 is the comparison's
`positions.png`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from hric_bags.reader import FloatArray
from hric_experiments.report.figure import Curve, Figure, Panel
from hric_experiments.report.png import STYLE, draw, save

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

AXES = ("#b3261e", "#2e7d32", "#1f5fa8")
AXIS_LENGTH = 0.07
"""Of the drawn frames [m]."""


def draw_times(folder: Path, times: Mapping[str, FloatArray], title: str) -> Path:
    """Thesis fig. 17: the time that the control law saw, over its calls."""
    folder.mkdir(parents=True, exist_ok=True)
    panels = []
    for name, time in times.items():
        back = int(np.count_nonzero(np.diff(time) <= 0.0))
        calls = Curve("", "samples", np.arange(len(time), dtype=float), time)
        panels.append(Panel(f"{name}: {back} steps back", (calls,)))
    unit, abscissa = "time seen by the law [s]", "call of the law"
    (path,) = draw(folder, [Figure("law_times", "Time of the law", unit, tuple(panels), abscissa=abscissa)], title)
    return path


def draw_poses(folder: Path, poses: Mapping[str, Mapping[str, FloatArray]], title: str) -> Path:
    """Thesis fig. 18: the link frames at the start, as each engine has them."""
    folder.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(4.5 * len(poses), 4.8))
        figure.suptitle(f"{title}: initial pose", fontsize=12)
        for i, (name, frames) in enumerate(poses.items(), 1):
            ax: Axes3D = figure.add_subplot(1, len(poses), i, projection="3d")
            _draw_frames(ax, list(frames.values()))
            ax.set_title(name, loc="left")
        figure.subplots_adjust(left=0.02, right=0.94, bottom=0.04, top=0.9, wspace=0.1)
        return save(figure, folder / "initial_poses.png")


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
