"""Metrics of marker tracking by the end effector: lag, error after the lag, acceleration, frames, stamps. No ROS.

The tracking controller moves the end effector relative to an anchor: the positions of marker and end effector at the
first frame it uses, and again after a loss of the marker (unless it catches up). So the error after a lag is

    e(t) = p(t) - p_0 - R (m(t - lag) - m(t_0))

with p and m the positions of end effector and marker, within the stretch that began at t_0; p_0 is the position of the
end effector at t_0, or after a loss its target at the return. The lag maximises the normalised cross-correlation of the
two displacements.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from hric_analysis.tracking_record import CapturedFrames, States, TrackingRecord

FloatArray = npt.NDArray[np.float64]
THESIS_ROTATION = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
"""Rotation matrix from a motion capture frame with y up to the robot's base frame (thesis ch. 3.3); default of the
controllers."""
STEP = 1e-3
"""Step of the common time axis and of the lags [s]."""
LONGEST_LAG, COARSE = 1.0, 10
"""Longest lag that is searched [s], and coarse increment of the search [steps]. Project default, unconfirmed."""
MIN_MOTION = 1e-3
"""Standard deviation of the marker position below which no lag is computed [m]. Project default, unconfirmed."""
SMOOTHED = 10
"""Number of cycles over which the smoothed acceleration is computed, so that encoder noise has little effect."""
STAMP_WINDOW = 2.0
"""Length of the windows in which the error of the time stamps is assumed constant [s]."""


@dataclass(frozen=True)
class FollowedMarker:
    """Positions of marker and end effector on a common time axis with n samples.

    Attributes:
        time: robot time, shape (n,) [s].
        ee: position of the end effector in the base frame, shape (n, 3) [m].
        marker: position of the marker, along the axes of the base frame, shape (n, 3) [m].
        exact: True if `marker` is the true position, False if it was measured by motion capture.
        stretches: (first, end) indices of each stretch in which the marker was followed.
        origins: reference position p_0 of the end effector in each stretch, shape (3,) [m].
    """

    time: FloatArray
    ee: FloatArray
    marker: FloatArray
    exact: bool
    stretches: tuple[tuple[int, int], ...]
    origins: tuple[FloatArray, ...]

    def desired(self, lag: int) -> FloatArray:
        """Return the desired end-effector position for a lag [steps], shape (n, 3) [m]; NaN while not following."""
        path = np.full_like(self.ee, np.nan)
        for (begin, end), origin in zip(self.stretches, self.origins, strict=True):
            if begin + lag < end:
                path[begin + lag : end] = origin + self.marker[begin : end - lag] - self.marker[begin]
        return path

    def error(self, lag: int) -> FloatArray:
        """Return the tracking error for a lag [steps], shape (n, 3) [m]; NaN while not following."""
        return self.ee - self.desired(lag)


def followed(
    record: TrackingRecord, times: FloatArray, ee: FloatArray, R_base_marker: FloatArray, *, catch_up: bool = False
) -> FollowedMarker | None:
    """Resample marker and end effector to a common time axis, from the first valid marker on; None: there is none.

    Args:
        record: recorded frames, controller states and true motion.
        times: times of the end effector positions, shape (k,) [s].
        ee: positions of the end effector in the base frame, shape (k, 3) [m].
        R_base_marker: rotation from the motion capture frame to the base, shape (3, 3).
        catch_up: True if the controller keeps its anchor when the marker is lost.
    """
    frames = record.frames
    anchors = _anchors(frames, record.states, catch_up)
    if not anchors:
        return None
    begin, end = anchors[0][0], float(times[-1])
    if record.truth is not None:
        end = min(end, float(record.truth[0][-1]))
    if end - begin < 2 * STEP:
        return None
    time = np.arange(begin, end, STEP)
    seen = frames.position[frames.valid] @ R_base_marker.T
    source = record.truth if record.truth is not None else (frames.time[frames.valid], seen)
    marker = np.stack([np.interp(time, source[0], column) for column in source[1].T], axis=1)
    if record.truth is not None and len(record.truth[0]) > 3:
        marker = scipy.interpolate.CubicSpline(*record.truth)(time)
    path = np.stack([np.interp(time, times, column) for column in ee.T], axis=1)
    stretches = [(int(np.searchsorted(time, a)), int(np.searchsorted(time, min(b, end)))) for a, b in anchors]
    stretches = [(a, b) for a, b in stretches if b - a > 1]
    origins = [path[a] if k == 0 else _target(record.states, float(time[a])) for k, (a, _) in enumerate(stretches)]
    return FollowedMarker(time, path, marker, record.truth is not None, tuple(stretches), tuple(origins))


def _target(states: States, time: float) -> FloatArray:
    """Return the end effector's target when following resumed after `time`, the reference position from then on."""
    after = [
        k for k in range(int(np.searchsorted(states.time, time)), len(states.time)) if states.tracking[k] == "following"
    ]
    target: FloatArray = states.target[after[0] if after else -1]
    return target


