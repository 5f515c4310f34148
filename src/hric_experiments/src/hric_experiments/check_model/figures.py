"""Figures of a check (PNG): measured and modelled torque, what is left, and that over the velocity, where friction shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

from franka_hw_interface.friction_fit import JointFriction
from franka_hw_interface.model_check import ModelCheck
from hric_control.plants.friction import Phi, sigmoid_torque
from hric_experiments.panels import MEASURED, PROFILE, RAW, STYLE, WANTED, legend, panels, save, widen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = npt.NDArray[np.float64]
POINTS = 6000
"""Drawn of each curve at most."""


def draw_all(folder: Path, check: ModelCheck, friction: Sequence[Phi] | None, fits: Sequence[JointFriction], title: str) -> list[Path]:
    """Draw all figures into a folder.

    Args:
        folder: where the PNG files go.
        check: the log against the model.
        friction: of the model; None: none.
        fits: fitted friction; empty: none was fitted.
        title: name of the log, above each figure.

    Returns:
        The files.
    """
    with plt.rc_context(STYLE):
        figures = {
            "torques": _over_time(check, f"{title}: torque", ((check.measured, RAW, 2.4, "measured"), (check.modelled, MEASURED, 1.0, "modelled"))),
            "residuals": _over_time(check, f"{title}: measured minus modelled torque", ((check.residual, MEASURED, 1.0, "residual"),)),
            "friction": _friction(check, friction, fits, title),
        }
        return [save(figure, folder / f"{name}.png") for name, figure in figures.items()]


def _thinned(check: ModelCheck) -> slice:
    return slice(None, None, -(-len(check.time) // POINTS))


def _panels(check: ModelCheck, axis: FloatArray, title: str, draw: Callable[[Axes, int], None]) -> Figure:
    """A panel per joint, drawn into by `draw(axes, joint)`."""
    figure, axes = panels(check.joint_names, axis, title, "torque [N m]")
    for j in range(len(check.joint_names)):
        draw(axes[j], j)
        widen(axes[j], 0.2)
    legend(figure, axes, len(check.joint_names))
    return figure


def _over_time(check: ModelCheck, title: str, curves: Sequence[tuple[FloatArray, str, float, str]]) -> Figure:
    part = _thinned(check)

    def draw(ax: Axes, j: int) -> None:
        for values, color, width, label in curves:
            ax.plot(check.time[part], values[part, j], color=color, linewidth=width, label=label)

    return _panels(check, check.time, title, draw)


def _friction(check: ModelCheck, friction: Sequence[Phi] | None, fits: Sequence[JointFriction], title: str) -> Figure:
    part, rigid = _thinned(check), check.rigid[check.signals.kept]
    ends = np.array([check.velocity.min(), check.velocity.max()])

    def draw(ax: Axes, j: int) -> None:
        velocity = np.linspace(check.velocity[:, j].min(), check.velocity[:, j].max(), 300)
        ax.plot(check.velocity[part, j], (check.measured - rigid)[part, j], ".", color=RAW, markersize=1.5, label="measured minus M ddq + C dq + g")
        if friction is not None:
            ax.plot(velocity, sigmoid_torque(velocity, friction[j]), color=WANTED, linestyle="--", label="friction of the model")
        if fits and fits[j].fitted:
            ax.plot(velocity, sigmoid_torque(velocity, fits[j].phi), color=PROFILE, label="fitted")
        if ax.get_xlabel():
            ax.set_xlabel("velocity [rad/s]")

    return _panels(check, ends, f"{title}: friction", draw)
