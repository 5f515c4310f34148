"""Writers of tables as OpenSim files: markers in the axes of OpenSim's ground, joint coordinates, other signals."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hric_bags.export import batches
from hric_bags.export.frames import STATIC, FixedFrames
from hric_bags.export.opensim_text import GROUND, marker_name, write_storage, write_trc
from hric_bags.export.table import ExportError, FloatArray, IntArray, TopicTable

MOCAP_TYPE, JOINTS_TYPE = "hric_msgs/msg/MocapData", "sensor_msgs/msg/JointState"
CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
"""Channels of a force plate, as in hric_perception.plate, which is not imported because it needs ROS."""
THRESHOLD = 20.0
"""Normal force above which a centre of pressure is computed [N], as in hric_perception.plate."""
SIGNALS = (*batches.BATCHED, batches.SYNCED, JOINTS_TYPE, "geometry_msgs/msg/WrenchStamped")
"""Message types whose topics are written as .sto files."""
NEEDED = {"trc": (MOCAP_TYPE, STATIC), "mot": (batches.CONTROL_LOG, JOINTS_TYPE), "sto": (*SIGNALS, batches.LAYOUT)}
"""Message types that each format needs."""
MARKERS, RIGID_BODIES = "labelled_markers", "rigid_bodies"


@dataclass(frozen=True)
class OpenSimMarkers:
    """Marker positions of a motion capture in OpenSim's ground.

    Attributes:
        time: rising times, shape (n,) [s].
        positions: positions by name in the stream ("body/marker"), shape (n, 3) [m]; NaN: not visible.
        axes: text on how the axes were found.
        table: table of the motion capture.
        T_ground_frame: pose of the stream's frame in the ground, shape (4, 4).
        rows: indices of the table's rows, shape (n,).
    """

    time: FloatArray
    positions: Mapping[str, FloatArray]
    axes: str
    table: TopicTable
    T_ground_frame: FloatArray
    rows: IntArray


def is_capture(table: TopicTable) -> bool:
    """Return True if a table has motion capture."""
    return table.type_name == MOCAP_TYPE


def markers_of(table: TopicTable, frames: FixedFrames) -> OpenSimMarkers:
    """Return the labelled markers of a motion capture or, if there are none, the origins of its rigid bodies.

    Raises:
        ExportError: there are neither markers nor rigid bodies.
    """
    time, rows = np.unique(table.time, return_index=True)
    T, axes = frames.in_ground(table.frame)
    names = _prefixes(table.below(MARKERS), ".x")
    base = MARKERS
    paths = {name: name for name in names}
    if not names:
        base = RIGID_BODIES
        paths = {name: f"{name}.pose.position" for name in _prefixes(table.below(RIGID_BODIES), ".pose.position.x")}
    positions = {}
    for name, path in paths.items():
        p = np.column_stack([table.below(f"{base}.{path}")[axis][rows] for axis in "xyz"])
        if base == RIGID_BODIES:
            p[table.below(f"{base}.{name}")["tracking_valid"][rows] != 1] = np.nan
        positions[name] = p @ T[:3, :3].T + T[:3, 3]
    if not positions:
        raise ExportError(f"{table.topic} has neither markers nor bodies")
    return OpenSimMarkers(time, positions, f"{GROUND}; {axes}", table, T, rows.astype(np.int64))


def _prefixes(columns: Iterable[str], suffix: str) -> list[str]:
    return [name.removesuffix(suffix) for name in columns if name.endswith(suffix)]


def write_markers(markers: OpenSimMarkers, path: Path, name: str) -> None:
    """Write markers as a .trc file; name: final file name, which is written into the file."""
    write_trc(
        path, markers.time, {marker_name(marker): p for marker, p in markers.positions.items()}, name, markers.axes
    )


def is_joints(table: TopicTable) -> bool:
    """Return True if a table has the positions of a robot's joints."""
    return table.type_name in (batches.CONTROL_LOG, JOINTS_TYPE) and bool(table.below("position"))


def write_coordinates(table: TopicTable, path: Path) -> None:
    """Write a .mot file of joint positions, labelled as the converted robot's coordinates; rotations in degrees."""
    time, rows = np.unique(table.time, return_index=True)
    columns = {}
    for joint, values in table.below("position").items():
        unit = next(column.unit for column in table.columns if column.name == f"position.{joint}")
        columns[joint] = np.degrees(values[rows]) if unit == "rad" else values[rows]
    about = {
        "units": "time s; rotations deg, translations m",
        "source": table.topic,
        "time": f"seconds since {table.clock}",
    }
    write_storage(path, time, columns, "Coordinates", degrees=True, about=about)


def is_signal(table: TopicTable) -> bool:
    """Return True if a table can be written as a .sto file."""
    return table.type_name in SIGNALS and len(table.time) > 1


def write_signals(table: TopicTable, path: Path) -> None:
    """Write all numbers of a table as a .sto file, in the units and axes of the table."""
    time, rows = np.unique(table.time, return_index=True)
    numbers = {
        name: column
        for name, column in table.named().items()
        if name not in ("time", "stamp") and column.values.dtype.kind in "fiub"
    }
    about = {
        "units": "; ".join(f"{name} {column.unit or '-'}" for name, column in numbers.items()),
        "axes": f"frame {table.frame or 'none'}",
        "source": table.topic,
        "time": f"seconds since {table.clock}",
    }
    columns = {name: column.values[rows].astype(float) for name, column in numbers.items()}
    write_storage(path, time, columns, table.name, about=about)


def is_plate(table: TopicTable) -> bool:
    """Return True if a table has the samples of a force plate."""
    return table.type_name == batches.CHUNK and all(table.column(name) is not None for name in CHANNELS)


def plate_name(table: TopicTable) -> str:
    """Return the id of a force plate from its topic `.../<id>/samples`."""
    parts = table.topic.strip("/").split("/")
    return parts[-2] if parts[-1] == "samples" and len(parts) > 1 else parts[-1]