def _anchors(frames: CapturedFrames, states: States, catch_up: bool) -> list[tuple[float, float]]:
    """Return (time of the first frame, time of the loss) of each stretch in which the marker was followed [s]."""
    valid = frames.time[frames.valid]
    if valid.size == 0:
        return []
    lost = [
        states.time[k] for k in range(1, len(states.tracking)) if states.tracking[k] == "lost" != states.tracking[k - 1]
    ]
    anchors, begin = [], float(valid[0])
    for time in [] if catch_up else lost:
        anchors.append((begin, float(time)))
        after = valid[valid > time]
        if after.size == 0:
            return anchors
        begin = float(after[0])
    return [*anchors, (begin, np.inf)]


def lag_of(data: FollowedMarker) -> tuple[float, float] | None:
    """Return (lag [s], normalised cross-correlation at this lag); None if marker or end effector hardly moves.

    The maximum is searched in increments of COARSE steps, then of one step, then by a parabola through three points.
    """
    count = min(int(LONGEST_LAG / STEP), len(data.time) // 2)
    if count < 1 or _likeness(data, 0) is None:
        return None
    rough = max(range(0, count, COARSE), key=lambda lag: _likeness(data, lag) or 0.0)
    near = range(max(0, rough - COARSE), min(count, rough + COARSE + 1))
    values = {lag: _likeness(data, lag) or 0.0 for lag in near}
    best = max(values, key=lambda lag: values[lag])
    shift = 0.0
    if best - 1 in values and best + 1 in values:
        left, middle, right = values[best - 1], values[best], values[best + 1]
        bend = left - 2 * middle + right
        shift = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return STEP * (best + shift), values[best]


def _likeness(data: FollowedMarker, lag: int) -> float | None:
    """Return the normalised cross-correlation at a lag [steps]; None if marker or end effector hardly moves."""
    desired = data.desired(lag)
    both = ~np.isnan(desired[:, 0])
    if np.count_nonzero(both) < 2:
        return None
    a, b = (part[both] - part[both].mean(axis=0) for part in (data.ee, desired))
    size_a, size_b = (float(np.sqrt(np.sum(part * part))) for part in (a, b))
    if min(size_a, size_b) < MIN_MOTION * np.sqrt(len(a)):
        return None
    return float(np.sum(a * b)) / (size_a * size_b)


def rms(vectors: FloatArray) -> float:
    """Return the root mean square of the lengths of vectors of shape (n, 3); rows with NaN are skipped."""
    return float(np.sqrt(np.nanmean(np.sum(vectors**2, axis=1))))


def acceleration(time: FloatArray, path: FloatArray, cycles: int = 1) -> float:
    """Return the RMS acceleration [m/s^2] of a path of shape (n, 3) [m] by second differences over `cycles` cycles.

    Differences across a gap in the log are skipped.
    """
    period = float(np.median(np.diff(time)))
    regular = np.abs(time[2 * cycles :] - time[: -2 * cycles] - 2 * cycles * period) < 0.5 * period
    second = (path[2 * cycles :] - 2 * path[cycles:-cycles] + path[: -2 * cycles]) / (cycles * period) ** 2
    return rms(second[regular])


@dataclass(frozen=True)
class FramesMetrics:
    """Completeness and latency of motion capture frames.

    Attributes:
        received, lost, not_in_order: counts of frames, from the frame numbers.
        untracked: count of frames in which the body was not tracked.
        rate: frame rate [Hz]; None: there is only one frame.
        latency_median, latency_max: time from exposure to arrival [s]; None: not known.
    """

    received: int
    lost: int
    not_in_order: int
    untracked: int
    rate: float | None
    latency_median: float | None
    latency_max: float | None


@dataclass(frozen=True)
class StampError:
    """Error of the frames' time stamps relative to the true hand motion, with its standard deviation.

    Attributes:
        mean, uncertainty: error over the whole recording, and its standard deviation [s].
        largest, largest_uncertainty: largest error in a window, and its standard deviation [s].
        window: length of the windows [s].
    """

    mean: float
    uncertainty: float
    largest: float
    largest_uncertainty: float
    window: float


@dataclass(frozen=True)
class Accelerations:
    """RMS accelerations of end effector and marker.

    Attributes:
        measured, measured_smoothed: end effector, by differences over 1 and over SMOOTHED cycles [m/s^2].
        ideal: marker [m/s^2]; None: the true motion is not known.
        ratio, ratio_smoothed: both accelerations of the end effector divided by that of the marker [1].
    """

    measured: float
    measured_smoothed: float
    ideal: float | None
    ratio: float | None
    ratio_smoothed: float | None


@dataclass(frozen=True)
class HumanPhase:
    """Phase of the emulated human's program, with the robot time at which it starts [s]."""

    time: float
    phase: str


@dataclass(frozen=True, kw_only=True)
class TrackingMetrics:
    """Metrics of marker tracking in a run; None: there was no valid marker, or the value is not known.

    Attributes:
        controller, body: names of the controller and of the tracked body.
        marker: source of the marker's position, "truth" or "motion capture".
        frames: completeness of the motion capture frames.
        stamp_error: error of the frames' time stamps.
        losses, ignored, clamped, refused: counts of the tracking controller; refused: by reason.
        phases: phases of the emulated human's program.
        first_marker: robot time of the first valid marker [s].
        lag, correlation: lag of the end effector [s], and normalised cross-correlation at this lag [1].
        rms_error, largest_error: tracking error after compensation of the lag [m].
        acceleration: accelerations of end effector and marker.
    """

    controller: str
    body: str
    marker: str
    frames: FramesMetrics
    stamp_error: StampError | None
    losses: int
    ignored: int
    clamped: int
    refused: dict[str, int]
    phases: tuple[HumanPhase, ...]
    first_marker: float | None
    lag: float | None
    correlation: float | None
    rms_error: float | None
    largest_error: float | None
    acceleration: Accelerations | None


def frames_metrics(frames: CapturedFrames) -> FramesMetrics:
    """Return the counts of received, lost, unordered and untracked frames, and their rate and latency."""
    steps = np.diff(frames.number)
    known = frames.latency[np.isfinite(frames.latency)]
    span = float(frames.time[-1] - frames.time[0])
    return FramesMetrics(
        len(frames.number),
        int(np.sum(steps[steps > 1] - 1)),
        int(np.count_nonzero(steps < 1)),
        int(np.count_nonzero(~frames.valid)),
        (len(frames.number) - 1) / span if span > 0 else None,
        float(np.median(known)) if known.size else None,
        float(known.max()) if known.size else None,
    )


def stamp_error(record: TrackingRecord, R_base_marker: FloatArray) -> StampError | None:
    """Return the error of the frames' stamps relative to the true hand motion; None: the true motion is not known.

    The error is the time shift that, together with an offset, fits best. A frame has the position p at its exposure, so
    with a late stamp t it is behind the true position m(t): p - m(t) = -error v(t) + constant.
    """
    if record.truth is None or len(record.truth[0]) < 4:
        return None
    spline, frames = scipy.interpolate.CubicSpline(*record.truth), record.frames
    use = frames.valid & (frames.time > record.truth[0][0]) & (frames.time < record.truth[0][-1])
    time, seen = frames.time[use], frames.position[use] @ R_base_marker.T
    if time.size < 10 or rms(spline(time, 1)) < MIN_MOTION:
        return None
    speed, apart = spline(time, 1), seen - spline(time)
    late, sigma = late_by(speed, apart)
    windows = [time // STAMP_WINDOW == k for k in np.unique(time // STAMP_WINDOW)]
    parts = [late_by(speed[w], apart[w]) for w in windows if rms(speed[w]) > 0.5 * rms(speed)]
    return StampError(late, sigma, *max(parts, key=lambda part: abs(part[0])), STAMP_WINDOW)


def late_by(speed: FloatArray, apart: FloatArray) -> tuple[float, float]:
    """Return the least-squares time shift between two motions and its standard deviation [s].

    Args:
        speed: true velocity at each stamp, shape (n, k).
        apart: measured minus true values, shape (n, k).
    """
    v, d = speed - speed.mean(axis=0), apart - apart.mean(axis=0)
    power = float(np.sum(v * v))
    late = -float(np.sum(v * d)) / power
    left = d + late * v
    return late, float(np.sqrt(np.sum(left**2) / left.size / power))


def metrics(
    data: FollowedMarker | None, record: TrackingRecord, times: FloatArray, ee: FloatArray, R_base_marker: FloatArray
) -> TrackingMetrics:
    """Return the metrics of recorded marker tracking; `times`, `ee`: times and end-effector positions of all cycles."""
    last, lag, error = record.states.last, None if data is None else lag_of(data), None
    if data is not None:
        error = data.error(round((0.0 if lag is None else lag[0]) / STEP))
    return TrackingMetrics(
        controller=record.states.controller,
        body=record.frames.body,
        marker="truth" if record.truth is not None else "motion capture",
        frames=frames_metrics(record.frames),
        stamp_error=stamp_error(record, R_base_marker),
        losses=int(last.losses),
        ignored=int(last.ignored),
        clamped=int(last.clamped),
        refused=dict(zip(map(str, last.refused_reasons), map(int, last.refused_counts), strict=True)),
        phases=tuple(HumanPhase(time, phase) for time, phase in record.phases),
        first_marker=None if data is None else float(data.time[0]),
        lag=None if lag is None else lag[0],
        correlation=None if lag is None else lag[1],
        rms_error=None if error is None else rms(error),
        largest_error=None if error is None else float(np.nanmax(np.linalg.norm(error, axis=1))),
        acceleration=None if data is None else _accelerations(data, record, times, ee),
    )


def _ideal(data: FollowedMarker, record: TrackingRecord) -> float | None:
    """Return the RMS acceleration of the marker [m/s^2]; None: the true motion is not known.

    It is computed with the marker's clock, as the drift of another clock would distort the motion.
    """
    if record.truth is None or len(record.truth[0]) < 4:
        return None
    marker_time = record.truth[0] if record.own_time is None else record.own_time
    begin, end = np.interp(data.time[[0, -1]], record.truth[0], marker_time)
    time = np.arange(begin, end, STEP)
    return acceleration(time, scipy.interpolate.CubicSpline(marker_time, record.truth[1])(time), SMOOTHED)


def _accelerations(data: FollowedMarker, record: TrackingRecord, times: FloatArray, ee: FloatArray) -> Accelerations:
    use = (times >= data.time[0]) & (times <= data.time[-1])
    measured, smoothed = (acceleration(times[use], ee[use], cycles) for cycles in (1, SMOOTHED))
    ideal = _ideal(data, record)
    ratios = [value / ideal if ideal else None for value in (measured, smoothed)]
    return Accelerations(measured, smoothed, ideal, *ratios)
