"""Completeness of recorded sensor data, and time skew of synchronised samples. No ROS.

A source publishes how many samples it sent, by sequence numbers (hric_msgs/SourceCount). Recorded samples are counted
by the numbers of the source, too: the frame number, or the time code of a sample, which equals number / rate. The
sequence numbers of the driver do not count. The count covers the interval of the experiment, from the first to the last
SourceCount in it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from hric_analysis.collection_record import TIME_CODE, Collection, Counts, Numbered, Stream
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


def metrics(
    data: Collection | None, log: ControlRecord, robot_time: RobotTime, interval: Sequence[float] | None
) -> dict[str, Any]:
    """Return the keys `sources` and `sync` of metrics.json.

    Args:
        data: sensor data of the bag; None: there are no sensors, and both keys are None.
        log: control log of the robot.
        robot_time: conversion from stamps to the time of the log.
        interval: begin and end of the experiment, by stamps [s]; None: not known, so the complete bag counts and the
            numbers of sent samples are unknown.
    """
    if data is None:
        return {"sources": None, "sync": None}
    begin, end = interval or (-np.inf, np.inf)
    sources = {
        topic: source_metrics(came, data.counts.get(came.source), begin, end)
        for topic, came in sorted(data.sources.items())
    }
    streams = {
        topic: stream_metrics(stream, data, log, robot_time, begin, end)
        for topic, stream in sorted(data.streams.items())
    }
    return {"sources": {f"/{LOG_TOPIC}": _robot(log, robot_time, begin, end), **sources}, "sync": streams}


def _robot(log: ControlRecord, robot_time: RobotTime, begin: float, end: float) -> dict[str, Any]:
    """Return the counts of the robot, whose number of sent cycles follows from the first and last cycle number."""
    low, high = (edge if np.isinf(edge) else robot_time(edge) for edge in (begin, end))
    inside = (log.time >= low) & (log.time <= high)
    missing = sum(count for first, count in log.gaps if inside.any() and _within(log, first, inside))
    count = int(inside.sum())
    return {
        "counts": "cycles",
        "sent": count + missing,
        "recorded": count,
        "lost": missing,
        "twice": 0,
        "driver_lost": missing,
        "stamps": None,
    }


def _within(log: ControlRecord, first: int, inside: BoolArray) -> bool:
    """Return True if the missing cycle follows a recorded one in the interval."""
    before = first - log.first_cycle - sum(count for start, count in log.gaps if start < first) - 1
    return bool(0 <= before < len(inside) and inside[before])


def source_metrics(came: Numbered, counts: Counts | None, begin: float, end: float) -> dict[str, Any]:
    """Return the counts of one source within the interval [s]."""
    inside = (came.stamps >= begin) & (came.stamps <= end)
    numbers = came.numbers[inside]
    steps = np.diff(numbers)
    values: dict[str, Any] = {
        "counts": "samples" if came.source else "frames",
        "sent": None,
        "recorded": len(numbers),
        "lost": None,
        "twice": len(numbers) - distinct(numbers),
        "driver_lost": int(np.sum(steps[steps > 1] - 1)),
        "stamps": None if came.codes is None else _stamp_error(came, inside),
    }
    own = source_sequence(came, counts)
    sent = None if counts is None or own is None else sent_between(counts, begin, end)
    if sent is None or own is None:
        return values
    first, following, total = sent
    recorded = own[(own >= first) & (own < following)]
    count = distinct(recorded)
    return {
        **values,
        "sent": total,
        "recorded": count,
        "lost": total - count,
        "twice": len(recorded) - count,
        "first": first,
        "last": following - 1,
    }


def distinct(numbers: IntArray) -> int:
    """Return the number of distinct values, by a sort that is fast on nearly sorted arrays."""
    return int(np.count_nonzero(np.diff(np.sort(numbers, kind="stable")))) + bool(len(numbers))


def source_sequence(came: Numbered, counts: Counts | None) -> IntArray | None:
    """Return the source's sequence number of each sample that has one; None: not known.

    A time code within the second restarts every second. The seconds between two samples follow from the numbers of the
    driver, or from the stamps if the driver restarted; all stamps together give the second of the first sample.
    """
    if not came.source:
        return came.numbers
    known = np.isfinite(came.codes) if came.codes is not None else np.zeros(0, bool)
    if came.codes is None or counts is None or not known.any():
        return None
    codes, stamps = came.codes[known], came.stamps[known]
    if codes.max() <= 1.0:
        steps = np.diff(came.numbers[known]) / counts.rate
        passed = np.where(steps > 0.0, steps, np.diff(stamps)) - np.diff(codes)
        codes = codes + np.concatenate([[0.0], np.cumsum(np.rint(passed))])
        begins = {float(np.rint(np.median(part))) for part in np.array_split(stamps - codes, SECTIONS) if len(part)}
        if len(begins) > 1:
            return None
        codes = codes + begins.pop()
    numbers: IntArray = np.rint(codes * counts.rate).astype(np.int64)
    return numbers


def sent_between(counts: Counts, begin: float, end: float) -> tuple[int, int, int] | None:
    """Return (first number, number after the last, count) of the samples sent in an interval [s]; None: not known.

    The samples are those between the first and the last message of the counts in the interval.
    """
    inside = np.flatnonzero((counts.stamps >= begin) & (counts.stamps <= end))
    if not np.isfinite([begin, end]).all() or len(inside) < 2 or (np.diff(counts.following[inside]) < 0).any():
        return None
    a, b = int(inside[0]), int(inside[-1])
    return int(counts.following[a]), int(counts.following[b]), int(counts.sent[b] - counts.sent[a])


def _stamp_error(came: Numbered, inside: BoolArray) -> dict[str, float] | None:
    """Return the statistics of the difference between stamps and time codes, modulo one second [s]."""
    assert came.codes is not None
    late = came.stamps[inside] - came.codes[inside]
    return _spread(late - np.rint(late))


def _spread(errors: FloatArray) -> dict[str, float] | None:
    known = np.abs(errors[np.isfinite(errors)])
    if not known.size:
        return None
    within = float(np.mean(known <= BOUND))
    return {
        "median": float(np.median(known)),
        "p99": float(np.percentile(known, 99)),
        "largest": float(known.max()),
        "within_bound": within,
    }


def stream_metrics(
    stream: Stream, data: Collection, log: ControlRecord, robot_time: RobotTime, begin: float, end: float
) -> dict[str, Any]:
    """Return the tick counts of a synchronised stream, and the skew of each of its sources."""
    inside = (stream.stamps >= begin - ROUNDING) & (stream.stamps <= end + ROUNDING)
    stamps, values = stream.stamps[inside], stream.values[inside]
    ticks = np.rint(stamps * stream.rate).astype(np.int64) if stream.rate else np.arange(len(stamps))
    expected = _expected(stream.rate, begin, end, ticks)
    found: dict[str, Any] = {}
    for column, topic in enumerate(stream.topics):
        valid = stream.valid[inside][:, column]
        own = [index for index, source in enumerate(stream.sources) if source == topic]
        found[topic] = {
            "valid": float(valid.mean()) if len(valid) else None,
            "late": stream.late.get(topic, 0),
            "told_skew": stream.skew.get(topic),
            **_skew(topic, own, stamps, values, valid, stream, data, log, robot_time),
        }
    return {
        "rate": stream.rate,
        "ticks": distinct(ticks),
        "expected": expected,
        "missing": None if expected is None else expected - distinct(ticks),
        "grid_error": float(np.abs(stamps * stream.rate - ticks).max() / stream.rate)
        if stream.rate and len(ticks)
        else None,
        "bound": BOUND,
        "sources": found,
    }


def _expected(rate: float, begin: float, end: float, ticks: IntArray) -> int | None:
    """Return the number of expected ticks in the interval; without an interval, from the first to the last tick."""
    if not rate or not len(ticks):
        return None
    if not np.isfinite([begin, end]).all():
        return int(ticks[-1] - ticks[0] + 1)
    return int(np.floor((end + ROUNDING) * rate) - np.ceil((begin - ROUNDING) * rate) + 1)


def _skew(
    topic: str,
    own: list[int],
    stamps: FloatArray,
    values: FloatArray,
    valid: BoolArray,
    stream: Stream,
    data: Collection,
    log: ControlRecord,
    robot_time: RobotTime,
) -> dict[str, Any]:
    """Return the skew of the values from their instants, by a time code, the control log, or the true hand motion."""
    names = [stream.names[index].removeprefix(f"{topic}.") for index in own]
    if (code := f"data[{TIME_CODE}]") in names:
        late = stamps - values[:, own[names.index(code)]]
        return {"by": "time code", "skew": _spread(late[valid])}
    if topic.rsplit("/", 1)[-1] == LOG_TOPIC:
        joints = [joint for joint in log.joint_names if f"position[{joint}]" in names]
        seen = values[:, [own[names.index(f"position[{joint}]")] for joint in joints]]
        columns = [log.joint_names.index(joint) for joint in joints]
        times = np.array([robot_time(float(stamp)) for stamp in stamps])
        true, speed = (
            np.column_stack([np.interp(times, log.time, part[:, c]) for c in columns])
            for part in (log.position, log.velocity)
        )
        return {"by": "control log", "skew": _fitted(stamps, seen - true, speed, valid, MIN_SPEED["rad"])}
    axes = [index for index, name in zip(own, names, strict=True) if ".position." in name]
    if data.truth is not None and len(axes) == 3 and data.frame == data.truth[2]:
        spline = scipy.interpolate.CubicSpline(*data.truth[:2])
        inside = valid & (stamps > data.truth[0][0]) & (stamps < data.truth[0][-1])
        return {
            "by": "truth of the hand",
            "skew": _fitted(stamps, values[:, axes] - spline(stamps), spline(stamps, 1), inside, MIN_SPEED["m"]),
        }
    return {"by": None, "skew": None}


def _fitted(
    stamps: FloatArray, apart: FloatArray, speed: FloatArray, valid: BoolArray, min_speed: float
) -> dict[str, float] | None:
    """Return statistics of the time shift that, with an offset, fits best in each window [s].

    `uncertainty` is the largest standard deviation of a shift due to noise of the values. Windows with less than half
    the samples of the fullest, as at the ends, are skipped: few samples show only noise.
    """
    late, open_ = [], []
    usable = np.flatnonzero(valid)
    numbers = stamps[usable] // WINDOW
    order = np.argsort(numbers, kind="stable")
    windows = np.split(usable[order], np.flatnonzero(np.diff(numbers[order])) + 1)
    min_count = max(MIN_SAMPLES, 0.5 * max(map(len, windows)))
    for use in windows:
        if len(use) >= min_count and np.sqrt(np.mean(np.sum(speed[use] ** 2, axis=1))) > min_speed:
            shift, sigma = late_by(speed[use], apart[use])
            late.append(shift)
            open_.append(sigma)
    spread = _spread(np.array(late))
    return None if spread is None else {**spread, "uncertainty": float(max(open_))}


def render(values: Mapping[str, Any]) -> str:
    """Return the lines of the report from the result of `metrics`."""
    lines = []
    for topic, one in values["sources"].items():
        word, stamps = one["counts"], one["stamps"]
        if one["sent"] is None:
            text = (
                f"{one['recorded']} {word} recorded, {one['driver_lost']} lost by the driver's numbers; what was "
                "sent is not known"
            )
        else:
            text = (
                f"{one['sent']} {word} sent, {one['recorded']} recorded, {one['lost']} lost"
                + f", {one['twice']} twice" * bool(one["twice"])
            )
        if stamps is not None:
            text += f"; stamps off by {_milliseconds(stamps)}"
        lines.append(f"{topic}: {text}")
    for topic, one in values["sync"].items():
        missing = "" if one["missing"] is None else f" of {one['expected']}, {one['missing']} missing"
        lines.append(
            f"{topic} ({one['rate']:g} Hz): {one['ticks']} ticks{missing}; stated skew: at most "
            f"{1e3 * one['bound']:g} ms"
        )
        for source, part in one["sources"].items():
            skew = "not known" if part["skew"] is None else f"{_milliseconds(part['skew'])}, by the {part['by']}"
            share = "" if part["valid"] is None else f"valid at {100 * part['valid']:.2f} %; "
            lines.append(f"  {source}: {share}skew {skew}")
    return "\n".join(lines)


def _milliseconds(values: Mapping[str, float]) -> str:
    text = (
        f"{1e3 * values['median']:.3f} ms (median), {1e3 * values['p99']:.3f} (99 %), "
        f"{1e3 * values['largest']:.3f} (largest)"
    )
    text += f", {100 * values['within_bound']:.1f} % within {1e3 * BOUND:g} ms"
    return text + (f" +-{1e3 * values['uncertainty']:.3f}" if "uncertainty" in values else "")
