"""Comparison of two runs of the same motion, aligned in time: differences of the joints, as in thesis ch. 4.4."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hric_analysis.metrics import Move, moves
from hric_bags.reader import ControlRecord, RunRecord
from hric_core.errors import HricError

FloatArray = npt.NDArray[np.float64]

STEADY_WINDOW = 0.1
"""Window at the end of the common time over which the steady-state difference is averaged [s]. Project default,
unconfirmed; thesis ch. 4.4 uses one value at about 3 s."""
FIT_RANGE = 0.1
"""Maximum time shift in a fit that aligns two runs [s]; recorders resolve the time of a setpoint to 10 ms. Project
default, unconfirmed."""
SAME_TARGET = 1e-6
"""Difference up to which two setpoints count as equal [rad]; larger than the resolution of single precision. Project
default, unconfirmed."""


class ComparisonError(HricError):
    """Error: two runs cannot be compared; the message names what does not match."""


@dataclass(frozen=True)
class Overlay:
    """Data of both runs after one setpoint, at n time steps of run A, for j joints.

    Attributes:
        start_a, start_b: robot time of the setpoint, or of the first cycle if there was none [s]; start_b includes the
            fitted shift.
        target: target positions, shape (j,) [rad]; None: no setpoint.
        time: time since the start, shape (n,) [s].
        position_a, position_b: joint positions, shape (n, j) [rad].
        command_a, command_b: commands sent, shape (n, j) [unit of the interface].
    """

    start_a: float
    start_b: float
    target: FloatArray | None
    time: FloatArray
    position_a: FloatArray
    position_b: FloatArray
    command_a: FloatArray
    command_b: FloatArray


@dataclass(frozen=True)
class Comparison:
    """Two runs of the same motion, aligned in time.

    Attributes:
        joint_names: joint names of run A.
        effort: True for each joint for which both runs commanded torques.
        overlays: data of both runs after each setpoint; one for the complete run if there was no setpoint.
        shift: fitted time shift by which run B, already aligned at its setpoints, is moved to match run A [s].
    """

    joint_names: tuple[str, ...]
    effort: tuple[bool, ...]
    overlays: tuple[Overlay, ...]
    shift: float


@dataclass(frozen=True)
class _Pair:
    """Start and end of a setpoint in both runs, each in its robot time [s], and its target [rad]."""

    start_a: float
    end_a: float
    start_b: float
    end_b: float
    target: FloatArray | None


def overlay(
    a: RunRecord,
    b: RunRecord,
    orders_a: Mapping[str, Sequence[str]],
    orders_b: Mapping[str, Sequence[str]],
    *,
    fit: bool = False,
) -> Comparison:
    """Align run B with run A in time at each setpoint.

    Args:
        a: run A.
        b: run B; joints are matched by name, or by name without the prefix of the arm.
        orders_a: order of the joints in each controller of run A.
        orders_b: order of the joints in each controller of run B.
        fit: True to shift B by whole cycles of A, at most FIT_RANGE, so that positions agree best; this hides delays.

    Raises:
        ComparisonError: the runs differ in joints or setpoints, or have no common time.
    """
    order = columns(a.log.joint_names, b.log.joint_names)
    pairs = _pairs(a.log, b.log, moves(a, orders_a), moves(b, orders_b), order)
    shift = _fitted_shift(a.log, b.log, order, pairs) if fit else 0.0
    effort = tuple(
        kind == "effort" == b.log.interfaces[column] for kind, column in zip(a.log.interfaces, order, strict=True)
    )
    return Comparison(a.log.joint_names, effort, tuple(_lay(a.log, b.log, order, pair, shift) for pair in pairs), shift)


def columns(names_a: Sequence[str], names_b: Sequence[str]) -> list[int]:
    """Return, for each joint of run A, its column in run B; names are matched with or without the arm's prefix.

    Raises:
        ComparisonError: the runs have different joints.
    """
    for short in (str, lambda name: name.rsplit("_", 1)[-1]):
        first, second = [short(name) for name in names_a], [short(name) for name in names_b]
        if sorted(first) == sorted(second) and len(set(first)) == len(first):
            return [second.index(name) for name in first]
    raise ComparisonError(f"the runs have different joints: {', '.join(names_a)}; and {', '.join(names_b)}")


def _pairs(
    a: ControlRecord, b: ControlRecord, moves_a: list[Move], moves_b: list[Move], columns: list[int]
) -> list[_Pair]:
    if len(moves_a) != len(moves_b):
        raise ComparisonError(f"the runs have different numbers of setpoints: {len(moves_a)} and {len(moves_b)}")
    if not moves_a:
        return [_Pair(float(a.time[0]), float(a.time[-1]), float(b.time[0]), float(b.time[-1]), None)]
    pairs = []
    for k, (move, other) in enumerate(zip(moves_a, moves_b, strict=True)):
        apart = np.where(
            np.isnan(move.target) & np.isnan(other.target[columns]), 0.0, move.target - other.target[columns]
        )
        difference = float(np.nan_to_num(np.abs(apart), nan=np.inf).max())
        if difference > SAME_TARGET:
            raise ComparisonError(f"the runs have different setpoints: number {k + 1} differs by {difference:.3g} rad")
        ends = [float(log.time[last - 1]) for log, last in ((a, move.last), (b, other.last))]
        pairs.append(_Pair(move.setpoint.time, ends[0], other.setpoint.time, ends[1], move.target))
    return pairs


def _steps(a: ControlRecord, pair: _Pair, shift: float) -> FloatArray:
    """Return the times since the setpoint of those steps of run A that run B also covers [s]."""
    end = min(pair.end_a - pair.start_a, pair.end_b - pair.start_b - shift)
    since: FloatArray = a.time - pair.start_a
    # Tolerance: a step that is outside only by rounding counts as inside.
    return since[(since >= -1e-9) & (since <= end + 1e-9)]


def _at(time: FloatArray, times: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate the columns of `values`, given at `times`, linearly at `time`; constant beyond the ends."""
    return np.stack([np.interp(time, times, column) for column in values.T], axis=1)


