"""Figures of the robot: joint motion, torques and setpoint errors."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from hric_analysis.metrics import Move, rate
from hric_bags.reader import ControlRecord, RunRecord
from hric_report import sections
from hric_report.figure import Bound, Curve, Figure, Panel, per_joint
from hric_report.figures import FigureData

Limits = Mapping[str, Mapping[str, float]]
MIN_ERROR = 1e-9
"""Smallest error on the logarithmic axis; smaller errors are drawn at this value [rad]. Project default,
unconfirmed."""


def figures(data: FigureData) -> list[Figure]:
    """Return the figures of positions, errors, velocities, torques and torque rates of the joints."""
    log = data.record.log
    velocity = Curve("measured", "measured", log.time, log.velocity)
    bounds = _bounds(data.limits, "velocity limit", "velocity")
    unit = "velocity [rad/s]"
    made = [_positions(data.record, data.moves, data.limits)]
    if data.moves:
        made.append(_errors(log, data.moves, data.tolerances))
    velocities = per_joint("velocities", "Joint velocities", unit, log.joint_names, [velocity], bounds, min_height=0.02)
    made.append(velocities.about(sections.MOTION, "Measured joint velocities. Dotted: velocity limits, if near."))
    return [*made, *_torques(log, data.limits)] if "effort" in log.interfaces else made


def _torques(log: ControlRecord, limits: Limits) -> list[Figure]:
    """Return the figures of the commanded torques and of their rates."""
    names, time = log.joint_names, log.time
    requested = Curve("requested", "raw", time, log.command_raw, cut=True)
    sent = Curve("sent (after the limits)", "measured", time, log.command)
    rates = Curve("sent", "measured", time, rate(log.command, time))
    bounds, unit = _bounds(limits, "torque limit", "effort"), "torque [N m]"
    torques = per_joint("torques", "Commanded torques", unit, names, [requested, sent], bounds, min_height=0.2)
    bounds, unit = _bounds(limits, "rotatum limit", "effort_rate"), "rate [N m/s]"
    of_torques = per_joint("rotatum", "Rate of torque (rotatum)", unit, names, [rates], bounds, min_height=2.0)
    requests = (
        "Torque requested by the controller, and torque sent after the limits were applied. Dotted: limits, if near."
    )
    return [
        torques.about(sections.FORCES, requests),
        of_torques.about(sections.FORCES, "Rate of change of the torque sent, per cycle. Dotted: its limits, if near."),
    ]


def _bounds(limits: Limits, name: str, *keys: str) -> Callable[[str], tuple[Bound, ...]]:
    """Return a function that returns the known limits of a joint; a single key is a limit in both directions."""

    def of_joint(joint: str) -> tuple[Bound, ...]:
        known = limits.get(joint, {})
        values = [float(known[key]) for key in keys if known.get(key) is not None and np.isfinite(known[key])]
        return tuple((name, value) for value in (values if len(keys) > 1 else [*values, *(-value for value in values)]))

    return of_joint


def setpoints(log: ControlRecord, moves: Sequence[Move]) -> list[Curve]:
    """Return the curve of the setpoints of all joints; empty if there were none."""
    times = [float(log.time[k]) for move in moves for k in (move.first, move.last - 1)]
    targets = [move.target for move in moves for _ in range(2)]
    return [Curve("setpoint", "setpoint", np.array(times), np.array(targets))] if moves else []


def _positions(record: RunRecord, moves: Sequence[Move], limits: Limits) -> Figure:
    log = record.log
    curves = setpoints(log, moves)
    for times, desired, known in record.profiles.values():
        unknown = np.full(len(times), np.nan)
        columns = [desired[:, known.index(name)] if name in known else unknown for name in log.joint_names]
        curves.append(Curve("desired (profile)", "desired", times, np.column_stack(columns)))
    curves.append(Curve("measured", "measured", log.time, log.position))
    bounds = _bounds(limits, "position limit", "lower", "upper")
    shown = ["setpoints (dashed)"] * bool(moves) + ["positions of the profile"] * bool(record.profiles)
    caption = f"{', '.join([*shown, 'measured positions']).capitalize()}. Dotted: position limits, if near."
    unit, names = "position [rad]", log.joint_names
    figure = per_joint("positions", "Joint positions", unit, names, curves, bounds, min_height=0.02)
    return figure.about(sections.MOTION, caption)


def _errors(log: ControlRecord, moves: Sequence[Move], tolerances: Sequence[float]) -> Figure:
    error = np.full_like(log.position, np.nan)
    for move in moves:
        part = slice(move.first, move.last)
        error[part] = np.maximum(np.abs(move.target - log.position[part]), MIN_ERROR)
    curves = tuple(Curve(name, f"s{j % 10}", log.time, error[:, j]) for j, name in enumerate(log.joint_names))
    panel = Panel("", curves, tuple((f"{tolerance:g} rad", tolerance) for tolerance in tolerances))
    caption = "Distance of each joint from its setpoint, on a logarithmic axis. Dotted: settling tolerances."
    figure = Figure("errors", "Distance from the setpoint", "distance [rad]", (panel,), logarithmic=True)
    return figure.about(sections.MOTION, caption)
