"""Motion and torque of an arm log, resampled uniformly, low-pass filtered without phase shift, with accelerations.

Position, velocity and torque of the log pass one filter. The torque that a model computes for the filtered motion
passes the same filter before the comparison, so that friction, which changes faster than the motion, is smoothed
equally on both sides.
"""

from dataclasses import dataclass

import numpy as np
import scipy.signal

from franka_hw_interface.arm_log import ArmLog, LogError
from hric_core.geometry import FloatArray

CUTOFF = 10.0
"""Cut-off frequency of the low-pass; default chosen by this project, unconfirmed [Hz]."""
ORDER = 4
"""Order of the Butterworth low-pass, run forwards and backwards; default chosen by this project, unconfirmed."""
EDGE_PERIODS = 3.0
"""Time dropped at each end because the filter lacks samples there, in periods of the cut-off frequency [1].

Project default, unconfirmed.
"""
MIN_DURATION = 2.0
"""Minimum duration of the log without the dropped ends [s]; project default, unconfirmed."""
MIN_RATE = 5.0
"""Minimum number of samples per period of the cut-off frequency [1].

The error of central differences is then at most 7 % at half the cut-off.
"""
KEPT_RATE = 20.0
"""Number of filtered samples per period of the cut-off frequency at which a model is evaluated [1]."""
LONGEST_GAP = 0.5
"""Maximum gap in the log, in periods of the cut-off frequency [1]; shorter gaps are interpolated."""


@dataclass(frozen=True)
class Signals:
    """Filtered signals of j joints at m instants, at a uniform rate.

    Attributes:
        time: time on the clock of the log, shape (m,) [s].
        q, dq, ddq, tau: position, velocity, acceleration, torque, shape (m, j) [rad, rad/s, rad/s^2, N m].
        rate: sampling rate of these signals [Hz].
        log_rate: sampling rate of the log, at which it was filtered and differentiated [Hz].
        cutoff: cut-off frequency of the low-pass [Hz].
        valid: slice of the valid instants, without the filter's transients.
    """

    time: FloatArray
    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    tau: FloatArray
    rate: float
    log_rate: float
    cutoff: float
    valid: slice

    def low_pass(self, values: FloatArray) -> FloatArray:
        """Return values at the same m instants, shape (m, ...), filtered like these signals."""
        return low_pass(values, self.rate, self.cutoff)

    @property
    def duration(self) -> float:
        """Duration of the valid instants [s]."""
        return float(np.ptp(self.time[self.valid]))

    def summary(self) -> str:
        """Return a text for reports: filter, sampling rates, and time dropped at both ends of the log."""
        low_pass = (
            f"zero-phase Butterworth low-pass of order {ORDER}, forwards and backwards, cut-off {self.cutoff:g} Hz"
        )
        instants = f"evaluated at {self.rate:.6g} Hz, {EDGE_PERIODS / self.cutoff:g} s dropped at each end"
        return (
            f"{low_pass}, on q, dq, measured and modelled torque; ddq: central differences of dq at "
            f"{self.log_rate:.6g} Hz; {instants}"
        )


def low_pass(values: FloatArray, rate: float, cutoff: float) -> FloatArray:
    """Apply a zero-phase low-pass along the first axis; rate, cutoff: [Hz]."""
    filtered: FloatArray = scipy.signal.sosfiltfilt(
        scipy.signal.butter(ORDER, cutoff, fs=rate, output="sos"), values, axis=0
    )
    return filtered


def condition(log: ArmLog, cutoff: float = CUTOFF) -> Signals:
    """Resample a log at its median rate, filter it, and derive the accelerations.

    Args:
        log: log checked by `check_log`.
        cutoff: cut-off frequency of the low-pass [Hz].

    Raises:
        LogError: the log has too few samples per second, has a gap, or is too short.
    """
    rate = 1.0 / float(np.median(np.diff(log.time)))
    _check_sampling(log, rate, cutoff)
    span = float(log.time[-1] - log.time[0])
    time = np.linspace(log.time[0], log.time[-1], round(span * rate) + 1)
    period = float(time[1] - time[0])

    def filtered(values: FloatArray) -> FloatArray:
        return low_pass(
            np.column_stack([np.interp(time, log.time, column) for column in values.T]), 1.0 / period, cutoff
        )

    q, dq, tau = map(filtered, (log.q, log.dq, log.tau))
    ddq = np.gradient(dq, period, axis=0)
    step = max(1, int(1.0 / (KEPT_RATE * cutoff * period)))
    edge = round(EDGE_PERIODS / cutoff / (step * period))
    return Signals(
        time=time[::step],
        q=q[::step],
        dq=dq[::step],
        ddq=ddq[::step],
        tau=tau[::step],
        rate=1.0 / (step * period),
        log_rate=1.0 / period,
        cutoff=cutoff,
        valid=slice(edge, -edge),
    )


def _check_sampling(log: ArmLog, rate: float, cutoff: float) -> None:
    if rate < MIN_RATE * cutoff:
        raise LogError(
            f"the log has {rate:.3g} samples per second; a cut-off of {cutoff:g} Hz needs {MIN_RATE * cutoff:g} "
            "or more: record faster, or lower "
            "the cut-off (is the time in seconds?)"
        )
    edge = EDGE_PERIODS / cutoff
    span = float(log.time[-1] - log.time[0])
    if span < MIN_DURATION + 2.0 * edge:
        raise LogError(
            f"the log is too short: {span:.3g} s; {MIN_DURATION + 2.0 * edge:.3g} s are needed, of which the "
            f"filter takes {edge:g} s at each end"
        )
    gaps = np.diff(log.time)
    k = int(np.argmax(gaps))
    if gaps[k] > LONGEST_GAP / cutoff:
        raise LogError(
            f"{gaps[k]:.3g} s are missing between {log.at(k)} and {log.at(k + 1)}, at {log.time[k]:.9g} s; a "
            f"cut-off of {cutoff:g} Hz allows "
            f"{LONGEST_GAP / cutoff:.3g} s: cut the log there, or lower the cut-off"
        )
