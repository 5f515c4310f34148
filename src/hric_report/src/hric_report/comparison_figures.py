"""Figures of the comparison of two runs, like figures 13 and 14 of the thesis."""

from collections.abc import Sequence

import numpy as np

from hric_analysis.comparison import Comparison, difference_metrics
from hric_report import sections
from hric_report.figure import Curve, Figure, FloatArray, Panel, per_joint

SINCE = "time since the setpoint [s]"


def pair_figures(compared: Comparison, labels: tuple[str, str], joint: int) -> list[Figure]:
    """Return the figures of a comparison: position and torque of one joint, all positions, position differences.

    Args:
        compared: the two runs, aligned in time.
        labels: labels of the runs.
        joint: index of the joint for the first figure.
    """
    name, parts = compared.joint_names[joint], compared.overlays
    time = time_of(compared)
    ends = np.concatenate([part.time[[0, -1]] + part.start_a - parts[0].start_a for part in parts])
    targets = [part.target for part in parts if part.target is not None for _ in range(2)]
    position = [Curve("setpoint", "setpoint", ends, np.array(targets))] if targets else []
    position += [
        Curve(labels[0], "measured", time, np.concatenate([part.position_a for part in parts])),
        Curve(labels[1], "other", time, np.concatenate([part.position_b for part in parts])),
    ]
    command = [
        Curve(labels[0], "measured", time, np.concatenate([part.command_a for part in parts])),
        Curve(labels[1], "other", time, np.concatenate([part.command_b for part in parts])),
    ]
    shown = [("(a) position [rad]", "", position), ("(b) desired torque [N m]", "effort_", command)]
    panels = tuple(
        Panel(_largest(compared, name, kind), tuple(curve.column(joint) for curve in curves), unit=unit)
        for unit, kind, curves in shown[: 2 if compared.effort[joint] else 1]
    )
    states = Figure("joint_states", name, "", panels, 0.02, columns=1, abscissa=SINCE)
    unit, names = "position [rad]", compared.joint_names
    positions = per_joint("positions", "Joint positions", unit, names, position, min_height=0.02, abscissa=SINCE)
    return [
        states.about(sections.FORCES, "Position and desired torque of one joint in both runs."),
        positions.about(sections.MOTION, "Joint positions in both runs, aligned in time at each setpoint."),
        differences([(f"{labels[0]} minus {labels[1]}", "measured", compared)]),
    ]


def time_of(compared: Comparison) -> FloatArray:
    """Return the times at which both runs have data, counted from the first setpoint of run A, shape (n,) [s]."""
    parts = compared.overlays
    return np.concatenate([part.time + part.start_a - parts[0].start_a for part in parts])


def differences(pairs: Sequence[tuple[str, str, Comparison]]) -> Figure:
    """Return the figure of joint position differences, first run minus other run.

    `pairs`: name, role and compared runs of each curve.
    """
    curves = [
        Curve(name, role, time_of(pair), np.concatenate([part.position_a - part.position_b for part in pair.overlays]))
        for name, role, pair in pairs
    ]
    names = pairs[0][2].joint_names
    title, unit = "Differences of the positions", "difference [rad]"
    figure = per_joint("differences", title, unit, names, curves, min_height=1e-6, abscissa=SINCE)
    return figure.about(
        sections.RESULTS, "Position of each joint in the first run minus its position in the other run."
    )


def _largest(compared: Comparison, joint: str, kind: str) -> str:
    """Return peak and steady-state difference of a joint after each setpoint, as text; `kind`: "" or "effort_"."""
    texts = []
    for move in difference_metrics(compared):
        difference = move.joints[joint]
        keys = ("peak_difference", "peak_time", "steady_difference")
        peak, at, steady = (getattr(difference, f"{kind}{key}") for key in keys)
        texts.append(f"largest difference {abs(peak):.4g} at {at:.3f} s, steady {steady:.2g}")
    return "; ".join(texts)
