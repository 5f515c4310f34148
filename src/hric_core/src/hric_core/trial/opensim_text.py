"""Reader of recorded motions in OpenSim's text formats: markers in .trc files, time series in .mot and .sto files.

It needs neither ROS nor OpenSim."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_core.trial.plates import METRES

END = "endheader"
UNEVEN = 0.01
"""Largest relative deviation of a time step from the median step [1] (project default, unconfirmed)."""
SAME_RATE = 0.1
"""Largest relative difference between the stated rate and that of the rows [1] (project default, unconfirmed)."""
TRC_HEAD = 5
"""Number of header lines of a .trc file: type, keys, values, names of markers, names of axes."""


@dataclass(frozen=True)
class Storage:
    """Content of a .mot or .sto file.

    Attributes:
        time: times, increasing, shape (n,) [s].
        columns: values by label of the column, each of shape (n,).
        degrees: True if rotations are in degrees.
    """

    time: FloatArray
    columns: dict[str, FloatArray]
    degrees: bool


@dataclass(frozen=True)
class MarkerRows:
    """Content of a .trc file.

    Attributes:
        time: times, increasing, shape (n,) [s].
        markers: positions by marker name, in the axes of the file, each of shape (n, 3) [m]; NaN: not visible.
        lacks: note on missing rows that the file header states; empty: no rows are missing.
    """

    time: FloatArray
    markers: dict[str, FloatArray]
    lacks: str = ""


def read_storage(path: Path) -> Storage:
    """Read a .mot or .sto file, as the tools of OpenSim write it.

    Raises:
        ParameterError: the file cannot be read, or has another content; the message is one line.
    """
    lines = lines_of(path)
    head = [line.strip().lower() for line in lines]
    if END not in head:
        raise ParameterError(f"{path} is not a motion or storage file of OpenSim: it has no line {END!r}")
    start = head.index(END) + 1
    labels = lines[start].split() if start < len(lines) else []
    if len(labels) < 2 or labels[0].lower() != "time" or len(set(labels)) < len(labels):
        raise ParameterError(
            f"{path}, line {start + 1}: wrong column labels; valid: `time`, then the other labels, each once"
        )
    matrix = matrix_of(path, [(k, lines[k].split()) for k in range(start + 1, len(lines)) if lines[k].strip()], labels)
    degrees = "indegrees=yes" in {line.replace(" ", "") for line in head[:start]}
    return Storage(rising(path, matrix[:, 0]), {label: matrix[:, k] for k, label in enumerate(labels) if k}, degrees)


def read_markers(path: Path) -> MarkerRows:
    """Read a .trc file. A marker whose cells are empty, or all three zero, is not visible in that row.

    Raises:
        ParameterError: the file cannot be read, or has another content; the message is one line.
    """
    lines = lines_of(path)
    if len(lines) < TRC_HEAD or not lines[0].startswith("PathFileType"):
        raise ParameterError(f"{path} is not a .trc file: its first line does not begin with PathFileType")
    keys = dict(zip(lines[1].split(), lines[2].split(), strict=False))
    unit = keys.get("Units", "mm").lower()
    if unit not in METRES:
        raise ParameterError(f"{path} has markers in {unit!r}; valid: {', '.join(METRES)}")
    names = [name.strip() for name in lines[3].split("\t")[2:] if name.strip()]
    labels = ["frame", "time", *(f"{name} {axis}" for name in names for axis in "xyz")]
    if not names or len(set(names)) < len(names):
        raise ParameterError(f"{path}, line 4: wrong marker names; valid: one name or more, each once")
    rows = [(k, padded(lines[k].split("\t"), len(labels))) for k in range(TRC_HEAD, len(lines)) if lines[k].strip()]
    matrix = matrix_of(path, rows, labels)
    positions = METRES[unit] * matrix[:, 2:].reshape(len(matrix), -1, 3)
    positions[(positions == 0.0).all(axis=2)] = np.nan
    check_rate(path, keys.get("DataRate", ""), rising(path, matrix[:, 1]))
    lacks = lacking(keys.get("NumFrames", ""), len(matrix))
    return MarkerRows(matrix[:, 1], {name: positions[:, k] for k, name in enumerate(names)}, lacks)


def lacking(stated: str, count: int) -> str:
    """Return a note on missing frames that the file header states; empty: none are missing, or it states no number."""
    missing = int(stated) - count if stated.strip().isdecimal() else 0
    return f"{missing} of the {stated.strip()} frames stated in the header: the file does not contain them" * (
        missing > 0
    )


def rate_of(path: Path, time: FloatArray) -> float:
    """Return the rate of evenly spaced rows [Hz]. Raises ParameterError, with `path`, if they are not evenly spaced."""
    steps = np.diff(time)
    if not len(steps) or np.abs(steps / np.median(steps) - 1.0).max() > UNEVEN:
        raise ParameterError(f"{path}: rows are not evenly spaced in time; valid: two rows or more, at a constant rate")
    return float((len(time) - 1) / (time[-1] - time[0]))


def check_rate(path: Path, stated: str, time: FloatArray) -> None:
    """Refuse times [s] of rows that contradict the rate in the head of the file, such as times in milliseconds.

    Raises:
        ParameterError: the rate is not that of the rows; an empty one is not checked.
    """
    with suppress(ValueError):  # another text states no rate
        if stated.strip() and not abs(float(stated) * (time[-1] - time[0]) / max(len(time) - 1, 1) - 1.0) <= SAME_RATE:
            raise ParameterError(
                f"{path}: a rate of {stated} Hz is stated, but there are {len(time)} rows from {time[0]:g} to "
                f"{time[-1]:g} s; valid: times [s] at this rate"
            )


def lines_of(path: Path) -> list[str]:
    """Return the lines of a text file. Raises ParameterError: it cannot be read, or is not text."""
    try:
        return path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ParameterError(f"{path} is not a text file in UTF-8: {error.reason} at byte {error.start}") from error


def padded(cells: list[str], width: int) -> list[str]:
    """Return a row with empty cells removed from or added to its end, so that it has `width` cells if possible."""
    while len(cells) > width and not cells[-1].strip():
        cells.pop()
    return cells + [""] * (width - len(cells))


def matrix_of(path: Path, rows: Sequence[tuple[int, list[str]]], labels: Sequence[str]) -> FloatArray:
    """Return the numbers in rows of text cells, shape (rows, labels); an empty cell becomes NaN.

    Each row is given with the index of its line in the file, for error messages. Raises ParameterError.
    """
    numbers = []
    for index, cells in rows:
        if len(cells) != len(labels):
            raise ParameterError(f"{path}, line {index + 1}: {len(cells)} columns; valid: {len(labels)}")
        try:
            numbers.append([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError as error:
            raise ParameterError(f"{path}, line {index + 1}: {error}") from error
    if not numbers:
        raise ParameterError(f"{path} has no rows")
    return np.array(numbers)


def rising(path: Path, time: FloatArray) -> FloatArray:
    """Return `time` [s], shape (n,), if it is finite and increases. Raises ParameterError, which names `path`."""
    if not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
        raise ParameterError(f"{path}: the times of the rows do not increase; valid: finite, increasing times")
    return time
