"""Tables as files of OpenSim: markers, coordinates, other signals, external loads; all in the axes of its ground."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hric_bags.export import batches
from hric_bags.export.frames import Frames
from hric_bags.export.opensim_text import GROUND, marker_name, write_storage, write_trc
from hric_bags.export.table import ExportError, FloatArray, IntArray, Table

MOCAP_TYPE, JOINTS_TYPE = "hric_msgs/msg/MocapData", "sensor_msgs/msg/JointState"
CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
"""Of a force plate, as hric_perception.plate names them; that module needs ROS's messages, export does not."""
THRESHOLD = 20.0
"""Smallest force along the plate's normal for which there is a centre of pressure [N], that of
hric_perception.plate."""
SIGNALS = (*batches.BATCHED, batches.SYNCED, JOINTS_TYPE, "geometry_msgs/msg/WrenchStamped")
"""Message types that are written as .sto."""
MARKERS, RIGID_BODIES = "labelled_markers", "rigid_bodies"


@dataclass(frozen=True)
class Markers:
    """Markers of a motion capture in OpenSim's ground.

    Attributes:
        time: shape (n,) [s], rising.
        positions: name as in the stream ("body/marker") -> shape (n, 3) [m]; NaN: not seen.
        axes: where the axes come from, for people.
        table: what they were taken from.
        T_ground_frame: pose of the stream's frame in the ground, shape (4, 4).
        rows: of the table, shape (n,).
    """

    time: FloatArray
    positions: Mapping[str, FloatArray]
    axes: str
    table: Table
    T_ground_frame: FloatArray
    rows: IntArray


def is_capture(table: Table) -> bool:
    """Whether a table is of a motion capture."""
    return table.type_name == MOCAP_TYPE


def markers_of(table: Table, frames: Frames) -> Markers:
    """Labelled markers, or, where there are none, the rigid bodies' origins.

    Raises:
        ExportError: there is neither.
    """
    time, rows = np.unique(table.time, return_index=True)
    T, axes = frames.in_ground(table.frame)
    names = _prefixes(table.below(MARKERS), ".x")
    base = MARKERS
    found = {name: name for name in names}
    if not names:
        base = RIGID_BODIES
        found = {name: f"{name}.pose.position" for name in _prefixes(table.below(RIGID_BODIES), ".pose.position.x")}
    positions = {}
    for name, path in found.items():
        p = np.column_stack([table.below(f"{base}.{path}")[axis][rows] for axis in "xyz"])
        if base == RIGID_BODIES:
            p[table.below(f"{base}.{name}")["tracking_valid"][rows] != 1] = np.nan
        positions[name] = p @ T[:3, :3].T + T[:3, 3]
    if not positions:
        raise ExportError(f"{table.topic} has neither markers nor bodies")
    return Markers(time, positions, f"{GROUND}; {axes}", table, T, rows.astype(np.int64))


def _prefixes(columns: Iterable[str], suffix: str) -> list[str]:
    return [name.removesuffix(suffix) for name in columns if name.endswith(suffix)]


def write_markers(markers: Markers, path: Path, name: str) -> None:
    """A .trc file."""
    write_trc(
        path, markers.time, {marker_name(marker): p for marker, p in markers.positions.items()}, name, markers.axes
    )


def is_joints(table: Table) -> bool:
    """Whether a table has the positions of a robot's joints."""
    return table.type_name in (batches.CONTROL_LOG, JOINTS_TYPE) and bool(table.below("position"))


def write_coordinates(table: Table, path: Path) -> None:
    """A .mot file of joint positions, labelled as the coordinates of the converted robot; rotations in degrees."""
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


def is_signal(table: Table) -> bool:
    """Whether a table is written as .sto."""
    return table.type_name in SIGNALS and len(table.time) > 1


def write_signals(table: Table, path: Path) -> None:
    """A .sto file of all numbers of a table, in their own units and axes."""
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


def is_plate(table: Table) -> bool:
    """Whether a table is a force plate's samples."""
    return table.type_name == batches.CHUNK and all(table.column(name) is not None for name in CHANNELS)


