"""Recorded motion and torque of an arm as arrays, and checks of them: finite values, increasing time, SI units."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hric_core.errors import HricError

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

FAR = 0.5
"""Distance outside the joint's range beyond which a position is not in radians [rad]; project default, unconfirmed."""
MOVED = 0.05
"""Minimum position span of a joint for the check of units [rad]; project default, unconfirmed."""
SPAN = 20
"""Number of samples over which position change and integrated velocity are compared: more than their noise hides."""
SLOPE_TOLERANCE = 0.25
"""Maximum relative error between position change and integrated velocity [1]; project default, unconfirmed."""
MIN_CORRELATION = 0.5
"""Minimum correlation of position change and integrated velocity [1]; project default, unconfirmed."""
WRONG_UNITS = (
    (1e-3, "the time looks like milliseconds; seconds are needed"),
    (1e-6, "the time looks like microseconds; seconds are needed"),
    (1e-9, "the time looks like nanoseconds; seconds are needed"),
    (np.pi / 180.0, "the velocities look like degrees per second; rad/s are needed"),
    (180.0 / np.pi, "the positions look like degrees; radians are needed"),
)
"""Pairs (ratio of position change to integrated velocity, wrong unit that causes it)."""


class LogError(HricError):
    """Error of a log that cannot be compared with a model; the message gives row, column and reason."""


@dataclass(frozen=True)
class ArmLog:
    """Log of an arm's motion and torque: n samples of j joints.

    Attributes:
        joint_names: order of the columns.
        time: shape (n,) [s].
        q, dq: position and velocity, shape (n, j) [rad, rad/s].
        tau: torque measured on the link side of the gears, gravity included (tau_J), shape (n, j) [N m].
        columns: the log's names of time, positions, velocities and torques, 1 + 3 j names.
        rows: number of each sample's row in the source, shape (n,), e.g. line numbers of a file.
        row: word for one row in error messages, e.g. "line".
    """

    joint_names: tuple[str, ...]
    time: FloatArray
    q: FloatArray
    dq: FloatArray
    tau: FloatArray
    columns: tuple[str, ...]
    rows: IntArray
    row: str

    def at(self, sample: int) -> str:
        """Return the row of a sample in the source as a text, e.g. "line 7"."""
        return f"{self.row} {self.rows[sample]}"


def check_log(log: ArmLog, lower: Sequence[float], upper: Sequence[float]) -> None:
    """Raise an error if values of a log cannot be those of this arm in SI units.

    Args:
        log: recorded log.
        lower: lower position limit of each joint [rad].
        upper: upper position limit of each joint [rad].

    Raises:
        LogError: the message gives row, column and reason.
    """
    _check_finite(log)
    _check_time(log)
    _check_range(log, np.array(lower), np.array(upper))
    _check_motion(log)


def _check_finite(log: ArmLog) -> None:
    values = np.column_stack([log.time, log.q, log.dq, log.tau])
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        k, column = bad[0]
        raise LogError(f"{log.at(k)}, column {log.columns[column]} is {values[k, column]}; each value must be finite")


def _check_time(log: ArmLog) -> None:
    if len(log.time) < 2:
        raise LogError(f"the log has {len(log.time)} samples; 2 or more are needed")
    steps = np.diff(log.time)
    if (steps <= 0.0).any():
        k = int(np.argmax(steps <= 0.0)) + 1
        raise LogError(
            f"time does not increase: {log.columns[0]} is {log.time[k]:.9g} in {log.at(k)} after "
            f"{log.time[k - 1]:.9g} in {log.at(k - 1)}"
        )


def _check_range(log: ArmLog, lower: FloatArray, upper: FloatArray) -> None:
    excess = np.maximum(lower - log.q, log.q - upper)
    if excess.max() <= FAR:
        return
    k, j = np.unravel_index(int(np.argmax(excess)), excess.shape)
    in_degrees = np.deg2rad(log.q)
    degrees = np.abs(log.q).max() > 2.0 * np.pi and (np.maximum(lower - in_degrees, in_degrees - upper) <= FAR).all()
    guess = WRONG_UNITS[-1][1] if degrees else "are these the joint positions, in radians?"
    span = f"{log.joint_names[j]} ranges from {lower[j]:.4g} to {upper[j]:.4g} rad"
    raise LogError(f"{log.at(int(k))}: {log.columns[1 + j]} is {log.q[k, j]:.6g}, but {span}; {guess}")


def _check_motion(log: ArmLog) -> None:
    """Raise an error if positions do not match velocities: slope and correlation over short spans, per joint."""
    steps = np.diff(log.time)[:, None]
    integral = np.vstack([np.zeros(log.q.shape[1]), np.cumsum(0.5 * (log.dq[1:] + log.dq[:-1]) * steps, axis=0)])
    span = min(SPAN, len(log.time) - 1)
    change, expected = log.q[span:] - log.q[:-span], integral[span:] - integral[:-span]
    product, expected_square = (change * expected).sum(axis=0), (expected * expected).sum(axis=0)
    moved = (np.ptp(log.q, axis=0) > MOVED) & (expected_square > 0.0)
    if not moved.any():
        return
    slopes = product[moved] / expected_square[moved]
    for slope, guess in WRONG_UNITS:
        if abs(np.median(slopes) / slope - 1.0) < SLOPE_TOLERANCE:
            raise LogError(
                f"the positions change {np.median(slopes):.3g} times as fast as the recorded velocities: {guess}"
            )
    correlations = product[moved] / np.sqrt(expected_square[moved] * (change * change).sum(axis=0)[moved])
    for j, slope, correlation in zip(np.flatnonzero(moved), slopes, correlations, strict=True):
        if correlation < MIN_CORRELATION or abs(slope - 1.0) > SLOPE_TOLERANCE:
            q, dq = log.columns[1 + j], log.columns[1 + len(log.joint_names) + j]
            raise LogError(
                f"{dq} is not the derivative of {q}: {q} changes {slope:.3g} times as fast as {dq} (correlation "
                f"{correlation:.2f}); are the columns in the right order?"
            )
