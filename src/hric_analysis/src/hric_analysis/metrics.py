"""Metrics of a run: settling, overshoot and error of each joint at its setpoints, and peak loads against limits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.reader import ControlRecord, RunRecord, SentSetpoint

FloatArray = npt.NDArray[np.float64]
RIPPLE_WINDOW = 0.1
"""Window at the end of the run for the torque ripple: at rest only a loop that chatters has one [s]."""
LIMIT_KINDS = ("position", "velocity", "effort", "effort_rate")


@dataclass(frozen=True)
class Move:
    """Part of a run that belongs to one setpoint.

    Attributes:
        setpoint: setpoint as it was sent.
        target: target positions in the joint order of the log, shape (j,) [rad].
        first, last: index of the first cycle, and one past the last.
    """

    setpoint: SentSetpoint
    target: FloatArray
    first: int
    last: int


def moves(record: RunRecord, joints_of: Mapping[str, Sequence[str]]) -> list[Move]:
    """Return the valid setpoints (finite, for all joints), each with the cycles until the next one.

    Args:
        record: recording of the run.
        joints_of: joint order of each controller; default: the order of the log.
    """
    log = record.log
    usable = []
    for setpoint in record.setpoints:
        names = list(joints_of.get(setpoint.controller, log.joint_names))
        if (
            len(setpoint.positions) == len(names)
            and np.isfinite(setpoint.positions).all()
            and set(names) == set(log.joint_names)
        ):
            usable.append((setpoint, setpoint.positions[[names.index(joint) for joint in log.joint_names]]))
    starts = [int(np.searchsorted(log.time, setpoint.time)) for setpoint, _ in usable]
    ends = [*starts[1:], log.cycles][: len(starts)]
    rows = zip(usable, starts, ends, strict=True)
    return [Move(setpoint, target, first, last) for (setpoint, target), first, last in rows if first < last]


def settling_time(time: FloatArray, error: FloatArray, tolerance: float) -> float | None:
    """Return the time from the first sample until |error| stays within the tolerance [s]; None if it never does."""
    outside = np.flatnonzero(np.abs(error) > tolerance)
    if outside.size == 0:
        return 0.0
    if outside[-1] == len(error) - 1:
        return None
    return float(time[outside[-1] + 1] - time[0])


def overshoot(position: FloatArray, target: float) -> float:
    """Return the overshoot of a joint past the target in the direction of its move [rad].

    A joint that starts at its target has no direction: any excursion counts.
    """
    distance = target - position[0]
    if abs(distance) < 1e-6:
        return float(np.max(np.abs(position - target)))
    return float(max(np.max((position - target) * np.sign(distance)), 0.0))


def move_metrics(log: ControlRecord, move: Move, tolerances: Sequence[float]) -> dict[str, Any]:
    """Return start, target, settling times, overshoot and final error of each joint, and the worst of all joints."""
    part = slice(move.first, move.last)
    time = log.time[part]
    joints: dict[str, dict[str, Any]] = {}
    for j, name in enumerate(log.joint_names):
        position, target = log.position[part, j], float(move.target[j])
        error = target - position
        joints[name] = {
            "start": float(position[0]),
            "target": target,
            "settling_time": {f"{tolerance:g}": settling_time(time, error, tolerance) for tolerance in tolerances},
            "overshoot": overshoot(position, target),
            "final_error": float(error[-1]),
        }
    worst = max(abs(values["final_error"]) for values in joints.values())
    times = {
        f"{tolerance:g}": _slowest([values["settling_time"][f"{tolerance:g}"] for values in joints.values()])
        for tolerance in tolerances
    }
    return {
        "time": float(time[0]),
        "duration": float(time[-1] - time[0]),
        "controller": move.setpoint.controller,
        "final_error_max": worst,
        "settling_time_max": times,
        "joints": joints,
    }


def _slowest(times: Sequence[float | None]) -> float | None:
    known = [time for time in times if time is not None]
    return max(known) if known and len(known) == len(times) else None


def rate(values: FloatArray, time: FloatArray) -> FloatArray:
    """Return the backward difference per second, first row zero, in the shape of `values`."""
    result = np.zeros_like(values)
    if len(time) > 1:
        result[1:] = np.diff(values, axis=0) / np.diff(time)[:, None]
    return result


def joint_metrics(
    log: ControlRecord, limits: Mapping[str, Mapping[str, float]], counts: Mapping[str, Any] | None
) -> dict[str, Any]:
    """Return peaks of torque, torque rate and speed of each joint, their ratios to the limits, and limited cycles.

    Args:
        log: control log.
        limits: any of lower, upper [rad], velocity [rad/s], effort [N m], effort_rate [N m/s], by joint.
        counts: last message of the limit counts; None: there was none.
    """
    peaks = {
        "velocity_peak": np.abs(log.velocity).max(axis=0),
        "position_min": log.position.min(axis=0),
        "position_max": log.position.max(axis=0),
    }
    effort = np.array([kind == "effort" for kind in log.interfaces])
    if effort.any():
        peaks["effort_peak"] = np.abs(log.command).max(axis=0)
        peaks["effort_raw_peak"] = np.abs(log.command_raw).max(axis=0)
        peaks["rotatum_peak"] = np.abs(rate(log.command, log.time)).max(axis=0)
        peaks["effort_ripple"] = np.ptp(log.command[log.time >= log.time[-1] - RIPPLE_WINDOW], axis=0)
        peaks["rotatum_raw_peak"] = np.abs(rate(log.command_raw, log.time)).max(axis=0)
    result = {}
    for j, name in enumerate(log.joint_names):
        values: dict[str, Any] = {
            key: float(array[j])
            for key, array in peaks.items()
            if effort[j] or key.startswith(("velocity", "position"))
        }
        bounds = limits.get(name, {})
        for key, peak in (("velocity", "velocity_peak"), ("effort", "effort_peak"), ("effort_rate", "rotatum_peak")):
            if bounds.get(key) and peak in values:
                values[f"{peak.removesuffix('_peak')}_ratio"] = values[peak] / bounds[key]
        result[name] = values | _counted(counts, name)
    return result


def _counted(counts: Mapping[str, Any] | None, joint: str) -> dict[str, Any]:
    if counts is None or joint not in counts["joint_names"]:
        return {}
    j = counts["joint_names"].index(joint)
    return {
        "limited_cycles": {kind: counts[kind][j] for kind in LIMIT_KINDS},
        "velocity_ratio_max": counts["velocity_ratio_max"][j],
        "position_excess_max": counts["position_excess_max"][j],
        "started_outside": counts["started_outside"][j],
    }


def path_metrics(record: RunRecord) -> dict[str, Any] | None:
    """Compare the joint positions with the profile that each controller published, at the instants of its messages.

    Returns:
        largest_error and rms_error of the worst joint and of each of `joints` [rad], by controller; None: no controller
        published a profile.
    """
    log, found = record.log, {}
    for controller, (times, desired, names) in record.profiles.items():
        led = [name for name in names if name in log.joint_names]
        if not led:
            continue
        cycles = np.clip(np.searchsorted(log.time, times - 0.5 * _period(log)), 0, log.cycles - 1)
        measured = log.position[:, [log.joint_names.index(name) for name in led]][cycles]
        error = desired[:, [names.index(name) for name in led]] - measured
        largest, rms = np.abs(error).max(axis=0).tolist(), np.sqrt(np.mean(np.square(error), axis=0)).tolist()
        found[controller] = {
            **{"largest_error": max(largest), "rms_error": max(rms)},
            "joints": {
                name: {"largest_error": a, "rms_error": b} for name, a, b in zip(led, largest, rms, strict=True)
            },
        }
    return found or None


def _period(log: ControlRecord) -> float:
    return float(np.median(np.diff(log.time))) if log.cycles > 1 else 0.0


def control_log_metrics(log: ControlRecord) -> dict[str, Any]:
    """Return the completeness of the control log: cycles, gaps, repeats, and the shortest and longest time step."""
    steps = np.diff(log.time) if log.cycles > 1 else np.zeros(1)
    return {
        "cycles": log.cycles,
        "first_cycle": log.first_cycle,
        "gaps": [list(gap) for gap in log.gaps],
        "repeats": [list(repeat) for repeat in log.repeats],
        "missing_cycles": sum(count for _, count in log.gaps),
        "repeated_cycles": sum(count for _, count in log.repeats),
        "duration": float(log.time[-1] - log.time[0]),
        "period_min": float(steps.min()),
        "period_max": float(steps.max()),
        "limited_cycles": int(np.count_nonzero(np.any(log.command_raw != log.command, axis=1))),
    }


def compute(
    record: RunRecord,
    limits: Mapping[str, Mapping[str, float]],
    joints_of: Mapping[str, Sequence[str]],
    tolerances: Sequence[float],
) -> dict[str, Any]:
    """Compute all metrics that need only the recording of the run and the limits.

    `limits_touched` is the number of cycles in which each kind of limit acted, summed over the joints.
    """
    log, counts = record.log, record.limit_counts
    return {
        "control_log": control_log_metrics(log),
        "state_sha256": log.state_sha256(),
        "limits_touched": None if counts is None else {kind: sum(counts[kind]) for kind in LIMIT_KINDS},
        "path": path_metrics(record),
        "setpoints": [move_metrics(log, move, tolerances) for move in moves(record, joints_of)],
        "joints": joint_metrics(log, limits, counts),
        "topics": dict(sorted(record.topics.items())),
    }
