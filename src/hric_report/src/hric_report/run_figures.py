"""Figures of a run: joint motion, torques, setpoint errors and marker tracking."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hric_analysis.metrics import Move, rate
from hric_analysis.tracking import STEP
from hric_analysis.tracking_record import States
from hric_analysis.tracking_run import Tracking
from hric_bags.reader import ControlRecord, RunRecord
from hric_report import sections
from hric_report.figure import Bound, Curve, Figure, FloatArray, Panel, per_joint

Limits = Mapping[str, Mapping[str, float]]
AXES = ("x", "y", "z")
MIN_ERROR = 1e-9
"""Lower bound of errors on the logarithmic axis; smaller ones are drawn here [rad]. Project default, unconfirmed."""


def robot_figures(
    record: RunRecord, moves: Sequence[Move], limits: Limits, tolerances: Sequence[float]
) -> list[Figure]:
    """Return the figures of positions, errors, velocities, torques and torque rates of the joints.

    Args:
        record: recording of the run.
        moves: setpoints of the run.
        limits: limits by joint.
        tolerances: bounds in the figure of the errors [rad].
    """
    log = record.log
    names, time = log.joint_names, log.time
    velocity = Curve("measured", "measured", time, log.velocity)
    bounds = _bounds(limits, "velocity limit", "velocity")
    unit = "velocity [rad/s]"
    found = [_positions(record, moves, limits)]
    if moves:
        found.append(_errors(log, moves, tolerances))
    velocities = per_joint("velocities", "Joint velocities", unit, names, [velocity], bounds, min_height=0.02)
    found.append(velocities.about(sections.MOTION, "Measured joint velocities. Dotted: velocity limits where near."))
    return [*found, *_torques(log, limits)] if "effort" in log.interfaces else found


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
    requests = "Torque that the controller requested, and what was sent after the limits. Dotted: limits where near."
    return [
        torques.about(sections.FORCES, requests),
        of_torques.about(sections.FORCES, "Rate of the torque sent, per cycle. Dotted: its limits where near."),
    ]


def _bounds(limits: Limits, name: str, *keys: str) -> Callable[[str], tuple[Bound, ...]]:
    """Return a function from joint to its known limits; a single key is a limit in both directions."""

    def of_joint(joint: str) -> tuple[Bound, ...]:
        own = limits.get(joint, {})
        values = [float(own[key]) for key in keys if own.get(key) is not None and np.isfinite(own[key])]
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
    caption = f"{', '.join([*shown, 'measured positions']).capitalize()}. Dotted: position limits where near."
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
    caption = "Distance of each joint from its setpoint, on a logarithmic axis. Dotted: bands of the settling time."
    figure = Figure("errors", "Distance from the setpoint", "distance [rad]", (panel,), logarithmic=True)
    return figure.about(sections.MOTION, caption)


def tracking_figures(found: Tracking | None) -> list[Figure]:
    """Return figures of the end effector that follows a marker, over time and in space; empty without tracking."""
    if found is None or found.data is None:
        return []
    data, record = found.data, found.record
    lag = round((found.values.lag or 0.0) / STEP)
    names = [f"{axis} in {record.base}" for axis in AXES]
    curves = _followed(found, data.desired(0))
    caption = (
        "Position of the marker and of the end effector, each from its origin, and what the controller desired. Last "
        f"panel: distance of the end effector from where the marker was {1e3 * lag * STEP:.0f} ms before, the lag that "
        "fits best."
    )
    over_time = per_joint("tracking", "The end effector follows the marker", "position [m]", names, curves)
    over_time = over_time.about(sections.TRACKING, caption)
    error = Curve("actual", "measured", data.time, 1e3 * np.linalg.norm(data.error(lag), axis=1))
    distance = Panel(f"error after the lag of {1e3 * lag * STEP:.0f} ms", (error,), unit="error [mm]")
    panels, bands = (*over_time.panels, distance), _losses(record.states)
    in_space = _path(_followed(found, data.desired(lag)), f"Path of the end effector in {record.base}")
    return [replace(over_time, panels=panels, bands=bands, min_height=0.02), in_space]


def _followed(found: Tracking, marker: FloatArray) -> list[Curve]:
    """Return the curves of marker, desired and actual end effector, with values of shape (n, 3) [m]."""
    assert found.data is not None
    states, time = found.record.states, found.data.time
    return [
        Curve("marker, from the origins", "setpoint", time, marker),
        Curve("desired", "desired", states.time, states.desired),
        Curve("actual", "measured", time, found.data.ee),
    ]


def _losses(states: States) -> tuple[tuple[str, float, float], ...]:
    """Return the time spans in which the controller had lost the marker."""
    lost = np.array([0, *(word == "lost" for word in states.tracking), 0], dtype=int)
    begins, ends = np.flatnonzero(np.diff(lost) > 0), np.flatnonzero(np.diff(lost) < 0)
    last = len(states.time) - 1
    return tuple(
        ("marker lost", float(states.time[begin]), float(states.time[min(int(end), last)]))
        for begin, end in zip(begins, ends, strict=True)
    )


def _path(curves: Sequence[Curve], title: str) -> Figure:
    """Return the figure of paths seen along each axis, from curves with positions of shape (n, 3) [m]."""
    panels = tuple(
        Panel(
            "",
            tuple(replace(curve, time=curve.values[:, a], values=curve.values[:, b]) for curve in curves),
            unit=f"{AXES[b]} [m]",
            abscissa=f"{AXES[a]} [m]",
        )
        for a, b in ((0, 1), (0, 2), (1, 2))
    )
    extent = max(float(np.max(np.nanmax(curve.values, axis=0) - np.nanmin(curve.values, axis=0))) for curve in curves)
    caption = "The same path seen along each axis, the marker shifted by the lag; all axes have one scale."
    figure = Figure("tracking_path", title, "", panels, max(extent, 0.02), columns=3, equal=True)
    return figure.about(sections.TRACKING, caption)
