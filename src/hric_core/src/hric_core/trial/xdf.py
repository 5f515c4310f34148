"""Reader of a recorded trial from an XDF file, the format of Lab Streaming Layer's recorder (LabRecorder).

Streams are recognised by their type: MoCap (markers), EMG, Force and Markers (events). Their times are on one clock by
the clock offsets of the file. A stream whose samples are not even in time, or whose clock was set again, is left out.
"""

import json
import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import UP_AXES, FloatArray
from hric_core.geometry.transforms import vectors_z_up
from hric_core.trial.c3d import Trial
from hric_core.trial.events import TrialEvent
from hric_core.trial.plates import METRES, PlateReader

MOCAP, EVENTS, FORCE, ANALOG = "mocap", "markers", "force", ("force", "emg")
"""Types of streams, in lower case."""
UNITS = {"volts": "V", "millivolts": "mV", "microvolts": "uV", "newtons": "N", "newton millimeters": "Nmm"}
"""Units in the metadata of Lab Streaming Layer, and their names in a trial."""
POSITION = re.compile(r"(.+?)[_ .]?([XYZ])", re.IGNORECASE)
EVENT = re.compile(r"(.+) \((.*)\)", re.DOTALL)
UNEVEN = 2.0
"""Largest deviation of the time of a sample from an even rate, in samples.

The constants of this file are project defaults, unconfirmed."""
RATE_ERROR = 0.01
"""Largest deviation of the rate from the nominal one, relative to that [1]."""
ALIGNED = 1e-6
"""Largest deviation of times from the nominal rate at which this rate is used instead of a fitted one, in samples."""


class _StreamError(Exception):
    """Stream that is left out; the message continues "stream NAME ..."."""


@dataclass(frozen=True)
class _Stream:
    """Samples at start + k / rate of the channels of one stream.

    Attributes:
        name, kind: name of the stream, and its type in lower case.
        start: time of the first sample [s].
        rate: sample rate [Hz].
        values: samples, shape (n, channels).
        channels: metadata of the channels.
    """

    name: str
    kind: str
    start: float
    rate: float
    values: FloatArray
    channels: tuple[Mapping[str, str], ...]

    @property
    def end(self) -> float:
        """Time of the last sample [s]."""
        return self.start + (len(self.values) - 1) / self.rate

    def during(self, start: float, duration: float) -> FloatArray:
        """Return the samples from the one that is nearest to a time [s] on, for a duration [s]."""
        first = max(round((start - self.start) * self.rate), 0)
        return self.values[first : first + int(np.ceil(duration * self.rate - ALIGNED))]


def read_xdf(path: Path, up: str) -> Trial:
    """Read the streams of markers, EMG and force plates over the time that they have in common.

    Args:
        path: path of the file.
        up: vertical axis in the file, y or z; empty: as a file of `hric export` states it, or z.

    Raises:
        ParameterError: the file is damaged, has no stream of these types, or its markers are not even in time.
    """
    raw, about, reasons = _load(path)
    streams = _streams(path, raw, reasons)
    markers = next((one for one in streams if one.kind == MOCAP), None)
    analog = _same_rate([one for one in streams if one.kind in ANALOG], reasons)
    base = markers or (analog[0] if analog else None)
    if base is None:
        others = "; ".join(reasons.values()) or "no streams"
        raise ParameterError(f"xdf file {path} has no stream to read: {others}; valid: type MoCap, EMG or Force")
    start, frames = _common(path, base, [one for one in (markers, *analog) if one is not None], reasons)
    labels, positions = ((), np.zeros((frames, 0, 3))) if markers is None else _points(path, markers)
    first = round((start - base.start) * base.rate)
    positions = positions if markers is None else positions[first : first + frames]
    rows = [one.during(start, frames / base.rate) for one in analog]
    count = min(map(len, rows), default=0)
    samples = np.hstack([one[:count] for one in rows]) if rows else np.zeros((0, 0))
    channels = [(one.name, k, channel) for one in analog for k, channel in enumerate(one.channels, 1)]
    units = tuple(UNITS.get(channel.get("unit", ""), channel.get("unit", "")) for _, _, channel in channels)
    rate, z_or_y = (analog[0].rate if analog else 0.0), up or about.get("up", "z")
    length, group = about.get("length", "m"), about.get("force_platform", {})
    plates, missing = PlateReader(group, samples.T, units, rate, 1, METRES[length], z_or_y).read()
    reasons.update(missing)
    if not group and any(one.kind == FORCE for one in analog):
        reasons[FORCE] = "force plates, as the file does not state where they are (their channels are read)"
    names = tuple(channel.get("label") or f"{name} {k}" for name, k, channel in channels)
    points = vectors_z_up(z_or_y, positions)
    origin, events = (start if about else 0.0), _events(raw, start)
    known = bool(up or about) or markers is None
    return Trial(
        path.name, base.rate, labels, points, rate, names, units, samples, plates, z_or_y, known, reasons=reasons,
        start=origin, events=events, length=length,
    )  # fmt: skip


