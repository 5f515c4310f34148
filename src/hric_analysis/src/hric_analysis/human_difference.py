"""Differences of the humans of two runs: joints and grip forces, aligned at the start of the motion. No ROS."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hric_analysis.human import moved
from hric_bags.reader import FloatArray
from hric_bags.records.human_record import HumanRecord


def difference(a: HumanRecord, b: HumanRecord, shift: float = 0.0) -> dict[str, Any]:
    """Compare the joints and grips that both humans have; B is interpolated at the instants of A.

    Args:
        a: human of run A.
        b: human of run B.
        shift: offset added to the times of B [s].

    Returns:
        `joints` and `grips` by name, each with the largest size of the difference (`peak_difference`), its time since
        the start of the motion (`peak_time`) and the `rms_difference` [rad] [N] [s]; over all, `joint_difference_max`
        [rad] and `force_difference_max` [N]. None for signals that have no common time.
    """
    begin_a, begin_b = moved(a.events, a.time)[0], moved(b.events, b.time)[0] + shift
    joints = {
        name: _apart(a.time - begin_a, a.position[:, [k]], b.time - begin_b, b.position[:, [b.joints.index(name)]])
        for k, name in enumerate(a.joints)
        if name in b.joints
    }
    grips = {
        name: _apart(grip.time - begin_a, grip.force, b.grips[name].time - begin_b, b.grips[name].force)
        for name, grip in a.grips.items()
        if name in b.grips
    }
    return {
        "joints": joints,
        "grips": grips,
        "joint_difference_max": _largest(joints),
        "force_difference_max": _largest(grips),
    }


def _apart(time: FloatArray, own: FloatArray, times: FloatArray, other: FloatArray) -> dict[str, float] | None:
    """Compare the rows of two runs, shape (n, k) and (m, k), at times since the same instant; None: no overlap."""
    within = (time >= times[0]) & (time <= times[-1])
    if not within.any():
        return None
    time = time[within]
    laid = np.column_stack([np.interp(time, times, column) for column in other.T])
    apart = np.linalg.norm(own[within] - laid, axis=1)
    peak = int(apart.argmax())
    return {
        "peak_difference": float(apart[peak]),
        "peak_time": float(time[peak]),
        "rms_difference": float(np.sqrt((apart**2).mean())),
    }


def _largest(signals: Mapping[str, Mapping[str, float] | None]) -> float | None:
    return max((one["peak_difference"] for one in signals.values() if one), default=None)


def line(found: Mapping[str, Any]) -> str:
    """Return a line of text with the joint and the grip that differ most."""
    parts = []
    for kind, unit in (("joints", "rad"), ("grips", "N")):
        known = {name: one for name, one in found[kind].items() if one}
        if known:
            name, one = max(known.items(), key=lambda item: item[1]["peak_difference"])
            parts.append(
                f"{kind} within {one['peak_difference']:.1e} {unit} ({name}, {one['peak_time']:.3f} s after his "
                f"motion's start; rms {one['rms_difference']:.1e})"
            )
    return f"the human, a model's estimate: {'; '.join(parts) or 'nothing that both have'}"
