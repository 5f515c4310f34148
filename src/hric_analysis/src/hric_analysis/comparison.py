"""Two runs of the same motion overlaid on each other: how far apart their joints are, as thesis ch. 4.4 shows it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_analysis.metrics import Move, moves
from hric_bags.reader import ControlRecord, RunRecord
from hric_core.errors import HricError

FloatArray = npt.NDArray[np.float64]

STEADY_WINDOW = 0.1
"""End of the common time over which the steady difference is averaged [s]. Project default, unconfirmed; thesis ch. 4.4
reads one value at about 3 s."""
FIT_RANGE = 0.1
"""How far apart the setpoints of two runs may lie in truth when their time is fitted; a recorder sees them 10 ms fine
[s]. Project default, unconfirmed."""
SAME_TARGET = 1e-6
"""Targets that differ by less are the same [rad]. Project default, unconfirmed: above the resolution of single
precision."""


class ComparisonError(HricError):
    """Two runs that cannot be overlaid on each other; the message says what does not match."""


@dataclass(frozen=True)
class Overlay:
    """Both runs from one setpoint on, on the time steps of run A; n steps, j joints.

    Attributes:
        start_a, start_b: robot time at which the setpoint came, or of the first cycle if there was none; that of B
            with the fitted shift [s].
        target: shape (j,) [rad]; None: no setpoint.
        time: since then, shape (n,) [s].
        position_a, position_b: shape (n, j) [rad].
        command_a, command_b: what was sent, shape (n, j) [unit of the interface].
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
    """Two runs overlaid on each other.

    Attributes:
        joint_names: names of run A.
        effort: for each joint, whether both runs commanded torques.
        overlays: one per setpoint, or one for the whole run.
        shift: what was added to the setpoints' time of run B to lay it onto run A [s].
    """

    joint_names: tuple[str, ...]
    effort: tuple[bool, ...]
    overlays: tuple[Overlay, ...]
    shift: float


@dataclass(frozen=True)
class _Pair:
    """A setpoint in both runs: start and end in robot time of each [s]."""

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
    """Lay run B over run A, setpoint over setpoint.

    Args:
        a, b: the runs; their joints belong together by name, or by name without the arm's prefix.
        orders_a, orders_b: joint order of each controller.
        fit: shift B by whole cycles of A, at most FIT_RANGE, so that the positions agree best; hides a delay of one
            run.

    Raises:
        ComparisonError: other joints, other setpoints, or no common time.
    """
    order = columns(a.log.joint_names, b.log.joint_names)
    pairs = _pairs(a.log, b.log, moves(a, orders_a), moves(b, orders_b), order)
    shift = _fitted_shift(a.log, b.log, order, pairs) if fit else 0.0
    effort = tuple(
        kind == "effort" == b.log.interfaces[column] for kind, column in zip(a.log.interfaces, order, strict=True)
    )
    return Comparison(a.log.joint_names, effort, tuple(_lay(a.log, b.log, order, pair, shift) for pair in pairs), shift)


def columns(names_a: Sequence[str], names_b: Sequence[str]) -> list[int]:
    """For each joint of A its column in B.

    Raises:
        ComparisonError: the joints are not the same.
    """
    for short in (str, lambda name: name.rsplit("_", 1)[-1]):
        first, second = [short(name) for name in names_a], [short(name) for name in names_b]
        if sorted(first) == sorted(second) and len(set(first)) == len(first):
            return [second.index(name) for name in first]
    raise ComparisonError(f"the runs have other joints: {', '.join(names_a)}; and {', '.join(names_b)}")


def _pairs(
    a: ControlRecord, b: ControlRecord, moves_a: list[Move], moves_b: list[Move], columns: list[int]
) -> list[_Pair]:
    if len(moves_a) != len(moves_b):
        raise ComparisonError(f"the runs have other setpoints: {len(moves_a)} and {len(moves_b)} of them")
    if not moves_a:
        return [_Pair(float(a.time[0]), float(a.time[-1]), float(b.time[0]), float(b.time[-1]), None)]
    found = []
    for k, (one, other) in enumerate(zip(moves_a, moves_b, strict=True)):
        difference = float(np.abs(one.target - other.target[columns]).max())
        if difference > SAME_TARGET:
            raise ComparisonError(f"the runs have other setpoints: number {k + 1} differs by {difference:.3g} rad")
        ends = [float(log.time[move.last - 1]) for log, move in ((a, one), (b, other))]
        found.append(_Pair(one.setpoint.time, ends[0], other.setpoint.time, ends[1], one.target))
    return found