def _load(path: Path) -> tuple[list[dict[str, Any]], dict[str, Any], dict[int | str, str]]:
    """Return the streams, what `hric export` states of the trial, and what is damaged. Raises ParameterError."""
    import pyxdf  # imported here: only xdf files need it

    log, lines = logging.getLogger("pyxdf"), list[str]()
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: lines.append(record.getMessage())  # type: ignore[method-assign]
    log.addHandler(handler)
    try:
        streams, head = pyxdf.load_xdf(str(path), dejitter_timestamps=False)
        about = json.loads(head["info"]["hric"][0]) if "hric" in head["info"] else {}
        if about and not (about["up"] in UP_AXES and about["length"] in METRES):
            raise ValueError("its header states no valid axis or unit of length")
    except Exception as error:  # the reader lets the errors of each of its parts through
        raise ParameterError(f"xdf file {path} is damaged: {error}") from error
    finally:
        log.removeHandler(handler)
    reasons: dict[int | str, str] = {"damaged": f"damaged parts: {'; '.join(lines)}"} if lines else {}
    return streams, about, reasons


def _streams(path: Path, raw: Sequence[Mapping[str, Any]], reasons: dict[int | str, str]) -> list[_Stream]:
    """Return the streams that are even in time; add to `reasons` why others are left out.

    Raises:
        ParameterError: the stream of markers is not even in time.
    """
    streams = list[_Stream]()
    for number, stream in enumerate(raw):
        name, kind = (_text(stream["info"], key) for key in ("name", "type"))
        if kind.lower() == EVENTS:
            continue
        try:
            if kind.lower() not in (MOCAP, *ANALOG):
                raise _StreamError(f"is of the type {kind or 'none'!r}, not MoCap, EMG, Force or Markers")
            if kind.lower() == MOCAP and any(one.kind == MOCAP for one in streams):
                raise _StreamError("is a second one of type MoCap, of which only the first is read")
            streams.append(_even(name, kind.lower(), stream, alone=len(raw) == 1))
        except _StreamError as error:
            if kind.lower() == MOCAP and not any(one.kind == MOCAP for one in streams):
                raise ParameterError(f"xdf file {path}: stream {name} {error}") from error
            reasons[f"stream {number}"] = f"stream {name}, which {error}"
    return streams


def _even(name: str, kind: str, stream: Mapping[str, Any], alone: bool) -> _Stream:
    """Return a stream whose samples are even in time. Raises _StreamError."""
    info, times, values = stream["info"], np.asarray(stream["time_stamps"]), np.asarray(stream["time_series"], float)
    nominal, count = float(_text(info, "nominal_srate") or 0.0), len(times)
    if not nominal > 0.0 or count < 2:
        raise _StreamError(f"has {count} samples at {nominal:g} Hz; valid: two or more, at an even rate")
    if not stream["clock_times"] and not alone:
        raise _StreamError("has no clock offsets, so that it may be on another clock than the other streams")
    if len(info["clock_segments"]) > 1:
        raise _StreamError(f"has {len(info['clock_segments'])} parts, since its clock was reset during the recording")
    stated = _text((stream.get("footer") or {}).get("info") or {}, "sample_count")
    if stated and int(stated) != count:
        raise _StreamError(f"has {count} samples; its footer states {stated}")
    period, start = np.polynomial.polynomial.polyfit(np.arange(count), times - times[0], 1)[::-1]
    exact = np.abs(times - times[0] - np.arange(count) / nominal).max() * nominal < ALIGNED
    rate, start = (nominal, 0.0) if exact else (1.0 / period, start)
    error = np.abs(times - times[0] - start - np.arange(count) / rate).max() * rate
    if not error <= UNEVEN:
        raise _StreamError(f"is not even in time: a sample is {error:.1f} periods off; samples are lost, or irregular")
    if not abs(1.0 / period - nominal) < RATE_ERROR * nominal:
        raise _StreamError(f"has a nominal rate of {nominal:g} Hz, and {1.0 / period:.6g} samples per second")
    described = ((info.get("desc") or [None])[0] or {}).get("channels") or [{}]
    channels = [{key: _text(one, key) for key in one} for one in (described[0] or {}).get("channel", [])]
    if len(channels) != values.shape[1]:
        channels = [{}] * values.shape[1]
    return _Stream(name, kind, float(times[0] + start), float(rate), values, tuple(channels))


