"""Completeness of recorded sensor data, and time skew of synchronised samples. No ROS.

A source publishes how many samples it sent, by sequence numbers (hric_msgs/SourceCount). Recorded samples are counted
by the numbers of the source, too: the frame number, or the time code of a sample, which equals number / rate. The
sequence numbers of the driver do not count. The count covers the interval of the experiment, from the first to the last
SourceCount in it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from hric_analysis.collection_record import TIME_CODE, Collection, Numbered, SourceCounts, SynchronisedStream
from hric_analysis.tracking import late_by
from hric_bags.reader import ControlRecord, RobotTime

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
BOUND = 2e-4
"""Specified maximum skew of resampled values of the robot, NatNet bodies and LSL streams [s], see INTERFACE.md of
hric_perception."""
ROUNDING = 1e-9
"""Tolerance for instants at the ends of the interval, which have rounding errors [s]."""
WINDOW = 2.0
"""Length of the windows over which a time shift is fitted as skew, without a time code [s] (project default,
unconfirmed)."""
MIN_SAMPLES = 11
"""Minimum number of samples in a window for its time shift to count (project default, unconfirmed)."""
MIN_SPEED = {"rad": 0.02, "m": 0.05}
"""Minimum RMS speed in a window for its time shift to count, by unit [rad/s], [m/s]. Project default, unconfirmed."""
SECTIONS = 10
"""Parts of a recording whose stamps must give the same second of a time code (project default, unconfirmed)."""
LOG_TOPIC = "control_log"


@dataclass(frozen=True)
class TimeError:
    """Statistics of the size of a time error.

    Attributes:
        median, p99, largest: median, 99 % quantile and maximum [s].
        within_bound: share that is at most BOUND [1].
        uncertainty: largest standard deviation due to noise [s]; None: the error was not fitted.
    """

    median: float
    p99: float
    largest: float
    within_bound: float
    uncertainty: float | None = None


@dataclass(frozen=True)
class SourceMetrics:
    """Completeness of one source in the interval of the experiment.

    Attributes:
        counts: unit of the counts: cycles, frames or samples.
        sent, recorded, lost, twice: samples sent, recorded, lost and recorded twice; None: not known.
        driver_lost: missing samples by the sequence numbers of the driver.
        stamps: difference between stamps and time codes; None: there is no time code.
        first, last: numbers of the first and the last sample that count; None: not known.
    """

    counts: str
    sent: int | None
    recorded: int
    lost: int | None
    twice: int
    driver_lost: int
    stamps: TimeError | None
    first: int | None = None
    last: int | None = None


@dataclass(frozen=True)
class SkewMetrics:
    """Validity and skew of one source of a synchronised stream.

    Attributes:
        valid: share of valid samples [1]; None: no samples.
        late: number of samples that arrived too late.
        told_skew: largest skew that the synchroniser reported [s]; None: it reported none.
        by: reference of the skew: time code, control log, or truth of the hand; None: there is none.
        skew: time error of the values; None: not known.
    """

    valid: float | None
    late: int
    told_skew: float | None
    by: str | None
    skew: TimeError | None


@dataclass(frozen=True)
class StreamMetrics:
    """Instants of a synchronised stream, and its sources.

    Attributes:
        rate: sample rate [Hz]; 0: at the stamps of a reference.
        ticks, expected, missing: instants; None: not known.
        grid_error: largest distance of a stamp from the grid [s]; None: there is no grid.
        bound: specified maximum skew [s].
        sources: skew of each source.
    """

    rate: float
    ticks: int
    expected: int | None
    missing: int | None
    grid_error: float | None
    bound: float
    sources: dict[str, SkewMetrics]


@dataclass(frozen=True)
class CollectionMetrics:
    """Completeness of the sensor data; None: there are no sensors.

    Attributes:
        sources: completeness of each source.
        sync: synchronised streams.
    """

    sources: dict[str, SourceMetrics] | None
    sync: dict[str, StreamMetrics] | None


def metrics(
    data: Collection | None, log: ControlRecord, robot_time: RobotTime, interval: Sequence[float] | None
) -> CollectionMetrics:
    """Return the completeness of sources and streams.

    Args:
        data: sensor data of the bag; None: there are no sensors.
        log: control log of the robot.
        robot_time: conversion from stamps to the time of the log.
        interval: begin and end of the experiment, by stamps [s]; None: not known, so the complete bag counts and the
            numbers of sent samples are unknown.
    """
    if data is None:
        return CollectionMetrics(None, None)
    begin, end = interval or (-np.inf, np.inf)
    sources = {
        topic: source_metrics(samples, data.counts.get(samples.source), begin, end)
        for topic, samples in sorted(data.sources.items())
    }
    streams = {
        topic: stream_metrics(stream, data, log, robot_time, begin, end)
        for topic, stream in sorted(data.streams.items())
    }
    return CollectionMetrics({f"/{LOG_TOPIC}": _robot(log, robot_time, begin, end), **sources}, streams)


def _robot(log: ControlRecord, robot_time: RobotTime, begin: float, end: float) -> SourceMetrics:
    """Return the counts of the robot, whose number of sent cycles follows from the first and last cycle number."""
    low, high = (edge if np.isinf(edge) else robot_time(edge) for edge in (begin, end))
    inside = (log.time >= low) & (log.time <= high)
    missing = sum(count for first, count in log.gaps if inside.any() and _within(log, first, inside))
    count = int(inside.sum())
    return SourceMetrics("cycles", count + missing, count, missing, 0, missing, None)


def _within(log: ControlRecord, first: int, inside: BoolArray) -> bool:
    """Return True if the missing cycle follows a recorded one in the interval."""
    before = first - log.first_cycle - sum(count for start, count in log.gaps if start < first) - 1
    return bool(0 <= before < len(inside) and inside[before])


def source_metrics(samples: Numbered, counts: SourceCounts | None, begin: float, end: float) -> SourceMetrics:
    """Return the counts of one source within the interval [s]."""
    inside = (samples.stamps >= begin) & (samples.stamps <= end)
    numbers = samples.numbers[inside]
    steps = np.diff(numbers)
    unit, driver_lost = "samples" if samples.source else "frames", int(np.sum(steps[steps > 1] - 1))
    stamps = None if samples.codes is None else _stamp_error(samples, inside)
    sequence = source_sequence(samples, counts)
    sent = None if counts is None or sequence is None else sent_between(counts, begin, end)
    if sent is None or sequence is None:
        twice = len(numbers) - distinct(numbers)
        return SourceMetrics(unit, None, len(numbers), None, twice, driver_lost, stamps)
    first, following, total = sent
    recorded = sequence[(sequence >= first) & (sequence < following)]
    count = distinct(recorded)
    twice = len(recorded) - count
    return SourceMetrics(unit, total, count, total - count, twice, driver_lost, stamps, first, following - 1)


def distinct(numbers: IntArray) -> int:
    """Return the number of distinct values, by a sort that is fast on nearly sorted arrays."""
    return int(np.count_nonzero(np.diff(np.sort(numbers, kind="stable")))) + bool(len(numbers))


def source_sequence(samples: Numbered, counts: SourceCounts | None) -> IntArray | None:
    """Return the source's sequence number of each sample that has one; None: not known.

    A time code within the second restarts every second. The seconds between two samples follow from the numbers of the
    driver, or from the stamps if the driver restarted; all stamps together give the second of the first sample.
    """
    if not samples.source:
        return samples.numbers
    known = np.isfinite(samples.codes) if samples.codes is not None else np.zeros(0, bool)
    if samples.codes is None or counts is None or not known.any():
        return None
    codes, stamps = samples.codes[known], samples.stamps[known]
    if codes.max() <= 1.0:
        steps = np.diff(samples.numbers[known]) / counts.rate
        passed = np.where(steps > 0.0, steps, np.diff(stamps)) - np.diff(codes)
        codes = codes + np.concatenate([[0.0], np.cumsum(np.rint(passed))])
        begins = {float(np.rint(np.median(part))) for part in np.array_split(stamps - codes, SECTIONS) if len(part)}
        if len(begins) > 1:
            return None
        codes = codes + begins.pop()
    numbers: IntArray = np.rint(codes * counts.rate).astype(np.int64)
    return numbers


def sent_between(counts: SourceCounts, begin: float, end: float) -> tuple[int, int, int] | None:
    """Return (first number, number after the last, count) of the samples sent in an interval [s]; None: not known.

    The samples are those between the first and the last message of the counts in the interval.
    """
    inside = np.flatnonzero((counts.stamps >= begin) & (counts.stamps <= end))
    if not np.isfinite([begin, end]).all() or len(inside) < 2 or (np.diff(counts.following[inside]) < 0).any():
        return None
    a, b = int(inside[0]), int(inside[-1])
    return int(counts.following[a]), int(counts.following[b]), int(counts.sent[b] - counts.sent[a])


def _stamp_error(samples: Numbered, inside: BoolArray) -> TimeError | None:
    """Return the statistics of the difference between stamps and time codes, modulo one second."""
    assert samples.codes is not None
    late = samples.stamps[inside] - samples.codes[inside]
    return _time_error(late - np.rint(late))


def _time_error(errors: FloatArray, uncertainty: float | None = None) -> TimeError | None:
    """Return the statistics of errors, shape (n,) [s]; None: none is finite."""
    known = np.abs(errors[np.isfinite(errors)])
    if not known.size:
        return None
    median, largest = float(np.median(known)), float(known.max())
    return TimeError(median, float(np.percentile(known, 99)), largest, float(np.mean(known <= BOUND)), uncertainty)


def stream_metrics(
    stream: SynchronisedStream, data: Collection, log: ControlRecord, robot_time: RobotTime, begin: float, end: float
) -> StreamMetrics:
    """Return the tick counts of a synchronised stream, and the skew of each of its sources."""
    inside = (stream.stamps >= begin - ROUNDING) & (stream.stamps <= end + ROUNDING)
    stamps, values = stream.stamps[inside], stream.values[inside]
    ticks = np.rint(stamps * stream.rate).astype(np.int64) if stream.rate else np.arange(len(stamps))
    expected, count = _expected(stream.rate, begin, end, ticks), distinct(ticks)
    gridded = stream.rate and len(ticks)
    skews = {}
    for column, topic in enumerate(stream.topics):
        valid = stream.valid[inside][:, column]
        columns = [index for index, source in enumerate(stream.sources) if source == topic]
        skews[topic] = SkewMetrics(
            float(valid.mean()) if len(valid) else None,
            stream.late.get(topic, 0),
            stream.skew.get(topic),
            *_skew(topic, columns, stamps, values, valid, stream, data, log, robot_time),
        )
    return StreamMetrics(
        stream.rate,
        count,
        expected,
        None if expected is None else expected - count,
        float(np.abs(stamps * stream.rate - ticks).max() / stream.rate) if gridded else None,
        BOUND,
        skews,
    )


def _expected(rate: float, begin: float, end: float, ticks: IntArray) -> int | None:
    """Return the number of expected ticks in the interval; without an interval, from the first to the last tick."""
    if not rate or not len(ticks):
        return None
    if not np.isfinite([begin, end]).all():
        return int(ticks[-1] - ticks[0] + 1)
    return int(np.floor((end + ROUNDING) * rate) - np.ceil((begin - ROUNDING) * rate) + 1)


def _skew(
    topic: str,
    columns: list[int],
    stamps: FloatArray,
    values: FloatArray,
    valid: BoolArray,
    stream: SynchronisedStream,
    data: Collection,
    log: ControlRecord,
    robot_time: RobotTime,
) -> tuple[str | None, TimeError | None]:
    """Return the reference (a time code, the control log, or the true hand motion), and the skew of the values."""
    names = [stream.names[index].removeprefix(f"{topic}.") for index in columns]
    if (code := f"data[{TIME_CODE}]") in names:
        late = stamps - values[:, columns[names.index(code)]]
        return "time code", _time_error(late[valid])
    if topic.rsplit("/", 1)[-1] == LOG_TOPIC:
        joints = [joint for joint in log.joint_names if f"position[{joint}]" in names]
        seen = values[:, [columns[names.index(f"position[{joint}]")] for joint in joints]]
        in_log = [log.joint_names.index(joint) for joint in joints]
        times = np.array([robot_time(float(stamp)) for stamp in stamps])
        true, speed = (
            np.column_stack([np.interp(times, log.time, part[:, c]) for c in in_log])
            for part in (log.position, log.velocity)
        )
        return "control log", _fitted(stamps, seen - true, speed, valid, MIN_SPEED["rad"])
    axes = [index for index, name in zip(columns, names, strict=True) if ".position." in name]
    if data.truth is not None and len(axes) == 3 and data.frame == data.truth[2]:
        spline = scipy.interpolate.CubicSpline(*data.truth[:2])
        inside = valid & (stamps > data.truth[0][0]) & (stamps < data.truth[0][-1])
        apart, speed = values[:, axes] - spline(stamps), spline(stamps, 1)
        return "truth of the hand", _fitted(stamps, apart, speed, inside, MIN_SPEED["m"])
    return None, None


def _fitted(
    stamps: FloatArray, apart: FloatArray, speed: FloatArray, valid: BoolArray, min_speed: float
) -> TimeError | None:
    """Return statistics of the time shift that, with an offset, fits best in each window [s].

    `uncertainty` is the largest standard deviation of a shift due to noise of the values. Windows with less than half
    the samples of the fullest, as at the ends, are skipped: few samples show only noise.
    """
    late, sigmas = [], []
    usable = np.flatnonzero(valid)
    numbers = stamps[usable] // WINDOW
    order = np.argsort(numbers, kind="stable")
    windows = np.split(usable[order], np.flatnonzero(np.diff(numbers[order])) + 1)
    min_count = max(MIN_SAMPLES, 0.5 * max(map(len, windows)))
    for use in windows:
        if len(use) >= min_count and np.sqrt(np.mean(np.sum(speed[use] ** 2, axis=1))) > min_speed:
            shift, sigma = late_by(speed[use], apart[use])
            late.append(shift)
            sigmas.append(sigma)
    return _time_error(np.array(late), max(sigmas, default=None))
