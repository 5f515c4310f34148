"""Text report of a model check."""

from collections.abc import Sequence

import numpy as np

from franka_hw_interface.friction_fit import JointFriction
from franka_hw_interface.model_check import ModelCheck, root_mean_square
from hric_bags import text

EXPECTED = (
    "for comparison, a public log of a real arm: 0.07 to 0.58 N m per joint, sum 1.7 N m with the published friction, "
    "2.7 N m without"
)


def render(check: ModelCheck, about: Sequence[str]) -> str:
    """Return the table of residuals per joint and their sum, preceded by the lines `about`."""
    residual = check.residual
    cells = [["joint", "|dq| max", "|tau| max", "residual RMS", "residual max"], ["", "rad/s", "N m", "N m", "N m"]]
    largest = [np.abs(values).max(axis=0) for values in (check.velocity, check.measured, residual)]
    for j, name in enumerate(check.joint_names):
        cells.append([name, *(f"{value:.3f}" for value in (largest[0][j], largest[1][j], check.rms[j], largest[2][j]))])
    cells.append(["sum", "", "", f"{check.rms.sum():.3f}", ""])
    rigid = root_mean_square(check.measured - check.rigid[check.signals.valid]).sum()
    tail = [f"without friction in the model the sum is {rigid:.3f} N m", EXPECTED]
    return "\n".join([*about, "", *_rows(cells), "", *tail]) + "\n"


def render_fit(fits: Sequence[JointFriction]) -> str:
    """Return the table of fitted friction parameters with their standard deviations."""
    cells = [
        ["joint", "phi1", "+-", "phi2", "+-", "phi3", "+-", "breakaway", "residual RMS"],
        ["", "N m", "", "s/rad", "", "rad/s", "", "N m", "N m"],
    ]
    for fit in fits:
        values = [
            text
            for pair in zip(fit.phi, fit.deviation, strict=True)
            for text in (f"{pair[0]:.4f}", f"{pair[1]:.1g}" if fit.fitted else "-")
        ]
        cells.append([fit.joint, *values, f"{fit.breakaway:.3f}", f"{fit.rms:.3f}"])
    cells.append(["sum", *[""] * 7, f"{sum(fit.rms for fit in fits):.3f}"])
    notes = [f"{fit.joint}: {fit.summary()}" for fit in fits if not fit.fitted or fit.loose()]
    return (
        "\n".join(
            [
                "fitted friction (+-: standard deviation, estimated from residual and bandwidth)",
                "",
                *_rows(cells),
                *(["", *notes] if notes else []),
            ]
        )
        + "\n"
    )


def _rows(cells: list[list[str]]) -> list[str]:
    lines = list(text.rows(cells))
    lines[1], lines[2] = lines[2], lines[1]
    return lines