def _text(tree: Mapping[str, Any], key: str) -> str:
    value = tree.get(key) or [""]
    return str(value[0] or "").strip() if isinstance(value, list) else str(value)


def _same_rate(analog: list[_Stream], reasons: dict[int | str, str]) -> list[_Stream]:
    """Return the streams with the rate of the first; add to `reasons` why others are left out."""
    for one in analog:
        if abs(one.rate - analog[0].rate) * len(one.values) > 0.5 * one.rate:
            reasons[f"rate of {one.name}"] = (
                f"stream {one.name}, which has {one.rate:g} Hz, and {analog[0].name} has {analog[0].rate:g} Hz"
            )
    return [one for one in analog if f"rate of {one.name}" not in reasons]


def _common(path: Path, base: _Stream, used: Sequence[_Stream], reasons: dict[int | str, str]) -> tuple[float, int]:
    """Return the time of the first frame that all streams have [s], and the number of frames. Raises ParameterError."""
    late, early = max(one.start for one in used), min(one.end + 1.0 / one.rate for one in used)
    first = max(int(np.ceil((late - base.start) * base.rate - ALIGNED)), 0)
    last = min(int(np.ceil((early - base.start) * base.rate - ALIGNED)), len(base.values))
    if last - first < 2:
        times = ", ".join(f"{one.name} {one.start:.3f} to {one.end:.3f} s" for one in used)
        raise ParameterError(f"xdf file {path}: its streams have no time in common: {times}")
    if last - first < len(base.values):
        reasons["time"] = f"{len(base.values) - (last - first)} frames, in which not all streams have samples"
    return base.start + first / base.rate, last - first


def _points(path: Path, stream: _Stream) -> tuple[tuple[str, ...], FloatArray]:
    """Return labels and positions of the markers, shape (n, m, 3) [m]. Raises ParameterError."""
    columns = dict[str, dict[str, tuple[int, float]]]()
    for column, channel in enumerate(stream.channels):
        label, kind = channel.get("label", ""), channel.get("type", "")
        if kind and not kind.lower().startswith("position"):
            continue
        found, unit = POSITION.fullmatch(label), channel.get("unit", "").lower()
        if found is None:
            continue
        if unit not in METRES:
            raise ParameterError(f"xdf file {path}: {label} is in {unit or 'no unit'!r}; valid: {', '.join(METRES)}")
        columns.setdefault(channel.get("marker") or found[1], {})[found[2].upper()] = column, METRES[unit]
    complete = {label: axes for label, axes in columns.items() if len(axes) == len("XYZ")}
    if not complete:
        raise ParameterError(
            f"xdf file {path}: stream {stream.name} has no markers; valid: channels NAME_X, NAME_Y, NAME_Z"
        )
    points = [[stream.values[:, axes[x][0]] * axes[x][1] for x in "XYZ"] for axes in complete.values()]
    positions = np.array(points).transpose(2, 0, 1)
    positions[(positions == 0.0).all(axis=2)] = np.nan
    return tuple(complete), positions


def _events(raw: Sequence[Mapping[str, Any]], start: float) -> tuple[TrialEvent, ...]:
    """Return the texts of the streams of events as events, by time; start: time of the first frame [s]."""
    events = list[TrialEvent]()
    for stream in raw:
        if _text(stream["info"], "type").lower() == EVENTS:
            for time, row in zip(stream["time_stamps"], stream["time_series"], strict=True):
                found = EVENT.fullmatch(str(row[0]))
                events.append(TrialEvent(float(time) - start, *(found.groups() if found else (str(row[0]),))))
    return tuple(sorted(events))
