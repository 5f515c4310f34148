"""Readers of trials in the text formats of other programs: .trc, Motive's .csv, Xsens' .mvnx, and their folders.

Segments with an orientation, such as the bones of a skeleton, become up to three points each: the origin NAME, which is
a joint centre, and the points NAME_forward and NAME_left at AXIS from it. The axes are those of a person who is in
the T-pose with palms down, in which the segments of Motive and Xsens have no rotation.
"""

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_core.geometry.transforms import vectors_z_up
from hric_core.parameters import read_yaml
from hric_core.trial.c3d import MEASURES, Trial
from hric_core.trial.opensim_text import check_rate, lacking, lines_of, matrix_of, padded, rate_of, read_markers, rising
from hric_core.trial.plates import METRES

FORMATS = (".c3d", ".xdf", ".trc", ".csv", ".mvnx")
"""Endings of the names of files with a trial."""
AXIS = 0.5
"""Distance of the points on a segment's axes from its origin [m]."""
TURNED = re.compile(r"(HIPS?|PELVIS|CHEST|T8|HEAD|.*HAND|.*FOOT)")
"""Pattern of the names of segments, in capitals, whose axes become points."""
T_POSE = {"y": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)), "z": ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0))}
"""Axes forward and left of a segment in the T-pose of Motive, by the axis of the file that points up."""
XSENS_POSE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Axes forward and left of a segment in the T-pose of Xsens, whose files have z up."""
XSENS_SEGMENTS = (
    *("Pelvis", "L5", "L3", "T12", "T8", "Neck", "Head"),
    *(f"{side}{name}" for side in ("Right", "Left") for name in ("Shoulder", "UpperArm", "ForeArm", "Hand")),
    *(f"{side}{name}" for side in ("Right", "Left") for name in ("UpperLeg", "LowerLeg", "Foot", "Toe")),
)
"""Segments of Xsens in the order of its files, for files that do not name them."""
SESSION = "sessionMetadata.yaml"
"""File of OpenCap with mass and height of the subject."""
ABOVE = 5
"""Number of folders above a .trc file in which SESSION is looked for."""
FOLDERS = ("MarkerData", "pose-3d")
"""Folders of OpenCap and Pose2Sim with the .trc files of a session."""
PROCESSED = ("_filt", "_LSTM")
"""Beginnings of the suffixes of .trc files that Pose2Sim has filtered or augmented."""


def trials_in(path: Path) -> list[Path]:
    """Return the trials in a folder of OpenCap or Pose2Sim, of each only the file that is processed furthest.

    Raises:
        ParameterError: the folder has no trials.
    """
    folders = [path, *(path / name for name in FOLDERS), *(one for name in FOLDERS for one in path.glob(f"*/{name}"))]
    found = sorted(
        {file for folder in folders for file in folder.glob("*.trc")} | set(path.glob("MarkerData/**/*.trc"))
    )
    if not found:
        raise ParameterError(
            f"{path} has no trials; valid: a folder of OpenCap (MarkerData/*.trc) or Pose2Sim (pose-3d/*.trc), or one "
            "handover (giver_*_pose_saved.csv, taker_*_pose_saved.csv)"
        )
    return [
        file
        for file in found
        if not any(
            other.parent == file.parent and other.stem.startswith(tuple(file.stem + end for end in PROCESSED))
            for other in found
        )
    ]


def read_trc(path: Path, up: str) -> Trial:
    """Read a .trc file, and the subject's measures from a file of OpenCap in a folder above.

    Args:
        path: path of the file.
        up: vertical axis in the file, y or z; empty: y, as in OpenSim.

    Raises:
        ParameterError: a file cannot be read, or its content is not in this format.
    """
    rows = read_markers(path)
    about = float(rows.time[0]), rows.markers, up or "y", bool(up), _session(path), rows.lacks
    return trial_of(path.name, rate_of(path, rows.time), *about)


def trial_of(
    name: str,
    rate: float,
    start: float,
    points: Mapping[str, FloatArray],
    up: str,
    up_known: bool,
    subject: Mapping[str, float],
    lacks: str = "",
) -> Trial:
    """Return a trial from positions by label in the axes of the file, shape (n, 3) each [m]; NaN: not visible.

    lacks: note on missing frames; empty: no frames are missing.
    """
    positions = vectors_z_up(up, np.stack(list(points.values()), axis=1))
    nothing = np.zeros((0, 0))
    reasons: dict[int | str, str] = {"frames": lacks} if lacks else {}
    return Trial(
        name, rate, tuple(points), positions, 0.0, (), (), nothing, {}, up, up_known, subject, reasons, start=start
    )


def _session(path: Path) -> dict[str, float]:
    """Return mass [kg] and height [m] from OpenCap's file of the session; empty: no file. Raises ParameterError."""
    files = [folder / SESSION for folder in list(path.resolve().parents)[:ABOVE]]
    file = next((file for file in files if file.is_file()), None)
    tree, subject = {} if file is None else read_yaml(file), dict[str, float]()
    if not isinstance(tree, Mapping):
        raise ParameterError(f"{file} has no mapping; valid: lines such as mass_kg: 70.0")
    for key, _, (low, high), _, unit in MEASURES:
        value = tree.get(f"{key}_{unit}")
        if value is None:
            continue
        if not isinstance(value, int | float) or not low <= value <= high:
            raise ParameterError(f"{file}: {key}_{unit} is {value!r}; valid: {low} to {high} {unit}")
        subject[key] = float(value)
    return subject


