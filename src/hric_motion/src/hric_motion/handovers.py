"""Recorded handovers of an object between two people: their skeletons, and the wrenches on the object.

The folder of one handover has the layout of the public data set KTH-RPL/handovers_dataset (Khanna et al., RO-MAN 2023,
doi:10.1109/RO-MAN57019.2023.10309537): a .csv file for each bone of the giver and of the taker, and one for the wrench
of each grip and of the interaction, which the object measures between both.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_core.trial.c3d import Trial
from hric_core.trial.opensim_text import lines_of, matrix_of
from hric_motion.formats import T_POSE, pose_points, trial_of

PEOPLE = ("giver", "taker")
POSE = "_pose_saved.csv"
"""Ending of the files of the bones; before it: giver or taker, and the bone."""
WRENCHES = {name: f"Wrench_{name}_saved.csv" for name in (*PEOPLE, "interaction")}
POSE_HEAD = ("x", "y", "z", "q0", "q1", "q2", "q3")
"""Columns of a bone: position [m], with z up, and quaternion (x, y, z, w)."""
WRENCH_HEAD = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
"""Columns of a wrench: force [N] and torque [N m]."""
RATE = 120.0
"""Rate of the rows [Hz], from the description of the data set; its files do not state it."""
GRIPPED = 2.0
"""Grip force above which a person holds the object [N] (project default, unconfirmed)."""


@dataclass(frozen=True)
class RecordedHandover:
    """Durations and forces of a handover, computed from the wrenches on the object.

    Attributes:
        overlap: time for which both hold the object [s]; None: never, or a grip was not measured.
        force_max: largest interaction force in this time [N]; None: not known.
        grip_giver, grip_taker: largest grip force [N]; None: not measured.
        duration: duration of the recording [s].
    """

    overlap: float | None
    force_max: float | None
    grip_giver: float | None
    grip_taker: float | None
    duration: float


def is_handover(path: Path) -> bool:
    """Return True if a path is the folder of a handover."""
    return path.is_dir() and any(path.glob(f"*{POSE}"))


def read_handover(path: Path, up: str) -> Trial:
    """Read the folder of a handover: markers `giver_BONE` and `taker_BONE`, and the wrenches as analog channels.

    Args:
        path: path of the folder.
        up: vertical axis in the files, y or z; empty: z, as in the data set.

    Raises:
        ParameterError: a file cannot be read, or has another content or another number of rows.
    """
    points = dict[str, FloatArray]()
    for file in sorted(path.glob(f"*{POSE}")):
        rows, name = _read(file, POSE_HEAD), file.name.removesuffix(POSE)
        if name.startswith(PEOPLE):
            points |= pose_points(name, rows[:, :3], rows[:, 3:], T_POSE[up or "z"])
    wrenches = {name: _read(path / file, WRENCH_HEAD) for name, file in WRENCHES.items() if (path / file).exists()}
    lengths = {name: len(rows) for name, rows in (points | wrenches).items()}
    if len(set(lengths.values())) != 1:
        raise ParameterError(f"{path}: the files of a handover have {lengths or 'no'} rows; valid: all the same number")
    trial = trial_of(path.name, RATE, 0.0, points, up or "z", True, {})
    channels = tuple(f"{name} {axis}" for name in wrenches for axis in WRENCH_HEAD)
    units = tuple("Nm" if name[-2] == "T" else "N" for name in channels)
    if not channels:
        return trial
    return replace(trial, analog_rate=RATE, channels=channels, units=units, analogs=np.hstack(list(wrenches.values())))


def _read(path: Path, head: tuple[str, ...]) -> FloatArray:
    """Return the rows of a .csv file with a head, shape (n, columns). Raises ParameterError."""
    lines = lines_of(path)
    if not lines or tuple(cell.strip() for cell in lines[0].split(",")) != head:
        raise ParameterError(f"{path}, line 1: wrong columns; valid: {','.join(head)}")
    return matrix_of(path, [(k, line.split(",")) for k, line in enumerate(lines) if k and line.strip()], head)


def handover_of(trial: Trial) -> RecordedHandover | None:
    """Return durations and forces of a handover; None: the trial has no wrench of a grip.

    The grip force is the pressure on the sensor, -Fz; a person holds the object while it is above GRIPPED.
    """
    force = {name: _force(trial, name) for name in WRENCHES}
    grips = [None if (one := force[name]) is None else -one[:, 2] for name in PEOPLE]
    known = [grip for grip in grips if grip is not None and np.isfinite(grip).any()]
    if not known:
        return None
    both = np.logical_and.reduce([grip > GRIPPED for grip in known]) if len(known) == 2 else np.zeros(0, dtype=bool)
    interaction, force_max = force["interaction"], None
    if both.any() and interaction is not None:
        magnitude = np.linalg.norm(interaction[both], axis=1)
        force_max = float(np.nanmax(magnitude)) if np.isfinite(magnitude).any() else None
    peaks = [None if grip is None or not np.isfinite(grip).any() else float(np.nanmax(grip)) for grip in grips]
    overlap = float(both.sum() / trial.analog_rate) if both.any() else None
    return RecordedHandover(overlap, force_max, peaks[0], peaks[1], trial.duration)


def _force(trial: Trial, name: str) -> FloatArray | None:
    """Return the force of a wrench, shape (n, 3) [N]; None: it was not measured."""
    columns = [f"{name} {axis}" for axis in WRENCH_HEAD[:3]]
    if not set(columns) <= set(trial.channels):
        return None
    return trial.analogs[:, [trial.channels.index(column) for column in columns]]
