"""Figures of a run (PNG): one panel per joint, the same colours in all of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

from hric_experiments.bag_reader import ControlRecord, RunRecord
from hric_experiments.metrics import Move, rate
from hric_experiments.panels import LIMIT, MEASURED, PROFILE, RAW, STYLE, WANTED, legend, panels, save, widen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = npt.NDArray[np.float64]
Limits = Mapping[str, Mapping[str, float]]


def draw_all(folder: Path, record: RunRecord, moves: list[Move], limits: Limits, title: str, tolerances: tuple[float, ...]) -> list[Path]:
    """Draw all figures into a folder.

    Args:
        folder: where the PNG files go.
        record: the run.
        moves: its set points.
        limits: limits per joint.
        title: name of the run, above each figure.
        tolerances: bands shown in the error figure [rad].

    Returns:
        The files.
    """
    log = record.log
    with plt.rc_context(STYLE):
        figures = {
            "positions": _positions(record, moves, limits, title),
            "velocities": _velocities(log, limits, title),
        }
        if "effort" in log.interfaces:
            figures["torques"] = _torques(log, limits, title)
            figures["rotatum"] = _rotatum(log, limits, title)
        if moves:
            figures["errors"] = _errors(log, moves, title, tolerances)
        return [save(figure, folder / f"{name}.png") for name, figure in figures.items()]


def _bound(ax: Axes, value: float | None, label: str) -> None:
    """A limit line, only where it does not flatten the curves."""
    if value is None or not np.isfinite(value):
        return
    low, high = ax.get_ylim()
    margin = 0.6 * (high - low)
    if low - margin <= value <= high + margin:
        ax.axhline(value, color=LIMIT, linestyle=":", linewidth=1.2, label=label)


def _wanted(log: ControlRecord, moves: list[Move], joint: int) -> tuple[FloatArray, FloatArray]:
    times: list[float] = []
    values: list[float] = []
    for move in moves:
        times += [float(log.time[move.first]), float(log.time[move.last - 1])]
        values += [float(move.target[joint])] * 2
    return np.array(times), np.array(values)


def _positions(record: RunRecord, moves: list[Move], limits: Limits, title: str) -> Figure:
    log = record.log
    figure, axes = panels(log.joint_names, log.time, f"{title}: joint positions", "position [rad]")
    for j, name in enumerate(log.joint_names):
        ax = axes[j]
        if moves:
            ax.plot(*_wanted(log, moves, j), color=WANTED, linestyle="--", linewidth=1.0, label="set point")
        for times, desired, names in record.profiles.values():
            if name in names:
                ax.plot(times, desired[:, names.index(name)], color=PROFILE, linewidth=2.4, alpha=0.7, label="desired (profile)")
        ax.plot(log.time, log.position[:, j], color=MEASURED, label="measured")
        widen(ax, 0.02)
        for key in ("lower", "upper"):
            _bound(ax, limits.get(name, {}).get(key), "position limit")
    legend(figure, axes, len(log.joint_names))
    return figure


def _velocities(log: ControlRecord, limits: Limits, title: str) -> Figure:
    figure, axes = panels(log.joint_names, log.time, f"{title}: joint velocities", "velocity [rad/s]")
    for j, name in enumerate(log.joint_names):
        axes[j].plot(log.time, log.velocity[:, j], color=MEASURED, label="measured")
        widen(axes[j], 0.02)
        _both(axes[j], limits.get(name, {}).get("velocity"), "velocity limit")
    legend(figure, axes, len(log.joint_names))
    return figure


def _both(ax: Axes, bound: float | None, label: str) -> None:
    if bound is not None:
        _bound(ax, bound, label)
        _bound(ax, -bound, label)


def _torques(log: ControlRecord, limits: Limits, title: str) -> Figure:
    figure, axes = panels(log.joint_names, log.time, f"{title}: commanded torques", "torque [N m]")
    for j, name in enumerate(log.joint_names):
        ax = axes[j]
        ax.plot(log.time, log.command_raw[:, j], color=RAW, linewidth=2.2, label="asked for")
        ax.plot(log.time, log.command[:, j], color=MEASURED, linewidth=1.0, label="sent (after the limits)")
        widen(ax, 0.2)
        _focus(ax, log.command[:, j])
        _both(ax, limits.get(name, {}).get("effort"), "torque limit")
    legend(figure, axes, len(log.joint_names))
    return figure


def _focus(ax: Axes, sent: FloatArray) -> None:
    """Where more was asked for than could be sent, show what was sent and cut the rest off."""
    low, high = ax.get_ylim()
    span = max(float(np.ptp(sent)), 0.2)
    ax.set_ylim(max(low, float(sent.min()) - span), min(high, float(sent.max()) + span))


def _rotatum(log: ControlRecord, limits: Limits, title: str) -> Figure:
    figure, axes = panels(log.joint_names, log.time, f"{title}: rate of torque (rotatum)", "[N m/s]")
    sent = rate(log.command, log.time)
    for j, name in enumerate(log.joint_names):
        axes[j].plot(log.time, sent[:, j], color=MEASURED, linewidth=0.9, label="sent")
        widen(axes[j], 2.0)
        _both(axes[j], limits.get(name, {}).get("effort_rate"), "rotatum limit")
    legend(figure, axes, len(log.joint_names))
    return figure


def _errors(log: ControlRecord, moves: list[Move], title: str, tolerances: tuple[float, ...]) -> Figure:
    figure: Figure
    figure, ax = plt.subplots(figsize=(11, 5.2), gridspec_kw={"left": 0.08, "right": 0.86, "bottom": 0.1, "top": 0.9})
    figure.suptitle(f"{title}: distance from the set point", fontsize=12)
    colors = plt.colormaps["viridis"](np.linspace(0.0, 0.92, len(log.joint_names)))
    for j, name in enumerate(log.joint_names):
        for k, move in enumerate(moves):
            part = slice(move.first, move.last)
            error = np.maximum(np.abs(move.target[j] - log.position[part, j]), 1e-9)
            ax.semilogy(log.time[part], error, color=colors[j], label=name if k == 0 else None)
    for tolerance in tolerances:
        ax.axhline(tolerance, color=LIMIT, linestyle=":", linewidth=1.2)
        ax.annotate(f"{tolerance:g} rad", (1.0, tolerance), xycoords=("axes fraction", "data"), ha="right", va="bottom", color=LIMIT)
    ax.set_xlim(log.time[0], log.time[-1])
    ax.set_ylim(bottom=1e-8)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("|set point - position| [rad]")
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure
