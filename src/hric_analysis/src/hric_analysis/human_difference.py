"""Differences between the simulated humans of two runs: joint angles and grip forces over time. No ROS."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hric_analysis.human import moved
from hric_bags.reader import FloatArray
from hric_bags.records.human_record import HumanRecord


@dataclass(frozen=True)
class SignalDifference:
    """Difference of a signal between two runs, in the unit of the signal.

    Attributes:
        peak_difference: largest magnitude of the difference.
        peak_time: time of this maximum since the start of the motion [s].
        rms_difference: RMS of the magnitude.
    """

    peak_difference: float
    peak_time: float
    rms_difference: float


@dataclass(frozen=True)
class HumanDifference:
    """Differences between the simulated humans of two runs; None: the signals have no common time.

    Attributes:
        joints, grips: difference of each joint angle [rad] and of each grip force [N].
        joint_difference_max, force_difference_max: largest of these differences [rad], [N].
    """

    joints: dict[str, SignalDifference | None]
    grips: dict[str, SignalDifference | None]
    joint_difference_max: float | None
    force_difference_max: float | None


def difference(a: HumanRecord, b: HumanRecord, shift: float = 0.0) -> HumanDifference:
    """Compare joint angles and grip forces of two simulated humans, aligned at the start of their motion.

    Run B is interpolated at the instants of run A.


    Args:
        a: recording of the human in run A.
        b: recording of the human in run B.
        shift: offset added to the times of B [s].
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
    return HumanDifference(joints, grips, _largest(joints.values()), _largest(grips.values()))


def _apart(time: FloatArray, values: FloatArray, times: FloatArray, other: FloatArray) -> SignalDifference | None:
    """Compare values of two runs, shape (n, k) and (m, k), at times since the same instant [s]; None: no overlap."""
    within = (time >= times[0]) & (time <= times[-1])
    if not within.any():
        return None
    time = time[within]
    overlaid = np.column_stack([np.interp(time, times, column) for column in other.T])
    apart = np.linalg.norm(values[within] - overlaid, axis=1)
    peak = int(apart.argmax())
    return SignalDifference(float(apart[peak]), float(time[peak]), float(np.sqrt((apart**2).mean())))


def _largest(signals: Iterable[SignalDifference | None]) -> float | None:
    return max((signal.peak_difference for signal in signals if signal), default=None)
