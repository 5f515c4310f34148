"""Writer of a trial as a c3d file, by the library ezc3d."""

import textwrap
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hric_bags.export.table import FloatArray
from hric_bags.export.trial.c3d_trial import C3dTrial
from hric_core.trial.plates import METRES

MAX_FRAMES = 65535
"""Largest number of frames in a c3d file, whose header counts them in 16 bits; longer trials become several files."""
WIDTH = 120
"""Width of a line of text in a c3d parameter, which may have 255 bytes [B]."""
INTEGER = 2
"""Code of the data type integer in ezc3d."""


def parts(trial: C3dTrial) -> Iterator[C3dTrial]:
    """Yield a trial in pieces that each fit into one c3d file, with their own start times."""
    for first in range(0, len(trial.positions), MAX_FRAMES):
        last = min(first + MAX_FRAMES, len(trial.positions))
        offset, samples = first / trial.rate, slice(first * trial.per_frame, last * trial.per_frame)
        yield replace(
            trial,
            start=trial.start + offset,
            positions=trial.positions[first:last],
            channels=tuple(replace(channel, values=channel.values[samples]) for channel in trial.channels),
            events=tuple(
                event._replace(time=event.time - offset)
                for event in trial.events
                if 0 <= event.time - offset < (last - first) / trial.rate
            ),
        )


def write(trial: C3dTrial, path: Path, started: str = "") -> None:
    """Write one c3d file.

    Args:
        trial: trial of at most MAX_FRAMES frames.
        path: file to write.
        started: date of the start of the run, as text; "": not written.
    """
    import ezc3d  # imported here: only c3d files need it

    file = ezc3d.c3d()
    _points(file, trial)
    if trial.channels:
        _analogs(file, trial)
    if trial.plates:
        _plates(file, trial)
    for time, label, context in trial.events:
        file.add_event([float(time // 60), time % 60], *(_shortened(text) for text in (context, label)))
    file.add_parameter("MANUFACTURER", "SOFTWARE", "hric_experiments")
    file.add_parameter("HRIC", "START_TIME", float(trial.start), "of the first frame [s]")
    for name, note in {**trial.notes, **({"STARTED": started} if started else {})}.items():
        file.add_parameter("HRIC", name, textwrap.wrap(note, WIDTH))
    file.write(str(path))


def _shortened(text: str) -> str:
    """Return as many characters of a text as fit into WIDTH bytes; longer ones make the file unreadable."""
    return text.encode()[:WIDTH].decode(errors="ignore")


def _points(file: Any, trial: C3dTrial) -> None:
    group, p = file["parameters"]["POINT"], trial.positions
    group["RATE"]["value"], group["UNITS"]["value"] = [trial.rate], [trial.length]
    group["LABELS"]["value"] = list(trial.labels)
    points = np.ones((4, p.shape[1], p.shape[0]))
    points[:3] = p.transpose(2, 1, 0) / METRES[trial.length]
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = np.where(np.isfinite(p).all(axis=2).T, 0.0, -1.0)[None]
    file.add_parameter("POINT", "X_SCREEN", "+X")
    file.add_parameter("POINT", "Y_SCREEN", f"+{trial.up.upper()}", "points up")


def _analogs(file: Any, trial: C3dTrial) -> None:
    group = file["parameters"]["ANALOG"]
    group["RATE"]["value"] = [trial.rate * trial.per_frame]
    group["LABELS"]["value"] = [channel.label for channel in trial.channels]
    group["UNITS"]["value"] = [channel.unit for channel in trial.channels]
    group["SCALE"]["value"] = np.ones(len(trial.channels))
    group["OFFSET"]["value"] = np.zeros(len(trial.channels), dtype=int)
    file["data"]["analogs"] = np.stack([channel.values for channel in trial.channels])[None]


def _plates(file: Any, trial: C3dTrial) -> None:
    group, floats = file["parameters"]["FORCE_PLATFORM"], ("CORNERS", "ORIGIN", "CAL_MATRIX")
    for name, values in force_platform(trial).items():
        if name in floats:
            file.add_parameter("FORCE_PLATFORM", name, values)
        else:
            group[name].update(type=INTEGER, value=values)
    file.add_parameter("FORCE_PLATFORM", "UNITS", "N")


def force_platform(trial: C3dTrial) -> dict[str, FloatArray]:
    """Return the parameters of the force plates, as arrays whose last index is the plate."""
    plates, metre = trial.plates, 1.0 / METRES[trial.length]
    return {
        "USED": np.array([len(plates)]),
        "TYPE": np.array([plate.kind for plate in plates]),
        "ZERO": np.array([0, 0]),
        "CHANNEL": 1 + np.arange(6 * len(plates)).reshape(len(plates), 6).T,
        "CORNERS": metre * np.stack([plate.corners.T for plate in plates], axis=2),
        "ORIGIN": metre * np.stack([plate.origin for plate in plates], axis=1),
        "CAL_MATRIX": np.stack([plate.calibration for plate in plates], axis=2),
    }
