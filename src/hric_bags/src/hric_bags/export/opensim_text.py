"""Writers of OpenSim's text formats: .trc for markers, .mot and .sto for everything else.

The files suit OpenSim's readers; `hric_core.trial.opensim_text` reads them, too.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from hric_bags.export.table import FloatArray

GROUND = "right-handed, y up"
"""Axes of OpenSim's ground."""


def write_trc(path: Path, time: FloatArray, markers: Mapping[str, FloatArray], name: str, axes: str = GROUND) -> None:
    """Write marker positions as .trc.

    Args:
        path: file to write.
        time: times, shape (n,) [s].
        markers: positions by name, shape (n, 3) [m]; NaN (not visible) is written as an empty cell.
        name: final file name, which is written into the file.
        axes: text on the axes, which is written on the first line.
    """
    rate = f"{_rate(time):.6g}"
    keys = [
        "DataRate",
        "CameraRate",
        "NumFrames",
        "NumMarkers",
        "Units",
        "OrigDataRate",
        "OrigDataStartFrame",
        "OrigNumFrames",
    ]
    values = [rate, rate, str(len(time)), str(len(markers)), "m", rate, "1", str(len(time))]
    labels = "".join(f"{marker}\t\t\t" for marker in markers)
    axis_labels = "".join(f"X{k}\tY{k}\tZ{k}\t" for k in range(1, len(markers) + 1))
    matrix = np.hstack([np.asarray(positions, dtype=float) for positions in markers.values()])
    with path.open("w") as file:
        file.write(f"PathFileType\t4\t(X/Y/Z)\t{name} (axes: {axes})\n")
        file.write("\t".join(keys) + "\n" + "\t".join(values) + "\n")
        file.write(f"Frame#\tTime\t{labels}\n\t\t{axis_labels}\n\n")
        for frame, (t, row) in enumerate(zip(time.tolist(), matrix.tolist(), strict=True), 1):
            cells = "\t".join("" if value != value else repr(value) for value in row)
            end = "\t" if cells.endswith("\t") else ""  # without it OpenSim does not count an empty last cell
            file.write(f"{frame}\t{t:.9f}\t{cells}{end}\n")


def write_storage(
    path: Path,
    time: FloatArray,
    columns: Mapping[str, FloatArray],
    name: str,
    *,
    degrees: bool = False,
    about: Mapping[str, str] | None = None,
) -> None:
    """Write columns over time as a .mot or .sto file.

    Args:
        path: file to write.
        time: times, shape (n,) [s].
        columns: values by label, shape (n,).
        name: name of the contents.
        degrees: True if rotations are in degrees.
        about: further entries of the header, each value on one line.
    """
    matrix = np.column_stack([time, *columns.values()]).tolist()
    head = [
        name,
        "version=1",
        f"nRows={len(time)}",
        f"nColumns={len(columns) + 1}",
        f"inDegrees={'yes' if degrees else 'no'}",
    ]
    head += [f"{key}={value}" for key, value in {"DataRate": f"{_rate(time):.6g}", **(about or {})}.items()]
    with path.open("w") as file:
        file.write("\n".join([*head, "endheader", "\t".join(["time", *map(label, columns)])]) + "\n")
        for row in matrix:
            file.write("\t".join(map(_number, row)) + "\n")


def label(text: str) -> str:
    """Return a column label in which white space is replaced by "_"."""
    return "_".join(text.split())


def marker_name(text: str) -> str:
    """Return a marker's name in which characters that OpenSim does not accept are replaced by "_"."""
    return "_".join(text.replace("/", " ").replace("\\", " ").replace("*", " ").replace("+", " ").split())


def _number(value: float) -> str:
    return "NaN" if value != value else repr(value)


def _rate(time: Sequence[float] | FloatArray) -> float:
    span = float(time[-1] - time[0]) if len(time) > 1 else 0.0
    return (len(time) - 1) / span if span > 0 else 0.0
