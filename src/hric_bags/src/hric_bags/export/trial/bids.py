"""Writer of a trial as a data set of the Brain Imaging Data Structure (BIDS): Motion, and EMG as BDF."""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from hric_bags.export.table import ExportError
from hric_bags.export.trial.bdf import UNIT, write_bdf
from hric_bags.export.trial.c3d_trial import C3dTrial, Channel
from hric_bags.run_file import RunFile
from hric_core.trial.c3d import VOLTS

VERSION = "1.11.1"
"""Version of BIDS, which has Motion since 1.9 and EMG since 1.11."""
UNKNOWN = "n/a"
"""Text for a value that is not known."""
ENVELOPE = "_envelope"
"""Ending of the labels of EMG envelopes, which are computed from the samples and not part of the raw data."""
TRACKING = "optical"
"""Label of the tracking system in names of files."""
README = """{title}

Written by `hric export --format bids` from the experiment "{task}". Times are seconds since the first frame, which all
files share. {notes}
Values that the run does not state, such as the placement of electrodes, are n/a.
"""
EVENT_COLUMNS = {
    "trial_type": {"Description": "Name of the event"},
    "context": {"Description": "Side of the body or other context of the event"},
}
Writer = Callable[[Path], object]


def bids_files(trial: C3dTrial, run: RunFile) -> dict[str, Writer]:
    """Return the writers of a data set's files, by their paths in it.

    Force plates are left out: BIDS has no place for them.

    Args:
        trial: trial to be written.
        run: contents of run.yaml; may be empty.

    Raises:
        ExportError: the trial has neither markers nor EMG.
    """
    subject, task = (_label(run.get(key), other) for key, other in (("subject", "01"), ("experiment", "recording")))
    emg = [
        channel
        for channel in trial.channels[6 * len(trial.plates) :]
        if channel.unit.lower() in VOLTS and not channel.label.endswith(ENVELOPE)
    ]
    if not trial.labels and not emg:
        raise ExportError("format bids needs motion capture or EMG, among the requested topics")
    description = {
        "Name": f"Recording of {task}",
        "BIDSVersion": VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "hric export"}],
    }
    notes = " ".join(f"{note}." for note in trial.notes.values())
    files: dict[str, Writer] = {
        "dataset_description.json": _json(description),
        "README": _text(README.format(title=description["Name"], task=task, notes=notes)),
        "participants.tsv": _table([("participant_id",), (f"sub-{subject}",)]),
    }
    name = f"sub-{subject}_task-{task}"
    if trial.labels:
        files |= _motion(trial, f"sub-{subject}/motion/{name}_tracksys-{TRACKING}", task)
    if emg:
        files |= _emg(trial, emg, f"sub-{subject}/emg/{name}", task)
    return files


def _motion(trial: C3dTrial, stem: str, task: str) -> dict[str, Writer]:
    """Return the writers of the files of the markers; stem: beginning of their paths."""
    count = len(trial.labels)
    about = {
        "TaskName": task,
        "SamplingFrequency": trial.rate,
        "TrackingSystemName": TRACKING,
        "MissingValues": UNKNOWN,
        "RecordingDuration": len(trial.positions) / trial.rate,
        "TrackedPointsCount": count,
        "POSChannelCount": 3 * count,
        "MotionChannelCount": 3 * count,
    }
    channels = [(f"{label}_{axis}", axis, "POS", label, "m", "laboratory") for label in trial.labels for axis in "xyz"]
    frame = {"reference_frame": {"Levels": {"laboratory": {"Description": trial.notes["AXES"]}}}}
    rows = trial.positions.reshape(len(trial.positions), -1).tolist()
    return {
        f"{stem}_motion.tsv": _table([[UNKNOWN if value != value else repr(value) for value in row] for row in rows]),
        f"{stem}_motion.json": _json(about),
        f"{stem}_channels.tsv": _table(
            [("name", "component", "type", "tracked_point", "units", "reference_frame"), *channels]
        ),
        f"{stem}_channels.json": _json(frame),
        **_events(trial, stem),
    }


def _emg(trial: C3dTrial, channels: Sequence[Channel], stem: str, task: str) -> dict[str, Writer]:
    """Return the writers of the files of the EMG; stem: beginning of their paths."""
    rate = trial.rate * trial.per_frame
    unknown = ("EMGReference", "PowerLineFrequency", "SoftwareFilters")
    about = {
        "TaskName": task,
        "SamplingFrequency": rate,
        "RecordingDuration": len(channels[0].values) / rate,
        "RecordingType": "continuous",
        "EMGChannelCount": len(channels),
        "EMGPlacementScheme": "Other",
        "EMGPlacementSchemeDescription": "not stated by the run",
        **dict.fromkeys(unknown, UNKNOWN),
    }
    rows = [(channel.label, "EMG", UNIT) for channel in channels]
    return {
        f"{stem}_emg.bdf": partial(write_bdf, channels=channels, rate=rate),
        f"{stem}_emg.json": _json(about),
        f"{stem}_channels.tsv": _table([("name", "type", "units"), *rows]),
        **_events(trial, stem),
    }


def _events(trial: C3dTrial, stem: str) -> dict[str, Writer]:
    rows = [(f"{event.time:.6f}", UNKNOWN, event.label, event.context) for event in trial.events]
    table = _table([("onset", "duration", "trial_type", "context"), *rows])
    return {f"{stem}_events.tsv": table, f"{stem}_events.json": _json(EVENT_COLUMNS)} if rows else {}


def _label(value: object, other: str) -> str:
    """Return a text without the characters that BIDS forbids in names; if nothing is left, `other`."""
    return "".join(filter(str.isalnum, str(value or "").encode("ascii", "ignore").decode())) or other


def _json(content: Mapping[str, object]) -> Writer:
    return _text(json.dumps(content, indent=2) + "\n")


def _table(rows: Sequence[Sequence[str]]) -> Writer:
    cells = ([" ".join(cell.split()) or UNKNOWN for cell in row] for row in rows)
    return _text("".join("\t".join(row) + "\n" for row in cells))


def _text(text: str) -> Writer:
    return lambda path: path.write_text(text)
