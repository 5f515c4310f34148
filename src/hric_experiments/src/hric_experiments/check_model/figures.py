"""Figures of a model check: measured and modelled torque, their residual, and friction over velocity."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from franka_hw_interface.friction_fit import JointFriction
from franka_hw_interface.model_check import ModelCheck
from hric_control.plants import Phi, sigmoid_torque
from hric_report import drawing
from hric_report.figure import Curve, Figure, per_joint

POINTS, LINE_POINTS = 6000, 300
"""Maximum number of points of a curve over time, and number of points with which a friction law is drawn."""


def draw_all(
    folder: Path, check: ModelCheck, friction: Sequence[Phi] | None, fits: Sequence[JointFriction], title: str
) -> list[Path]:
    """Draw all figures of a model check into a folder.

    Args:
        folder: target folder of the PNG and SVG files.
        check: comparison of log and model.
        friction: friction parameters of the model, by joint; None: no friction.
        fits: fitted friction of each joint; empty: none was fitted.
        title: name of the log, for the captions.

    Returns:
        The PNG files.
    """
    part = slice(None, None, -(-len(check.time) // POINTS))
    time, unit, names = check.time[part], "torque [N m]", check.joint_names
    measured = Curve("measured", "raw", time, check.measured[part])
    modelled = Curve("modelled", "measured", time, check.modelled[part])
    residual = Curve("residual", "measured", time, check.residual[part])
    figures = [
        per_joint("torques", "Torque", unit, names, [measured, modelled], min_height=0.2),
        per_joint("residuals", "Measured minus modelled torque", unit, names, [residual], min_height=0.2),
        _friction(check, friction, fits, part),
    ]
    return drawing.draw(folder, figures, title)


def _friction(check: ModelCheck, friction: Sequence[Phi] | None, fits: Sequence[JointFriction], part: slice) -> Figure:
    rest = (check.measured - check.rigid[check.signals.valid])[part]
    velocity = np.linspace(check.velocity.min(axis=0), check.velocity.max(axis=0), LINE_POINTS)
    curves = [Curve("measured minus M ddq + C dq + g", "samples", check.velocity[part], rest)]
    laws = {
        ("friction of the model", "setpoint"): friction or (),
        ("fitted", "desired"): [fit.phi if fit.fitted else None for fit in fits],
    }
    for (name, role), law in laws.items():
        torque = np.full_like(velocity, np.nan)
        for j, phi in enumerate(law):
            if phi is not None:
                torque[:, j] = sigmoid_torque(velocity[:, j], phi)
        curves.append(Curve(name, role, velocity, torque))
    abscissa = "velocity [rad/s]"
    return per_joint(
        "friction", "Friction", "torque [N m]", check.joint_names, curves, min_height=0.2, abscissa=abscissa
    )
