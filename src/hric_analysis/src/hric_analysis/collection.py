"""Completeness of recorded sensor data, and time skew of synchronised samples. No ROS.

A source (emulated device) publishes the sequence numbers of the samples that it sent (hric_msgs/SourceCount). Recorded
samples are counted by the same numbers: the frame number, or the time code of a sample, which equals number / rate. The
sequence numbers of the driver are not used for this. The count covers the interval of the experiment, from the first to
the last SourceCount in it.
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
"""Specified maximum time skew of resampled values of the robot, NatNet bodies and LSL streams [s]; see INTERFACE.md of
hric_perception."""
ROUNDING = 1e-9
"""Tolerance for rounding errors of instants at the ends of the interval [s]."""
WINDOW = 2.0
"""Length of the windows in which a time shift is fitted to determine the skew of values without a time code [s]
(project default, unconfirmed)."""
MIN_SAMPLES = 11
"""Minimum number of samples in a window to fit a time shift (project default, unconfirmed)."""
MIN_SPEED = {"rad": 0.02, "m": 0.05}
"""Minimum RMS speed in a window to fit a time shift, by unit of the values [rad/s], [m/s]. Project default,
unconfirmed."""
SECTIONS = 10
"""Number of parts of a recording; the stamps of each must give the same whole second as start of the time code
(project default, unconfirmed)."""
LOG_TOPIC = "control_log"


@dataclass(frozen=True)
class TimeError:
    """Statistics of the absolute value of a time error.

    Attributes:
        median, p99, largest: median, 99 % quantile and maximum [s].
        within_bound: share of the values up to BOUND [1].
        uncertainty: largest standard deviation of a fitted error, due to noise [s]; None: the error was not fitted.
    """

    median: float
    p99: float
    largest: float
    within_bound: float
    uncertainty: float | None = None


@dataclass(frozen=True)
class SourceMetrics:
    """Completeness of one source's samples in the interval of the experiment.

    Attributes:
        counts: unit of the counts: cycles, frames or samples.
        sent, recorded, lost, twice: numbers of samples sent, recorded, lost and recorded twice; None: not known.
        driver_lost: number of missing samples according to the driver's sequence numbers.
        stamps: difference between stamps and time codes; None: there is no time code.
        first, last: sequence numbers of the first and last counted sample; None: not known.
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
    """Validity and time skew of one source of a synchronised stream.

    Attributes:
        valid: share of valid samples [1]; None: there are no samples.
        late: number of samples that arrived too late.
        told_skew: largest skew that the synchroniser reported [s]; None: it reported none.
        by: reference of the skew: "time code", "control log" or "truth of the hand"; None: there is none.
        skew: time error of the values; None: not known.
    """

    valid: float | None
    late: int
    told_skew: float | None
    by: str | None
    skew: TimeError | None


@dataclass(frozen=True)
class StreamMetrics:
    """Completeness of a synchronised stream, and skew of its sources.

    Attributes:
        rate: sample rate [Hz]; 0: instants are the stamps of a reference source.
        ticks, expected, missing: numbers of recorded, expected and missing instants; None: not known.
        grid_error: largest distance of a stamp from the regular grid [s]; None: there is no grid.
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
    """Completeness of a run's sensor data; both attributes are None if there are no sensors.

    Attributes:
        sources: completeness of each source, by topic.
        sync: metrics of each synchronised stream, by topic.
    """

    sources: dict[str, SourceMetrics] | None
    sync: dict[str, StreamMetrics] | None


def metrics(
    data: Collection | None, log: ControlRecord, robot_time: RobotTime, interval: Sequence[float] | None
) -> CollectionMetrics:
    """Return the completeness of all sources and synchronised streams of a run.

    Args:
        data: sensor data of the bag; None: there are no sensors.
        log: control log of the robot.
        robot_time: conversion from stamps to robot time, as in the log.
        interval: begin and end of the experiment, as stamps [s]; None: not known; then the complete bag is evaluated,
            and the numbers of sent samples are unknown.
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
    """Return the counts of the robot's cycles; their number follows from the first and last cycle number."""
    low, high = (edge if np.isinf(edge) else robot_time(edge) for edge in (begin, end))
    inside = (log.time >= low) & (log.time <= high)
    missing = sum(count for first, count in log.gaps if inside.any() and _within(log, first, inside))
    count = int(inside.sum())
    return SourceMetrics("cycles", count + missing, count, missing, 0, missing, None)


def _within(log: ControlRecord, first: int, inside: BoolArray) -> bool:
    """Return True if the recorded cycle before the missing cycle number `first` lies in the interval."""
    before = first - log.first_cycle - sum(count for start, count in log.gaps if start < first) - 1
    return bool(0 <= before < len(inside) and inside[before])


def source_metrics(samples: Numbered, counts: SourceCounts | None, begin: float, end: float) -> SourceMetrics:
    """Return the completeness of one source's samples with stamps from begin to end [s]."""
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
    """Return the number of distinct values; fast for nearly sorted arrays."""
    return int(np.count_nonzero(np.diff(np.sort(numbers, kind="stable")))) + bool(len(numbers))


def source_sequence(samples: Numbered, counts: SourceCounts | None) -> IntArray | None:
    """Return the source's sequence number of each sample that has one; None: not known.

    A time code may contain only the fraction of a second. The whole seconds between two samples follow from the
    driver's sequence numbers, or from the stamps if the driver restarted; all stamps together give the first second.
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
    """Return (first number, number after the last, count) of the samples sent from begin to end [s]; None: not known.

    Samples between the first and the last SourceCount message in the interval are counted.
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
    """Return the statistics of time errors, shape (n,) [s]; None: no value is finite."""
    known = np.abs(errors[np.isfinite(errors)])
    if not known.size:
        return None
    median, largest = float(np.median(known)), float(known.max())
    return TimeError(median, float(np.percentile(known, 99)), largest, float(np.mean(known <= BOUND)), uncertainty)


def stream_metrics(
    stream: SynchronisedStream, data: Collection, log: ControlRecord, robot_time: RobotTime, begin: float, end: float
) -> StreamMetrics:
    """Return the numbers of instants of a synchronised stream, and the skew of each of its sources."""
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
    """Return the expected number of instants from begin to end [s]; without an interval, from first to last instant."""
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
    """Return the reference of a source's skew (see `SkewMetrics.by`), and the skew; (None, None): no reference."""
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
    """Return statistics of the time shift that, together with an offset, fits best in each window [s].

    `uncertainty` is the largest standard deviation of a shift due to noise of the values. Windows with less than half
    the samples of the fullest one, such as those at the ends, are skipped, as few samples show only noise.
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
