"""Files of a trial: tables of joint angles and moments, OpenSim model and motion, values as JSON, and a page."""

import csv
import hashlib
import itertools
import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from hric_bags.export.opensim_text import write_storage
from hric_bags.files import cannot_write, make_folder, write_json, write_text
from hric_core.geometry import FloatArray
from hric_motion.moments import JointMoments
from hric_motion.trial import TrialMotion
from hric_report.trial import emg, page, summary
from hric_report.trial.opensim_files import ROOT_COORDINATES, root_angles, write_dynamics, write_model
from hric_run import provenance

ANGLES, MOMENTS, ACTIVATIONS, MOTION = "angles.csv", "moments.csv", "activations.csv", "angles.mot"
DATA, PAGE, TABLE = "trial.json", "trial.html", "trials.csv"


def write(
    result: TrialMotion,
    moments: JointMoments | None,
    activity: emg.TrialEmg | None,
    sources: Mapping[str, Path],
    name: str,
    folder: Path,
    command: str,
) -> Path:
    """Write all files of a trial to a folder, and return it; earlier results of the same file and person are replaced.

    The folder appears only when all files are complete.

    Args:
        result: motion in the trial.
        moments: joint moments; None: not known.
        activity: measured EMG and estimated activation; None: the trial has no EMG.
        sources: input files by role: "motion", and optionally "static", "mvc_1", "mvc_2", ...
        name: name of the new folder; a number is appended if a folder of this name has results of another file.
        folder: folder in which the new one is created.
        command: command line, which trial.json records.

    Raises:
        HricError: the system refuses to write, or the body cannot be converted for OpenSim.
    """
    hashes = {role: _hash(path) for role, path in sources.items()}
    files = {role: {"name": path.name, "sha256": hashes[role]} for role, path in sources.items()}
    values = {"files": files, **summary.content(result, moments, activity), "command": provenance.neutral(command)}
    values |= {"versions": provenance.versions(), "revision": provenance.revision()}
    make_folder(folder)
    target = _free(folder, name, files["motion"], result.prefix)
    with _new_folder(target) as new:
        _write_angles(new / ANGLES, result)
        _write_opensim(new, result)
        if moments is not None:
            _write_moments(new / MOMENTS, moments, result.trial.start)
            write_dynamics(new, moments)
        _write_activations(new / ACTIVATIONS, activity)
        write_json(new / DATA, values)
        write_text(new / PAGE, page.build(result, moments, activity, values))
    return target


def _hash(path: Path) -> str:
    files = sorted(path.glob("*.csv")) if path.is_dir() else [path]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def _free(folder: Path, name: str, file: Mapping[str, str], prefix: str) -> Path:
    """Return the first of NAME, NAME_2, NAME_3, ... that is free or has results of the same file and person."""
    for number in itertools.count(1):
        target = folder / (name if number == 1 else f"{name}_{number}")
        earlier = values(target)
        if not target.exists() or (earlier.get("files", {}).get("motion"), earlier.get("prefix")) == (file, prefix):
            break
    return target


def values(folder: Path) -> dict[str, Any]:
    """Return the content of trial.json in a folder; empty: the file is missing or not readable."""
    try:
        values: dict[str, Any] = json.loads((folder / DATA).read_text())
    except (OSError, ValueError):
        return {}
    return values


@contextmanager
def _new_folder(target: Path) -> Iterator[Path]:
    """Yield a temporary folder that replaces `target` if the block ends without an error."""
    new = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        new.chmod(0o755)
        yield new
        old = new.with_name(f"{new.name}.old")
        if target.exists():
            target.rename(old)
        new.rename(target)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise cannot_write(target, error) from error
    finally:
        shutil.rmtree(new, ignore_errors=True)


def _write_angles(path: Path, result: TrialMotion) -> None:
    """Write a CSV file with time [s], and angle and standard deviation of each joint [deg]; empty cell: not known."""
    motion = result.motion
    spread = np.where(np.isfinite(motion.q), motion.spread, np.nan)
    matrix = np.degrees(np.stack([motion.q, spread], axis=2)).reshape(len(motion.q), -1)
    head = [f"{name} {what}[deg]" for name in motion.body.joints for what in ("", "deviation ")]
    _write_rows(path, head, result.time, matrix)


def _write_moments(path: Path, moments: JointMoments, start: float) -> None:
    """Write a CSV file with time, moment of each joint with half its 95 % interval, and residual; empty: not known.

    start: time of the first frame [s].
    """
    residual = [f"residual {kind}{axis} [{unit}]" for kind, unit in (("F", "N"), ("M", "N m")) for axis in "xyz"]
    head = [f"{name} {what}[N m]" for name in moments.body.joints for what in ("", "half-width ")]
    columns = np.stack([moments.moment, moments.half_width], axis=2).reshape(len(moments.moment), -1)
    _write_rows(path, [*head, *residual], moments.motion.time, np.hstack([columns, moments.residual]))


def _write_activations(path: Path, activity: emg.TrialEmg | None) -> None:
    """Write a CSV file with time, measured envelope and estimated activation of each compared channel, if any."""
    shown = [] if activity is None else [one for one in activity.channels if not one.reason]
    if activity is None or not shown:
        return
    head = [f"{one.label} {what} [{one.reference}]" for one in shown for what in ("measured", "estimated")]
    _write_rows(path, head, activity.time, np.column_stack([c for one in shown for c in (one.measured, one.estimated)]))


def _write_rows(path: Path, head: Sequence[str], times: FloatArray, matrix: FloatArray) -> None:
    """Write a CSV file with a row per time; NaN becomes an empty cell."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time [s]", *head])
        for time, row in zip(times, matrix, strict=True):
            writer.writerow([f"{time:.6g}", *("" if np.isnan(value) else f"{value:.4f}" for value in row)])


def _write_opensim(folder: Path, result: TrialMotion) -> None:
    """Write the fitted body with its markers as an OpenSim model, and its motion, in which NaN means not known."""
    motion = result.motion
    write_model(folder, motion.body)
    names = [*(name for name, _, _ in ROOT_COORDINATES), *motion.body.joints]
    columns = np.hstack([motion.root[:, :3], root_angles(motion.root[:, 3:]), motion.q])
    about = {"units": "s, m, rad"}
    write_storage(folder / MOTION, result.time, dict(zip(names, columns.T, strict=True)), "Coordinates", about=about)


def write_table(folder: Path) -> Path:
    """Write a table with a row for each trial whose results are in a folder; return the table's path."""
    rows = [summary.table_cells(path.parent.name, values(path.parent)) for path in sorted(folder.glob(f"*/{DATA}"))]
    head = [f"{name} [{unit}]" if unit else name for name, unit in zip(summary.HEAD, summary.UNITS, strict=True)]
    write_text(folder / TABLE, "\n".join([",".join(map(_quoted, row)) for row in (head, *rows)]) + "\n")
    return folder / TABLE


def _quoted(cell: str) -> str:
    return '"' + cell.replace('"', '""') + '"' if any(char in cell for char in ',"') else cell