def _lay(a: ControlRecord, b: ControlRecord, columns: list[int], pair: _Pair, shift: float) -> Overlay:
    since = _steps(a, pair, shift)
    if since.size < 2:
        raise ComparisonError(f"the runs have no common time after the setpoint at {pair.start_a:.3f} s")
    here, there = pair.start_a + since, pair.start_b + shift + since
    overlaid = [_at(here, a.time, values) for values in (a.position, a.command)]
    other = [_at(there, b.time, values[:, columns]) for values in (b.position, b.command)]
    return Overlay(pair.start_a, pair.start_b + shift, pair.target, since, overlaid[0], other[0], overlaid[1], other[1])


def _fitted_shift(a: ControlRecord, b: ControlRecord, columns: list[int], pairs: list[_Pair]) -> float:
    """Return the shift of B by whole cycles that minimises the sum of squared position differences [s]."""
    period = float(np.median(np.diff(a.time))) if a.cycles > 1 else 0.0
    if period <= 0.0:
        return 0.0
    count = int(FIT_RANGE / period)
    shifts = sorted((k * period for k in range(-count, count + 1)), key=abs)  # prefer small shifts
    steps = [_steps(a, pair, FIT_RANGE) for pair in pairs]
    reference = [_at(pair.start_a + since, a.time, a.position) for pair, since in zip(pairs, steps, strict=True)]

    def cost(shift: float) -> float:
        shifted = (
            _at(pair.start_b + shift + since, b.time, b.position[:, columns])
            for pair, since in zip(pairs, steps, strict=True)
        )
        return sum(float(np.sum((expected - other) ** 2)) for expected, other in zip(reference, shifted, strict=True))

    return min(shifts, key=cost)


@dataclass(frozen=True)
class JointDifference:
    """Difference of a joint between two runs, A minus B.

    Attributes:
        peak_difference, peak_time: largest position difference [rad], and its time since the setpoint [s].
        steady_difference, rms_difference: mean position difference over STEADY_WINDOW, and RMS [rad].
        effort_peak_difference, effort_peak_time, effort_steady_difference, effort_rms_difference: the same values for
            the commanded torque [N m], [s]; None: not both runs command torque.
    """

    peak_difference: float
    peak_time: float
    steady_difference: float
    rms_difference: float
    effort_peak_difference: float | None = None
    effort_peak_time: float | None = None
    effort_steady_difference: float | None = None
    effort_rms_difference: float | None = None


@dataclass(frozen=True)
class SetpointDifference:
    """Differences between two runs after a setpoint.

    Attributes:
        time_a, time_b, duration: robot time of the setpoint in both runs, and common time after it [s].
        peak_difference_max, steady_difference_max: largest difference over all joints [rad].
        joints: differences by joint.
    """

    time_a: float
    time_b: float
    duration: float
    peak_difference_max: float
    steady_difference_max: float
    joints: dict[str, JointDifference]


def difference_metrics(compared: Comparison) -> list[SetpointDifference]:
    """Return the differences of two runs, by setpoint and joint."""
    return [_overlay_metrics(compared, overlaid) for overlaid in compared.overlays]


def _overlay_metrics(compared: Comparison, overlaid: Overlay) -> SetpointDifference:
    joints = {}
    for j, name in enumerate(compared.joint_names):
        numbers = _signal(overlaid.time, overlaid.position_a[:, j] - overlaid.position_b[:, j])
        if compared.effort[j]:
            numbers += _signal(overlaid.time, overlaid.command_a[:, j] - overlaid.command_b[:, j])
        joints[name] = JointDifference(*numbers)
    return SetpointDifference(
        overlaid.start_a,
        overlaid.start_b,
        float(overlaid.time[-1]),
        max(abs(joint.peak_difference) for joint in joints.values()),
        max(abs(joint.steady_difference) for joint in joints.values()),
        joints,
    )


def _signal(time: FloatArray, difference: FloatArray) -> tuple[float, ...]:
    """Return peak, time of the peak [s], steady-state value and RMS of a difference over time."""
    peak = int(np.argmax(np.abs(difference)))
    steady = np.mean(difference[time > time[-1] - STEADY_WINDOW + 1e-9])
    return float(difference[peak]), float(time[peak]), float(steady), float(np.sqrt(np.mean(difference**2)))


@dataclass(frozen=True)
class SettingDifference:
    """Setting that differs between the experiments of two runs.

    Attributes:
        key: dotted key of the setting.
        a, b: value in run A and in run B; None: not set.
    """

    key: str
    a: object
    b: object


def settings(a: Mapping[str, object], b: Mapping[str, object]) -> list[SettingDifference]:
    """Return the settings that differ between two experiments.

    Args:
        a: nested settings of run A, such as `definition` in run.yaml.
        b: nested settings of run B.
    """
    flat_a, flat_b = leaves(a), leaves(b)
    pairs = ((key, flat_a.get(key), flat_b.get(key)) for key in dict.fromkeys([*flat_a, *flat_b]))
    return [SettingDifference(key, here, there) for key, here, there in pairs if here != there]


def leaves(tree: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    """Return the values of nested mappings by dotted key; `prefix` is put before each key."""
    flat: dict[str, object] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        flat |= leaves(value, f"{name}.") if isinstance(value, Mapping) else {name: value}
    return flat