def plate_name(table: Table) -> str:
    """Identifier of a plate, from its topic `.../<id>/samples`."""
    parts = table.topic.strip("/").split("/")
    return parts[-2] if parts[-1] == "samples" and len(parts) > 1 else parts[-1]


def external_load(table: Table, frames: Frames, surface: float = 0.0) -> tuple[FloatArray, dict[str, FloatArray], str]:
    """What a plate does to the body that presses it: (time (n,) [s], columns, axes).

    Columns `<id>_force_v[xyz]` [N], `<id>_force_p[xyz]` [m], `<id>_torque_[xyz]` [N m] in ground axes; the torque is
    about the point. The channels are what acts on the plate, in its frame at the middle of the surface with z along the
    normal, the moments about its electrical origin:

        px = (pz Fx - My) / Fz,  py = (Mx + pz Fy) / Fz,  Tz = Mz - px Fy + py Fx

    Args:
        table: see `is_plate`.
        frames: where the plate is.
        surface: height pz of the surface over that origin [m].
    """
    time, rows = np.unique(table.time, return_index=True)
    values = {
        column.name: np.asarray(column.values, dtype=float)[rows] for column in table.columns if column.name in CHANNELS
    }
    F, M = (np.column_stack([values[name] for name in names]) for names in (CHANNELS[:3], CHANNELS[3:]))
    loaded = np.abs(F[:, 2]) > THRESHOLD
    Fz = np.where(loaded, F[:, 2], 1.0)
    px = np.where(loaded, (surface * F[:, 0] - M[:, 1]) / Fz, 0.0)
    py = np.where(loaded, (M[:, 0] + surface * F[:, 1]) / Fz, 0.0)
    Tz = np.where(loaded, M[:, 2] - px * F[:, 1] + py * F[:, 0], 0.0)
    F = np.where(loaded[:, None], F, 0.0)
    T, axes = frames.in_ground(table.frame)
    R, zero = T[:3, :3], np.zeros_like(Tz)
    force, torque = -F @ R.T, -np.column_stack([zero, zero, Tz]) @ R.T
    point = np.column_stack([px, py, zero]) @ R.T + T[:3, 3]
    name = plate_name(table)
    vectors = {"force_v": force, "force_p": point, "torque_": torque}
    columns = {f"{name}_{what}{axis}": v[:, k] for what, v in vectors.items() for k, axis in enumerate("xyz")}
    return time, columns, axes


def write_loads(tables: list[Table], frames: Frames, path: Path, surface: float = 0.0) -> None:
    """A .mot file with the loads of all plates at the times of the fastest; the others between their samples."""
    loads = [external_load(table, frames, surface) for table in tables]
    time = max((load[0] for load in loads), key=len)
    columns = {name: np.interp(time, own, values) for own, found, _ in loads for name, values in found.items()}
    about = {
        "units": "s, N, m, N m",
        "axes": f"{GROUND}; {loads[0][2]}",
        "source": " ".join(table.topic for table in tables),
    }
    write_storage(path, time, columns, "External loads", about=about)


LOADS_XML = """<?xml version="1.0" encoding="UTF-8" ?>
<OpenSimDocument Version="40500">
  <ExternalLoads name="loads">
    <objects>
{forces}
    </objects>
    <datafile>{data}</datafile>
  </ExternalLoads>
</OpenSimDocument>
"""
FORCE_XML = """      <ExternalForce name="{load}">
        <applied_to_body>{body}</applied_to_body>
        <force_expressed_in_body>ground</force_expressed_in_body>
        <point_expressed_in_body>ground</point_expressed_in_body>
        <force_identifier>{load}_force_v</force_identifier>
        <point_identifier>{load}_force_p</point_identifier>
        <torque_identifier>{load}_torque_</torque_identifier>
      </ExternalForce>"""


def loads_setup(bodies: Mapping[str, str], data: str) -> str:
    """The set-up file that applies loads to bodies of a model.

    Args:
        bodies: name of each load, as in the columns of the file, and the body that it acts on.
        data: name of that file.
    """
    return LOADS_XML.format(
        forces="\n".join(FORCE_XML.format(load=load, body=body) for load, body in bodies.items()), data=data
    )
