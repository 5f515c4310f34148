"""Metrics of the robot's motion: settling, overshoot and error at setpoints, and peak values relative to limits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.reader import ControlRecord, RunRecord, SentSetpoint
from hric_core.urdf import read
from hric_run.definition.experiment import MetricsSpec

FloatArray = npt.NDArray[np.float64]
RIPPLE_WINDOW = 0.1
"""Window at the end of a run in which the torque ripple is measured [s]; at rest only a chattering loop has ripple."""
LIMIT_KINDS = ("position", "velocity", "effort", "effort_rate")
ROUNDING = 1e-9
"""Largest change of a command that is rounding, not a limit [rad or rad/s]; project default, unconfirmed."""


@dataclass(frozen=True)
class Move:
    """Part of a run from one setpoint to the next.

    Attributes:
        setpoint: setpoint as recorded.
        target: target positions in the joint order of the log, shape (j,) [rad]; NaN: joint of another arm.
        first, last: index of the first cycle, and of the cycle after the last.
    """

    setpoint: SentSetpoint
    target: FloatArray
    first: int
    last: int


def moves(record: RunRecord, joints_of: Mapping[str, Sequence[str]]) -> list[Move]:
    """Return the valid setpoints, each with its range of cycles until the next setpoint of one of its joints.

    Valid are finite positions for joints of the log.

    Args:
        record: recording of the run.
        joints_of: order of the joints in each controller; a controller that is not listed uses the order of the log.
    """
    log = record.log
    usable = []
    for setpoint in record.setpoints:
        names = list(joints_of.get(setpoint.controller, log.joint_names))
        if (
            len(setpoint.positions) == len(names)
            and np.isfinite(setpoint.positions).all()
            and set(names) <= set(log.joint_names)
        ):
            target = np.full(len(log.joint_names), np.nan)
            target[[log.joint_names.index(name) for name in names]] = setpoint.positions
            usable.append(Move(setpoint, target, int(np.searchsorted(log.time, setpoint.time)), log.cycles))
    result = []
    for k, move in enumerate(usable):
        later = (other.first for other in usable[k + 1 :] if np.isfinite(move.target + other.target).any())
        result.append(replace(move, last=next(later, log.cycles)))
    return [move for move in result if move.first < move.last]


def settling_time(time: FloatArray, error: FloatArray, tolerance: float) -> float | None:
    """Return the time from the first sample until |error| stays within the tolerance [s]; None: it never does."""
    outside = np.flatnonzero(np.abs(error) > tolerance)
    if outside.size == 0:
        return 0.0
    if outside[-1] == len(error) - 1:
        return None
    return float(time[outside[-1] + 1] - time[0])


def overshoot(position: FloatArray, target: float) -> float:
    """Return the overshoot of a joint beyond its target in the direction of motion [rad].

    For a joint that starts at its target, deviations in both directions count.
    """
    distance = target - position[0]
    if abs(distance) < 1e-6:
        return float(np.max(np.abs(position - target)))
    return float(max(np.max((position - target) * np.sign(distance)), 0.0))


@dataclass(frozen=True)
class JointStep:
    """Response of one joint to a setpoint.

    Attributes:
        start, target: position at the setpoint's time, and target [rad].
        settling_time: time until the error stays within the tolerance [s], by tolerance; None: it never does.
        overshoot: largest deviation beyond the target [rad].
        final_error: error at the end of the setpoint's time [rad].
    """

    start: float
    target: float
    settling_time: dict[str, float | None]
    overshoot: float
    final_error: float


@dataclass(frozen=True)
class SetpointMetrics:
    """Response of all joints to a setpoint.

    Attributes:
        time, duration: robot time of the setpoint, and time until the next one [s].
        controller: name of the controller.
        final_error_max: largest final error of a joint [rad].
        settling_time_max: settling time of the slowest joint [s], by tolerance; None: a joint never settles.
        joints: response of each joint.
    """

    time: float
    duration: float
    controller: str
    final_error_max: float
    settling_time_max: dict[str, float | None]
    joints: dict[str, JointStep]


def setpoint_metrics(log: ControlRecord, move: Move, tolerances: Sequence[float]) -> SetpointMetrics:
    """Return the response of all joints to a setpoint; `tolerances`: bands of the settling time [rad]."""
    part = slice(move.first, move.last)
    time = log.time[part]
    joints = {}
    for j in np.flatnonzero(np.isfinite(move.target)):
        name, position, target = log.joint_names[j], log.position[part, j], float(move.target[j])
        error = target - position
        times = {f"{tolerance:g}": settling_time(time, error, tolerance) for tolerance in tolerances}
        joints[name] = JointStep(float(position[0]), target, times, overshoot(position, target), float(error[-1]))
    slowest = {key: _slowest([joint.settling_time[key] for joint in joints.values()]) for key in times}
    worst = max(abs(joint.final_error) for joint in joints.values())
    controller = move.setpoint.controller
    return SetpointMetrics(float(time[0]), float(time[-1] - time[0]), controller, worst, slowest, joints)


def _slowest(times: Sequence[float | None]) -> float | None:
    known = [time for time in times if time is not None]
    return max(known) if known and len(known) == len(times) else None


def rate(values: FloatArray, time: FloatArray) -> FloatArray:
    """Return the time derivative by backward differences, first row zero, in the shape of `values`."""
    result = np.zeros_like(values)
    if len(time) > 1:
        result[1:] = np.diff(values, axis=0) / np.diff(time)[:, None]
    return result


@dataclass(frozen=True, kw_only=True)
class JointMetrics:
    """Peak values of one joint over the run; None: not known, or not commanded by effort.

    Attributes:
        velocity_peak, position_min, position_max: largest speed [rad/s], smallest and largest position [rad].
        effort_peak, effort_raw_peak: largest torque sent, and requested [N m].
        rotatum_peak, rotatum_raw_peak: largest torque rate sent, and requested [N m/s].
        effort_ripple: peak-to-peak value of the torque sent in the last RIPPLE_WINDOW seconds [N m].
        velocity_ratio, effort_ratio, rotatum_ratio: peak divided by the limit [1].
        limited_cycles: number of cycles in which each kind of limit acted.
        command_change: largest change of a position or velocity command by limits, among them those of acceleration
            and jerk [rad or rad/s]; None: commanded by effort.
        velocity_ratio_max, position_excess_max: largest ratio to the velocity limit [1], largest distance outside the
            position range [rad]; reported by the robot for all cycles.
        started_outside: True if the joint started outside its position range.
    """

    velocity_peak: float
    position_min: float
    position_max: float
    effort_peak: float | None = None
    effort_raw_peak: float | None = None
    rotatum_peak: float | None = None
    effort_ripple: float | None = None
    rotatum_raw_peak: float | None = None
    velocity_ratio: float | None = None
    effort_ratio: float | None = None
    rotatum_ratio: float | None = None
    limited_cycles: dict[str, int] | None = None
    command_change: float | None = None
    velocity_ratio_max: float | None = None
    position_excess_max: float | None = None
    started_outside: bool | None = None


def joint_metrics(
    log: ControlRecord, limits: Mapping[str, Mapping[str, float]], counts: Any
) -> dict[str, JointMetrics]:
    """Return the peak values of each joint, their ratios to the limits, and the numbers of limited cycles.

    Args:
        log: control log.
        limits: known limits by joint: velocity [rad/s], effort [N m], effort_rate [N m/s].
        counts: last message hric_msgs/JointLimitCounts; None: there was none.
    """
    peaks = {
        "velocity_peak": np.abs(log.velocity).max(axis=0),
        "position_min": log.position.min(axis=0),
        "position_max": log.position.max(axis=0),
    }
    effort = np.array([kind == "effort" for kind in log.interfaces])
    if not effort.all():
        change = np.abs(log.command - log.command_raw).max(axis=0)
        peaks["command_change"] = np.where(change <= ROUNDING, 0.0, change)  # NaN stays
    if effort.any():
        peaks["effort_peak"] = np.abs(log.command).max(axis=0)
        peaks["effort_raw_peak"] = np.abs(log.command_raw).max(axis=0)
        peaks["rotatum_peak"] = np.abs(rate(log.command, log.time)).max(axis=0)
        peaks["effort_ripple"] = np.ptp(log.command[log.time >= log.time[-1] - RIPPLE_WINDOW], axis=0)
        peaks["rotatum_raw_peak"] = np.abs(rate(log.command_raw, log.time)).max(axis=0)
    result = {}
    for j, name in enumerate(log.joint_names):
        values = {
            key: float(array[j])
            for key, array in peaks.items()
            if effort[j] != (key == "command_change") or key.startswith(("velocity", "position"))
        }
        bounds = limits.get(name, {})
        ratios = {
            f"{peak.removesuffix('_peak')}_ratio": values[peak] / bounds[key]
            for key, peak in (("velocity", "velocity_peak"), ("effort", "effort_peak"), ("effort_rate", "rotatum_peak"))
            if bounds.get(key) and peak in values
        }
        result[name] = JointMetrics(**(_counted(counts, name) | values | ratios))
    return result


def _counted(counts: Any, joint: str) -> dict[str, Any]:
    if counts is None or joint not in counts.joint_names:
        return {}
    j = list(counts.joint_names).index(joint)
    return {
        "limited_cycles": {kind: int(getattr(counts, kind)[j]) for kind in LIMIT_KINDS},
        "velocity_ratio_max": float(counts.velocity_ratio_max[j]),
        "position_excess_max": float(counts.position_excess_max[j]),
        "started_outside": bool(counts.started_outside[j]),
    }


@dataclass(frozen=True)
class ProfileError:
    """Distance of a joint from the trajectory (profile) that its controller published.

    Attributes:
        largest_error, rms_error: largest and RMS distance [rad].
    """

    largest_error: float
    rms_error: float


@dataclass(frozen=True)
class PathMetrics(ProfileError):
    """Distance of the worst joint from the trajectory (profile) of its controller.

    Attributes:
        joints: distances by joint.
    """

    joints: dict[str, ProfileError]


def path_metrics(record: RunRecord) -> dict[str, PathMetrics] | None:
    """Compare joint positions with the trajectory (profile) that each controller published, at its instants.

    Returns:
        The distances by controller; None: no controller published a profile.
    """
    log, result = record.log, {}
    for controller, (times, desired, names) in record.profiles.items():
        led = [name for name in names if name in log.joint_names]
        if not led:
            continue
        cycles = np.clip(np.searchsorted(log.time, times - 0.5 * _period(log)), 0, log.cycles - 1)
        measured = log.position[:, [log.joint_names.index(name) for name in led]][cycles]
        error = desired[:, [names.index(name) for name in led]] - measured
        largest, rms = np.abs(error).max(axis=0).tolist(), np.sqrt(np.mean(np.square(error), axis=0)).tolist()
        joints = {name: ProfileError(a, b) for name, a, b in zip(led, largest, rms, strict=True)}
        result[controller] = PathMetrics(max(largest), max(rms), joints)
    return result or None


def _period(log: ControlRecord) -> float:
    return float(np.median(np.diff(log.time))) if log.cycles > 1 else 0.0


@dataclass(frozen=True)
class ControlLogMetrics:
    """Completeness of the control log.

    Attributes:
        cycles, first_cycle: count of recorded cycles, and cycle number of the first one.
        gaps, repeats: (first cycle number, count of cycles) of each gap, and of each repetition.
        missing_cycles, repeated_cycles: total counts of missing and repeated cycles.
        duration: time from the first to the last cycle [s].
        period_min, period_max: shortest and longest time step [s].
        limited_cycles: number of cycles in which a limit changed a command.
    """

    cycles: int
    first_cycle: int
    gaps: tuple[tuple[int, int], ...]
    repeats: tuple[tuple[int, int], ...]
    missing_cycles: int
    repeated_cycles: int
    duration: float
    period_min: float
    period_max: float
    limited_cycles: int


def control_log_metrics(log: ControlRecord) -> ControlLogMetrics:
    """Return the completeness of a control log: cycles, gaps, repetitions, shortest and longest time step."""
    steps = np.diff(log.time) if log.cycles > 1 else np.zeros(1)
    return ControlLogMetrics(
        log.cycles,
        log.first_cycle,
        tuple(log.gaps),
        tuple(log.repeats),
        sum(count for _, count in log.gaps),
        sum(count for _, count in log.repeats),
        float(log.time[-1] - log.time[0]),
        float(steps.min()),
        float(steps.max()),
        int(np.count_nonzero(np.any(log.command_raw != log.command, axis=1))),
    )


@dataclass(frozen=True)
class MotionMetrics:
    """Metrics of the robot's motion, from control log, setpoints, controller states and counts of limited cycles.

    Attributes:
        experiment: name of the experiment.
        control_log: completeness of the control log.
        state_sha256: hash of joint positions, velocities and commands of all cycles.
        limits_touched: number of cycles in which each kind of limit acted, summed over the joints; None: not known.
        path: distances from the profile of each controller; None: no controller published a profile.
        setpoints: response to each setpoint.
        joints: peak values by joint.
        topics: number of messages by topic.
    """

    experiment: str
    control_log: ControlLogMetrics
    state_sha256: str
    limits_touched: dict[str, int] | None
    path: dict[str, PathMetrics] | None
    setpoints: tuple[SetpointMetrics, ...]
    joints: dict[str, JointMetrics]
    topics: dict[str, int]


def prismatic_joints(names: Sequence[str], description: str) -> tuple[str, ...]:
    """Return the names of the joints that are prismatic in a URDF; empty without one."""
    known = read(description).joints if description else {}
    return tuple(name for name in names if name in known and known[name].type == "prismatic")


def settling_bands(settings: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the bands for the settling time [rad] of an experiment's section `metrics`, or the default."""
    return tuple(settings.get("tolerances") or MetricsSpec().tolerances)


def compute(
    record: RunRecord,
    limits: Mapping[str, Mapping[str, float]],
    joints_of: Mapping[str, Sequence[str]],
    tolerances: Sequence[float],
    experiment: str,
) -> MotionMetrics:
    """Compute the metrics of the robot's motion; for the arguments see `moves`, `joint_metrics`, `setpoint_metrics`."""
    log, counts = record.log, record.limit_counts
    return MotionMetrics(
        experiment,
        control_log_metrics(log),
        log.state_sha256(),
        None if counts is None else {kind: int(sum(getattr(counts, kind))) for kind in LIMIT_KINDS},
        path_metrics(record),
        tuple(setpoint_metrics(log, move, tolerances) for move in moves(record, joints_of)),
        joint_metrics(log, limits, counts),
        dict(sorted(record.topics.items())),
    )
