"""Contents of a c3d file: markers, force plates and EMG on one time grid, in the axes of OpenSim's ground.

A run that replays a trial has the axes, labels, units, force plate and events of that trial.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hric_bags import run_notes
from hric_bags.export import batches, opensim_formats, resampling
from hric_bags.export.frames import STATIC, FixedFrames
from hric_bags.export.opensim_text import GROUND, marker_name
from hric_bags.export.table import ExportError, FloatArray, TopicTable
from hric_bags.export.trial import replayed_trial
from hric_bags.export.trial.c3d_plates import C3dPlate, PlateSettings, plate_of, plate_settings
from hric_bags.export.trial.replayed_trial import ReplayedTrial
from hric_bags.run_file import RunFile
from hric_core.trial.events import TrialEvent

FRAME_RATE = 100.0
"""Frame rate of a run without motion capture [Hz] (default chosen by this project, unconfirmed)."""
TRIGGER_TYPE, PHASE_TYPE = "std_msgs/msg/Empty", "std_msgs/msg/String"
NEEDED = (
    opensim_formats.MOCAP_TYPE,
    batches.CHUNK,
    STATIC,
    TRIGGER_TYPE,
    PHASE_TYPE,
    replayed_trial.START_TYPE,
)
"""Message types from which a trial follows."""
TRIGGER, PHASE = "/trigger", "/phase"
"""Endings of the names of topics whose messages become events."""
TIME_CODE = "time"
"""Channel of an emulated device with the time of each sample; it is left out, since the file states times itself."""


@dataclass(frozen=True)
class Channel:
    """Analog channel of a c3d file.

    Attributes:
        label, unit: label and unit of the channel.
        values: values at the times of the analog samples, shape (frames * per_frame,).
    """

    label: str
    unit: str
    values: FloatArray


@dataclass(frozen=True)
class C3dTrial:
    """Contents of a c3d file; frame k is at start + k / rate.

    Attributes:
        start: time of the first frame, on the clock of the tables [s].
        rate: frame rate [Hz].
        per_frame: number of analog samples per frame; 0: there are none.
        labels: labels of the markers.
        positions: positions of the markers, shape (frames, markers, 3) [m]; NaN: not visible.
        channels: channels of the plates, six each, then EMG.
        plates: force plates in the order of their channels.
        events: events, with times since the first frame.
        notes: sentences on how the file was made, by name of their parameter.
        up: axis of the file that points up, "y" or "z".
        length: unit of length of the file.
    """

    start: float
    rate: float
    per_frame: int
    labels: tuple[str, ...]
    positions: FloatArray
    channels: tuple[Channel, ...]
    plates: tuple[C3dPlate, ...]
    events: tuple[TrialEvent, ...]
    notes: Mapping[str, str]
    up: str = "y"
    length: str = "mm"


def collect(tables: Mapping[str, TopicTable], frames: FixedFrames, run: RunFile, surface: float = 0.0) -> C3dTrial:
    """Return the trial of a run, over the time that all of its sources have in common.

    Args:
        tables: tables of the bag, by topic.
        frames: frames of the run.
        run: contents of run.yaml; may be empty.
        surface: height of the plates' surface above their electrical origin [m]; 0: as in the run.

    Raises:
        ExportError: there is no source, more than one motion capture, or no time that all sources have in common.
    """
    captures, plates, emg = _sources(tables)
    markers = opensim_formats.markers_of(captures[0], frames) if captures else None
    sampled = [resampling.SampledTopic(table) for table in [*plates, *emg]]
    grid = _Grid(markers, sampled)
    replayed = replayed_trial.of_run(run)
    settings = {name: setting.over(surface) for name, setting in plate_settings(run).items()}
    c3d_plates, channels = [], list[Channel]()
    for number, (table, source) in enumerate(zip(plates, sampled, strict=False), 1):
        wrench, name = source.values(opensim_formats.CHANNELS, grid.analog), opensim_formats.plate_name(table)
        plate, signals, names = (replayed.recorded_plate(name, wrench) if replayed is not None else None) or (
            *plate_of(table, frames, settings.get(name, PlateSettings().over(surface)), wrench),
            [],
        )
        c3d_plates.append(plate)
        labels = names or [f"{channel}{number}" for channel in opensim_formats.CHANNELS]
        channels += map(Channel, labels, plate.units, signals.T)
    for table, source in zip(emg, sampled[len(plates) :], strict=True):
        channels += _emg(table, source, grid.analog, [channel.label for channel in channels])
    trial = C3dTrial(
        grid.start,
        grid.rate,
        grid.per_frame,
        tuple(_differ([marker_name(name) for name in markers.positions])) if markers is not None else (),
        grid.positions(markers),
        tuple(channels),
        tuple(c3d_plates),
        _events(tables, grid, replayed),
        _notes(markers, c3d_plates, sampled, grid, next(iter([*captures, *plates, *emg])).clock),
    )
    return trial if replayed is None else _as_replayed(trial, replayed, frames, markers)


def _as_replayed(
    trial: C3dTrial, replayed: ReplayedTrial, frames: FixedFrames, markers: opensim_formats.OpenSimMarkers | None
) -> C3dTrial:
    """Return a trial with the axes, labels and units of the file that its run replayed."""
    T = replayed.T_file_ground(frames, None if markers is None else markers.table)
    streamed = [] if markers is None else list(markers.positions)
    labels = [replayed.label(name) or label for name, label in zip(streamed, trial.labels, strict=True)]
    whole = all(plate.axes == replayed.axes for plate in trial.plates)
    return replace(
        trial,
        labels=tuple(_differ(labels)),
        positions=trial.positions @ T[:3, :3].T + T[:3, 3],
        channels=tuple(_replayed_channel(channel, replayed) for channel in trial.channels),
        plates=tuple(
            plate if plate.axes == replayed.axes else replace(plate, corners=plate.corners @ T[:3, :3].T + T[:3, 3])
            for plate in trial.plates
        ),
        notes={**trial.notes, "AXES": replayed.axes},
        up=replayed.about["up"],
        length=replayed.about["length"] if whole else "mm",
    )


def _replayed_channel(channel: Channel, replayed: ReplayedTrial) -> Channel:
    label = replayed.muscles.get(channel.label)
    if label is None:
        return channel
    unit, volts = replayed.unit(label)
    return Channel(label, unit, channel.values / volts)


def _sources(tables: Mapping[str, TopicTable]) -> tuple[list[TopicTable], list[TopicTable], list[TopicTable]]:
    """Return tables of motion capture (one at most), force plates and EMG. Raises ExportError if all are missing."""
    captures = [table for table in tables.values() if opensim_formats.is_capture(table)]
    plates = [table for table in tables.values() if opensim_formats.is_plate(table)]
    others = [table for table in tables.values() if table.type_name == batches.CHUNK and table not in plates]
    emg = sorted(others, key=lambda table: -len(table.time))  # raw EMG before its envelope
    if not (captures or plates or emg):
        raise ExportError(
            "formats c3d, bids and xdf need motion capture, force plates or EMG "
            f"(hric_msgs/MocapData, {batches.CHUNK}), among the requested topics"
        )
    if len(captures) > 1:
        topics = ", ".join(table.topic for table in captures)
        raise ExportError(f"a c3d file can have one motion capture, but the bag has {topics}; choose one with --topics")
    return captures, plates, emg


class _Grid:
    """Time grid of the frames and analog samples of a c3d file.

    Attributes:
        start: time of the first frame [s].
        rate: frame rate [Hz].
        per_frame: number of analog samples per frame.
        count: number of frames.
        analog: times of the analog samples, shape (count * per_frame,) [s].
    """

    def __init__(
        self, markers: opensim_formats.OpenSimMarkers | None, sampled: Sequence[resampling.SampledTopic]
    ) -> None:
        self.rate, first = (
            resampling.frame_grid(markers.time, _numbers(markers)) if markers is not None else (FRAME_RATE, 0.0)
        )
        begins = [source.time[0] for source in sampled] + ([markers.time[0]] if markers is not None else [])
        ends = [source.time[-1] for source in sampled]
        fastest = max((source.rate for source in sampled), default=0.0)
        self.per_frame = math.ceil(fastest / self.rate - resampling.ALMOST) if sampled else 0
        begin = max(begins)
        if markers is None:
            first = begin
        self.start = first + math.ceil((begin - first) * self.rate - resampling.ALMOST) / self.rate
        counts = [math.floor((markers.time[-1] - self.start) * self.rate + 0.5) + 1] if markers is not None else []
        counts += [math.floor((end - self.start) * self.rate + 1 / self.per_frame + resampling.ALMOST) for end in ends]
        self.count = min(counts)
        if self.count < 1:
            raise ExportError(
                "format c3d needs a time at which motion capture, plates and EMG were all recorded; the bag has none"
            )
        self.analog = self.start + np.arange(self.count * self.per_frame) / (self.rate * max(1, self.per_frame))

    def positions(self, markers: opensim_formats.OpenSimMarkers | None) -> FloatArray:
        """Return marker positions of the recorded frames nearest to the grid, shape (frames, markers, 3) [m].

        A frame without a recorded one within half a period is NaN.
        """
        if markers is None:
            return np.empty((self.count, 0, 3))
        index = np.rint((markers.time - self.start) * self.rate).astype(int)
        inside = (index >= 0) & (index < self.count)
        nearest = np.full((self.count, len(markers.positions), 3), np.nan)
        for number, p in enumerate(markers.positions.values()):
            nearest[index[inside], number] = p[inside]
        return nearest


def _numbers(markers: opensim_formats.OpenSimMarkers) -> FloatArray:
    """Return the numbers of the motion capture's frames; empty: not known."""
    column = markers.table.column("frame_number")
    return np.empty(0) if column is None else np.asarray(column.values, dtype=float)[markers.rows]