def _steps(a: ControlRecord, pair: _Pair, shift: float) -> FloatArray:
    """Time steps of run A that both runs have, since the setpoint [s]."""
    end = min(pair.end_a - pair.start_a, pair.end_b - pair.start_b - shift)
    since: FloatArray = a.time - pair.start_a
    # A step that rounding puts a little outside is inside.
    return since[(since >= -1e-9) & (since <= end + 1e-9)]


def _at(time: FloatArray, times: FloatArray, values: FloatArray) -> FloatArray:
    """Columns of `values` between its steps, linearly; held beyond the ends."""
    return np.stack([np.interp(time, times, column) for column in values.T], axis=1)


def _lay(a: ControlRecord, b: ControlRecord, columns: list[int], pair: _Pair, shift: float) -> Overlay:
    since = _steps(a, pair, shift)
    if since.size < 2:
        raise ComparisonError(f"the runs have no common time after the setpoint at {pair.start_a:.3f} s")
    here, there = pair.start_a + since, pair.start_b + shift + since
    own = [_at(here, a.time, values) for values in (a.position, a.command)]
    other = [_at(there, b.time, values[:, columns]) for values in (b.position, b.command)]
    return Overlay(pair.start_a, pair.start_b + shift, pair.target, since, own[0], other[0], own[1], other[1])


def _fitted_shift(a: ControlRecord, b: ControlRecord, columns: list[int], pairs: list[_Pair]) -> float:
    """The shift of B by whole cycles that makes the sum of squared position differences least [s]."""
    period = float(np.median(np.diff(a.time))) if a.cycles > 1 else 0.0
    if period <= 0.0:
        return 0.0
    count = int(FIT_RANGE / period)
    shifts = sorted((k * period for k in range(-count, count + 1)), key=abs)  # of equally good ones the smallest
    steps = [_steps(a, pair, FIT_RANGE) for pair in pairs]
    own = [_at(pair.start_a + since, a.time, a.position) for pair, since in zip(pairs, steps, strict=True)]

    def cost(shift: float) -> float:
        laid = (
            _at(pair.start_b + shift + since, b.time, b.position[:, columns])
            for pair, since in zip(pairs, steps, strict=True)
        )
        return sum(float(np.sum((one - other) ** 2)) for one, other in zip(own, laid, strict=True))

    return min(shifts, key=cost)


def difference_metrics(compared: Comparison) -> list[dict[str, Any]]:
    """Per setpoint and joint: peak with its time, steady and root-mean-square difference, A minus B [rad; N m; s]."""
    return [_overlay_metrics(compared, laid) for laid in compared.overlays]


def _overlay_metrics(compared: Comparison, laid: Overlay) -> dict[str, Any]:
    joints: dict[str, dict[str, float]] = {}
    for j, name in enumerate(compared.joint_names):
        joints[name] = _signal(laid.time, laid.position_a[:, j] - laid.position_b[:, j])
        if compared.effort[j]:
            effort = _signal(laid.time, laid.command_a[:, j] - laid.command_b[:, j])
            joints[name] |= {f"effort_{key}": value for key, value in effort.items()}
    return {
        "time_a": laid.start_a,
        "time_b": laid.start_b,
        "duration": float(laid.time[-1]),
        "peak_difference_max": max(abs(joint["peak_difference"]) for joint in joints.values()),
        "steady_difference_max": max(abs(joint["steady_difference"]) for joint in joints.values()),
        "joints": joints,
    }


def _signal(time: FloatArray, difference: FloatArray) -> dict[str, float]:
    peak = int(np.argmax(np.abs(difference)))
    return {
        "peak_difference": float(difference[peak]),
        "peak_time": float(time[peak]),
        "steady_difference": float(np.mean(difference[time > time[-1] - STEADY_WINDOW + 1e-9])),
        "rms_difference": float(np.sqrt(np.mean(difference**2))),
    }


def settings(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What the two experiments, as they were run, set differently: dotted key, value in A and in B; null: not set.

    Args:
        a, b: trees of plain values, such as `definition` of run.yaml.
    """
    flat_a, flat_b = leaves(a), leaves(b)
    keys = dict.fromkeys([*flat_a, *flat_b])
    return [
        {"key": key, "a": flat_a.get(key), "b": flat_b.get(key)} for key in keys if flat_a.get(key) != flat_b.get(key)
    ]


def leaves(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Values of a tree by dotted key; prefix: before the keys."""
    found: dict[str, Any] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        found |= leaves(value, f"{name}.") if isinstance(value, Mapping) else {name: value}
    return found
