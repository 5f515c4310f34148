"""Figures of a study: joint positions of all runs, and figures 17 and 18 of the thesis.

Figure 19 of the thesis is `figures/positions.png` in the folder of a comparison.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

from hric_bags.reader import ControlRecord, FloatArray
from hric_report import sections
from hric_report.drawing import INCH, STYLE, save
from hric_report.figure import Curve, Figure, Panel, per_joint
from hric_report.style import ALIKE, DOUBLE, SINGLE

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

AXES = ("#b3261e", "#2e7d32", "#1f5fa8")
AXIS_LENGTH = 0.07
"""Length of the axes with which link frames are drawn [m]."""


def motion(logs: Mapping[str, ControlRecord]) -> list[Figure]:
    """Return figures of all runs' joint positions, and of the difference of each run from the first run."""
    (name, first), *others = logs.items()
    alike = {name: log for name, log in others if log.joint_names == first.joint_names}
    curves = [
        Curve(name, f"s{k % len(ALIKE)}", log.time, log.position)
        for k, (name, log) in enumerate({name: first, **alike}.items())
    ]
    positions = per_joint("positions", "Joint positions", "position [rad]", first.joint_names, curves, min_height=0.02)
    apart = [_apart(curve, curves[0]) for curve in curves[1:]]
    figures = [positions.about(sections.MOTION, "Positions of the joints in all runs.")]
    if apart:
        title, unit = f"Distance from {name}", "largest difference of a joint [rad]"
        caption = f"Largest position difference over all joints, compared with the run {name}; logarithmic axis."
        distance = Figure("distances", title, unit, (Panel("", tuple(apart)),), logarithmic=True, columns=1)
        figures.append(distance.about(sections.RESULTS, caption))
    return figures


def _apart(curve: Curve, first: Curve) -> Curve:
    """Return the largest position difference over all joints, at each sample that both curves have."""
    n = min(len(curve.time), len(first.time))
    largest = np.abs(curve.values[:n] - first.values[:n]).max(axis=1)
    return replace(curve, time=curve.time[:n], values=np.where(largest > 0.0, largest, np.nan))


def times(of_runs: Mapping[str, FloatArray]) -> Figure:
    """Return the figure of the time passed to the control law at each of its calls, by run (thesis fig. 17)."""
    panels = []
    for name, time in of_runs.items():
        back = int(np.count_nonzero(np.diff(time) <= 0.0))
        calls = Curve("", "samples", np.arange(len(time), dtype=float), time)
        panels.append(Panel(f"{name}: {back} steps back", (calls,)))
    return Figure(
        "law_times",
        "Time passed to the control law",
        "time [s]",
        tuple(panels),
        abscissa="call of the control law",
        caption="Time that was passed to the control law at each of its calls.",
    )


def draw_poses(folder: Path, poses: Mapping[str, Mapping[str, FloatArray]], title: str) -> Path:
    """Draw the link frames at the start in each physics engine (thesis fig. 18); return the path of the picture.

    `poses`: T_world_link by link, shape (4, 4), for each engine.
    """
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
            ax.plot(*np.stack([T[:3, 3], T[:3, 3] + AXIS_LENGTH * T[:3, axis]]).T, color=color, linewidth=1.2)
    middle, half = origins.mean(axis=0), max(0.5 * float(np.ptp(origins, axis=0).max()), 0.1) + AXIS_LENGTH
    for limits, value in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), middle, strict=True):
        limits(value - half, value + half)
    ax.set_box_aspect((1.0, 1.0, 1.0))
    for label, letter in zip((ax.set_xlabel, ax.set_ylabel, ax.set_zlabel), "xyz", strict=True):
        label(f"{letter} [m]")
