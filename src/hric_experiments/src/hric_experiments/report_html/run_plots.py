"""The plots of one run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from hric_experiments.bag_reader import ControlRecord, RunRecord
from hric_experiments.metrics import Move, rate
from hric_experiments.report_html.curves import Curve, Panel, Plot
from hric_experiments.report_html.recordings import Signal
from hric_experiments.tracking import STEP
from hric_experiments.tracking_analysis import Tracking

FloatArray = npt.NDArray[np.float64]
Limits = Mapping[str, Mapping[str, float]]
AXES = ("x", "y", "z")
SMALLEST_ERROR = 1e-9
"""Errors below are drawn there, on the logarithmic axis [rad]. Our choice."""


def robot_plots(record: RunRecord, moves: Sequence[Move], limits: Limits) -> list[Plot]:
    """Positions, velocities, torques and their rate, and errors, joint by joint."""
    log = record.log
    found = [_positions(record, moves, limits), _velocities(log, limits)]
    if "effort" in log.interfaces:
        found += [_torques(log, limits), _rotatum(log, limits)]
    if moves:
        found.append(_errors(log, moves))
    return found


def _bound(limits: Limits, joint: str, *keys: str) -> tuple[tuple[str, float], ...]:
    """The limits of a joint that are told; a limit of speed, torque or rotatum holds both ways."""
    own = limits.get(joint, {})
    found = [(key, float(own[key])) for key in keys if own.get(key) is not None and np.isfinite(own[key])]
    both = [(f"-{key}", -value) for key, value in found if key not in ("lower", "upper")]
    return tuple(found + both)


def set_point_line(log: ControlRecord, moves: Sequence[Move], joint: int) -> tuple[FloatArray, FloatArray]:
    """Corners of the line of set points: (n,) [s], (n,) [rad]."""
    times = [float(log.time[k]) for move in moves for k in (move.first, move.last - 1)]
    values = [float(move.target[joint]) for move in moves for _ in range(2)]
    return np.array(times), np.array(values)


def _positions(record: RunRecord, moves: Sequence[Move], limits: Limits) -> Plot:
    log, panels = record.log, []
    profiles = [(times, desired.T, names) for times, desired, names in record.profiles.values()]
    for j, name in enumerate(log.joint_names):
        curves = [Curve("set point", "wanted", *set_point_line(log, moves, j))] if moves else []
        curves += [Curve("desired (profile)", "profile", times, rows[names.index(name)]) for times, rows, names in profiles if name in names]
        curves.append(Curve("measured", "measured", log.time, log.position[:, j]))
        panels.append(Panel(name, tuple(curves), _bound(limits, name, "lower", "upper")))
    return Plot("positions", "Joint positions", "position [rad]", tuple(panels), least=0.02)


def _velocities(log: ControlRecord, limits: Limits) -> Plot:
    panels = [
        Panel(name, (Curve("measured", "measured", log.time, log.velocity[:, j]),), _bound(limits, name, "velocity"))
        for j, name in enumerate(log.joint_names)
    ]
    return Plot("velocities", "Joint velocities", "velocity [rad/s]", tuple(panels), least=0.02)


def _torques(log: ControlRecord, limits: Limits) -> Plot:
    panels = []
    for j, name in enumerate(log.joint_names):
        raw = Curve("asked for", "raw", log.time, log.command_raw[:, j])
        sent = Curve("sent (after the limits)", "measured", log.time, log.command[:, j])
        panels.append(Panel(name, (raw, sent), _bound(limits, name, "effort")))
    return Plot("torques", "Commanded torques", "torque [N m]", tuple(panels), least=0.2)


def _rotatum(log: ControlRecord, limits: Limits) -> Plot:
    values = rate(log.command, log.time)
    panels = [
        Panel(name, (Curve("sent", "measured", log.time, values[:, j]),), _bound(limits, name, "effort_rate"))
        for j, name in enumerate(log.joint_names)
    ]
    return Plot("rotatum", "Rate of torque (rotatum)", "[N m/s]", tuple(panels), least=2.0)


def _errors(log: ControlRecord, moves: Sequence[Move]) -> Plot:
    error = np.full_like(log.position, np.nan)
    for move in moves:
        part = slice(move.first, move.last)
        error[part] = np.maximum(np.abs(move.target - log.position[part]), SMALLEST_ERROR)
    curves = tuple(Curve(name, f"s{j}", log.time, error[:, j]) for j, name in enumerate(log.joint_names))
    return Plot("errors", "Distance from the set point", "|set point - position| [rad]", (Panel("", curves),), logarithmic=True)


def tracking_plot(found: Tracking | None) -> list[Plot]:
    """How the end effector followed the marker; nothing where none was followed."""
    if found is None or found.data is None:
        return []
    data, states = found.data, found.record.states
    lag = round((found.values["lag"] or 0.0) / STEP)
    marker, panels = data.wanted(0), []
    for k, axis in enumerate(AXES):
        curves = (
            Curve("marker, from the origins", "wanted", data.time, marker[:, k]),
            Curve("desired", "profile", states.time, states.desired[:, k]),
            Curve("actual", "measured", data.time, data.ee[:, k]),
        )
        panels.append(Panel(f"{axis} of the end effector in {found.record.base} [m]", curves))
    error = Curve("distance", "raw", data.time, 1e3 * np.linalg.norm(data.error(lag), axis=1))
    panels.append(Panel(f"distance from the marker {1e3 * lag * STEP:.0f} ms ago [mm]", (error,)))
    return [Plot("tracking", "The end effector follows the marker", "", tuple(panels), least=0.002)]


def signal_plots(signals: Sequence[Signal]) -> list[Plot]:
    """One plot per topic: channels of a vector in one panel, those of a sensor with many in one each."""
    by_topic: dict[str, list[Signal]] = {}
    for signal in signals:
        by_topic.setdefault(signal.topic, []).append(signal)
    return [_signal_plot(topic, found) for topic, found in by_topic.items()]


def _signal_plot(topic: str, signals: Sequence[Signal]) -> Plot:
    panels = []
    for signal in signals:
        curves = [Curve(name, f"s{k}", signal.time, signal.values[:, k]) for k, name in enumerate(signal.channels)]
        if len(curves) <= len(AXES):
            panels.append(Panel(signal.unit, tuple(curves)))
        else:
            panels += [Panel(f"{curve.name} {signal.unit}", (curve,)) for curve in curves]
    return Plot(topic.strip("/").replace("/", "."), topic, "", tuple(panels))