def _emg(table: TopicTable, source: resampling.SampledTopic, times: FloatArray, taken: Sequence[str]) -> list[Channel]:
    names = [column.name for column in table.columns if column.values.dtype.kind == "f" and column.name != TIME_CODE]
    kind = table.topic.rpartition("/")[2]
    units = {column.name: column.unit for column in table.columns}
    labels = _differ([f"{name}_{kind}" if name in taken else name for name in names], taken)
    values = source.values(names, times).T if names else ()
    return [Channel(label, units[name], column) for name, label, column in zip(names, labels, values, strict=True)]


def _differ(labels: Sequence[str], taken: Sequence[str] = ()) -> list[str]:
    """Return the labels, made unique by a number after those that are used or in `taken`."""
    different: list[str] = []
    for label in labels:
        names = itertools.chain([label], (f"{label}_{number}" for number in itertools.count(2)))
        different.append(next(name for name in names if name not in different and name not in taken))
    return different


def _events(tables: Mapping[str, TopicTable], grid: _Grid, replayed: ReplayedTrial | None) -> tuple[TrialEvent, ...]:
    """Return the events in the file: triggers, notes, and those of the replayed trial or phases of the human."""
    events = [] if replayed is None else replayed.events(tables)
    for table in tables.values():
        if table.type_name == TRIGGER_TYPE and table.topic.endswith(TRIGGER):
            events += [TrialEvent(time, "trigger") for time in table.time.tolist()]
        elif table.type_name == run_notes.TYPE:
            words = (map(str, table.named()[name].values) for name in ("text", "by"))
            events += map(TrialEvent, table.time.tolist(), *words)
        elif (
            replayed is None
            and table.type_name == PHASE_TYPE
            and table.topic.endswith(PHASE)
            and (column := table.column("data")) is not None
        ):
            events += map(TrialEvent, table.time.tolist(), map(str, column.values))
    shifted = [event._replace(time=event.time - grid.start) for event in events]
    return tuple(sorted(event for event in shifted if 0 <= event.time < grid.count / grid.rate))