def pose_points(
    name: str, p: FloatArray, quaternions: FloatArray | None, axes: Sequence[Sequence[float]]
) -> dict[str, FloatArray]:
    """Return the points of a segment by label, shape (n, 3) each [m].

    Args:
        name: label of the segment, with the prefix of the person.
        p: positions of its origin, shape (n, 3) [m]; NaN: not visible.
        quaternions: its orientation (x, y, z, w), shape (n, 4); None: not known.
        axes: its axes forward and left in the T-pose, 3 numbers each.
    """
    points = {name: p}
    if quaternions is None or not TURNED.fullmatch(re.split("[:_/]", name)[-1].upper()):
        return points
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        x_y_z, w = np.split(np.where(length > 0.5, quaternions / length, np.nan), [3], axis=1)
    for end, axis in zip(("forward", "left"), axes, strict=True):
        across = np.cross(x_y_z, axis)
        points[f"{name}_{end}"] = p + AXIS * (axis + 2.0 * (w * across + np.cross(x_y_z, across)))
    return points


def read_motive(path: Path, up: str) -> Trial:
    """Read the markers and the skeletons in a .csv file that Motive has exported (format versions 1.2 and later).

    Args:
        path: path of the file.
        up: vertical axis in the file, y or z; empty: y, as is usual for Motive.

    Raises:
        ParameterError: the file cannot be read, or its content is not in this format.
    """
    lines = list(csv.reader(lines_of(path)))
    metres, turned, stated, frames = _about_motive(path, lines)
    last = next((k for k, row in enumerate(lines) if row and row[0].strip() == "Frame"), 0)
    head, labels = [row for row in lines[1:last] if any(row)], lines[last]
    if len(head) < 3 or any(len(row) != len(labels) for row in head):
        raise ParameterError(
            f"{path} has no complete head; valid: rows Type, Name, ID and Rotation or Position above the row Frame"
        )
    rows = [(k, padded(row, len(labels))) for k, row in enumerate(lines) if k > last and any(row)]
    matrix = matrix_of(path, rows, labels)
    columns: dict[tuple[str, ...], int] = {
        key: k for k, key in enumerate(zip(head[0], head[1], head[-1], labels, strict=True))
    }
    time, axis, points = rising(path, matrix[:, 1]), up or "y", dict[str, FloatArray]()
    check_rate(path, stated, time)
    for kind, name in dict.fromkeys((kind, name) for kind, name, _, _ in columns):
        p = _columns(matrix, columns, (kind, name, "Position"), "XYZ")
        if p is not None and kind in ("Marker", "Bone", "Bone Marker") and name not in points:
            quaternions = _columns(matrix, columns, (kind, name, "Rotation"), "XYZW") if turned else None
            points |= pose_points(name, metres * p, quaternions if kind == "Bone" else None, T_POSE[axis])
    if not points:
        raise ParameterError(f"{path} has no markers and no bones; valid: types Marker, Bone and Bone Marker")
    lacks = lacking(frames, len(time))
    return trial_of(path.name, rate_of(path, time), float(time[0]), points, axis, bool(up), {}, lacks)


def _about_motive(path: Path, lines: Sequence[Sequence[str]]) -> tuple[float, bool, str, str]:
    """Return the unit of length of a file of Motive [m], True if its rotations are quaternions, rate [Hz] and frames.

    Raises:
        ParameterError: it is not a file of Motive, or has another unit or coordinates of the parents.
    """
    if not lines or not lines[0] or lines[0][0] != "Format Version":
        raise ParameterError(f"{path} is not a file of Motive: its first line does not begin with Format Version")
    about = dict(zip(lines[0][::2], lines[0][1::2], strict=False))
    unit, space = about.get("Length Units", "Meters"), about.get("Coordinate Space", "Global")
    if unit.lower() not in METRES or space != "Global":
        raise ParameterError(
            f"{path} has lengths in {unit} and {space} coordinates; valid: Meters, Centimeters or Millimeters, and "
            "Global"
        )
    turned = about.get("Rotation Type", "Quaternion") == "Quaternion"
    return METRES[unit.lower()], turned, about.get("Export Frame Rate", ""), about.get("Total Exported Frames", "")


def _columns(
    matrix: FloatArray, columns: Mapping[tuple[str, ...], int], key: tuple[str, ...], axes: str
) -> FloatArray | None:
    """Return the columns of the axes of a point, shape (n, axes); None: the file lacks one of them."""
    keys = [(*key, axis) for axis in axes]
    return matrix[:, [columns[one] for one in keys]] if all(one in columns for one in keys) else None


def read_mvnx(path: Path, up: str) -> Trial:
    """Read the segments in a .mvnx file of Xsens MVN.

    Args:
        path: path of the file.
        up: vertical axis in the file, y or z; empty: z, which Xsens defines.

    Raises:
        ParameterError: the file cannot be read, or its content is not in this format.
    """
    rate, names, times, values = _mvnx_frames(path)
    p, orientations, n = values["position"], values["orientation"], len(times)
    if n < 2 or {len(row) for row in p} != {3 * len(names)} or len(p) != n or len(set(names)) < len(names):
        raise ParameterError(
            f"{path} has {len(p)} positions of {n} frames for {len(names)} segments; valid: two frames or more, of "
            "type normal, each with 3 numbers for each segment"
        )
    if np.isfinite(times).all():
        check_rate(path, f"{rate:g}" if rate else "", rising(path, np.array(times)))
    rate = rate if 0.0 < rate < np.inf else rate_of(path, rising(path, np.array(times)))
    turned = len(orientations) == n and {len(row) for row in orientations} == {4 * len(names)}
    quaternions = np.reshape(orientations, (n, -1, 4))[..., [1, 2, 3, 0]] if turned else None
    points = dict[str, FloatArray]()
    for k, (name, rows) in enumerate(zip(names, np.reshape(p, (n, -1, 3)).swapaxes(0, 1), strict=True)):
        points |= pose_points(name, rows, None if quaternions is None else quaternions[:, k], XSENS_POSE)
    start = times[0] if np.isfinite(times[0]) else 0.0
    return trial_of(path.name, rate, start, points, up or "z", True, {})


def _mvnx_frames(path: Path) -> tuple[float, list[str], list[float], dict[str, list[list[float]]]]:
    """Return rate [Hz] (0: not stated), segments, times [s], and positions and orientations (w, x, y, z) of the frames.

    Raises:
        ParameterError: the file cannot be read, or is damaged.
    """
    rate, names, times, indices = 0.0, list[str](), list[float](), list[int]()
    values: dict[str, list[list[float]]] = {"position": [], "orientation": []}
    try:
        for tag, element in _elements(path):
            if tag == "subject":
                rate = float(element.get("frameRate", 0.0))
            elif tag == "segment":
                names.append(element.get("label", ""))
            elif tag == "frame" and element.get("type", "normal") == "normal":
                times.append(1e-3 * float(element.get("time", "nan")))
                indices.append(int(element.get("index") or len(indices)))
                if indices[-1] != indices[0] + len(indices) - 1:
                    raise ValueError(f"frame {indices[-1]} follows frame {indices[-2]}; valid: all frames in turn")
                for child in element:
                    if (key := child.tag.rpartition("}")[2]) in values:
                        values[key].append([float(cell) for cell in (child.text or "").split()])
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}") from error
    except (ElementTree.ParseError, ValueError) as error:
        raise ParameterError(f"{path} is not a complete .mvnx file: {error}") from error
    return rate, names or list(XSENS_SEGMENTS), times, values


def _elements(path: Path) -> Iterator[tuple[str, ElementTree.Element]]:
    """Yield the elements of an XML file by their tag without the namespace, subject and segments before the frames."""
    for event, element in ElementTree.iterparse(path, ("start", "end")):
        tag = element.tag.rpartition("}")[2]
        if (event == "start") == (tag in ("subject", "segment")):
            yield tag, element
        if event == "end" and tag == "frame":
            element.clear()