def _notes(
    markers: opensim_formats.OpenSimMarkers | None,
    plates: Sequence[C3dPlate],
    sampled: Sequence[resampling.SampledTopic],
    grid: _Grid,
    clock: str,
) -> dict[str, str]:
    axes = [markers.axes] if markers is not None else [f"{GROUND}; {plate.axes}" for plate in plates[:1]]
    notes = {"CLOCK": f"START_TIME is seconds since {clock}, of the first frame", "AXES": axes[0] if axes else GROUND}
    if markers is not None:
        notes["MARKERS"] = (
            f"from {markers.table.topic}; each frame has the positions of the nearest recorded frame, at most half a "
            "period away, otherwise none"
        )
    if plates:
        notes["FORCES"] = (
            "load of the plate on the body, in the plate's axes with z down; moments about the origin of the plate"
        )
    if sampled:
        notes["RESAMPLING"] = f"analog samples at {grid.rate * grid.per_frame:g} Hz: " + "; ".join(
            source.how(grid.analog) for source in sampled
        )
    return notes


def describe(trial: C3dTrial) -> str:
    """Return one line of text on the contents of the c3d file and how it was made."""
    analog = f"; {trial.notes['RESAMPLING']}" if trial.channels else ""
    plates = "".join(f", plate {plate.name} of type {plate.kind}" for plate in trial.plates)
    emg = len(trial.channels) - 6 * len(trial.plates)
    held = (
        f"{len(trial.positions)} frames at {trial.rate:g} Hz from {trial.start:.3f} s, {len(trial.labels)} "
        f"markers{plates}, {emg} other channels"
    )
    units = ", ".join(dict.fromkeys((trial.length, *(unit for plate in trial.plates for unit in plate.units))))
    return f"{held}; {units}, {trial.notes['AXES']}{analog}"
