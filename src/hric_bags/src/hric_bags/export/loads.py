"""External loads on a body, for OpenSim's tools: forces of force plates, and of objects in the hands."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hric_bags.export.batches import CHUNK
from hric_bags.export.frames import STATIC, FixedFrames
from hric_bags.export.opensim_formats import CHANNELS, THRESHOLD, plate_name
from hric_bags.export.opensim_text import GROUND, write_storage
from hric_bags.export.table import FloatArray, TopicTable

GRIP = "hric_msgs/msg/HumanGrip"
NEEDED = (CHUNK, GRIP, STATIC)
"""Message types from which loads follow."""
NOTHING = (
    f"nothing to write, since the topics have no force plate ({CHUNK} with {' '.join(CHANNELS)}) and no hand that "
    f"holds something ({GRIP})"
)


class ExportedLoad(NamedTuple):
    """External force and torque on a body over time.

    Attributes:
        name: name of the load, the prefix of its columns.
        body: body of a model on which the load acts; empty: not known.
        time: times, shape (n,) [s].
        columns: `<name>_force_v[xyz]` [N], `<name>_force_p[xyz]` [m] and `<name>_torque_[xyz]` [N m] in ground axes,
            the torque about the point; shape (n,) each.
        axes: text on how the pose in OpenSim's ground was found.
    """

    name: str
    body: str
    time: FloatArray
    columns: dict[str, FloatArray]
    axes: str


def load(
    name: str, body: str, time: FloatArray, R: FloatArray, vectors: tuple[FloatArray, FloatArray, FloatArray], axes: str
) -> ExportedLoad:
    """Return a load from its vectors.

    Args:
        name: name of the load, the prefix of its columns.
        body: body of a model on which the load acts; empty: not known.
        time: times, shape (n,) [s].
        R: rotation from the axes of the vectors to those of the ground, shape (3, 3).
        vectors: force [N], point from the ground's origin [m] and torque about that point [N m], shape (n, 3) each.
        axes: text on how the pose in OpenSim's ground was found.
    """
    columns = {
        f"{name}_{what}{axis}": values @ R[k]
        for what, values in zip(("force_v", "force_p", "torque_"), vectors, strict=True)
        for k, axis in enumerate("xyz")
    }
    return ExportedLoad(name, body, time, columns, axes)


def of_plate(table: TopicTable, frames: FixedFrames, body: str = "", surface: float = 0.0) -> ExportedLoad:
    """Return the load that a force plate exerts on the body that presses on it.

    The channels are the load on the plate in its frame (middle of the surface, z along the normal), with moments about
    its electrical origin:

        px = (pz Fx - My) / Fz,  py = (Mx + pz Fy) / Fz,  Tz = Mz - px Fy + py Fx

    Args:
        table: samples of the plate.
        frames: frames of the run, with the plate's frame.
        body: body of a model on which the load acts.
        surface: height pz of the surface above the electrical origin [m].
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
    point = np.column_stack([px, py, zero]) + T[:3, 3] @ R
    return load(plate_name(table), body, time, R, (-F, point, -np.column_stack([zero, zero, Tz])), axes)


def of_grips(table: TopicTable, frames: FixedFrames) -> list[ExportedLoad]:
    """Return the load of each grip on the hand that holds; grips by robot links are left out."""
    if table.type_name != GRIP:
        return []
    T, axes = frames.in_ground(table.frame)
    columns = table.named()
    names, holders = (columns[key].values for key in ("name", "holder"))
    loads = []
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero(names == name)
        _, model, body = str(holders[rows[0]]).rpartition("::")
        if model:
            time, first = np.unique(table.time[rows], return_index=True)
            force, point, torque = (
                np.column_stack([columns[f"{key}.{axis}"].values[rows][first].astype(float) for axis in "xyz"])
                for key in ("wrench.force", "point", "wrench.torque")
            )
            R = T[:3, :3]
            loads.append(load(name, body, time, R, (force, point + T[:3, 3] @ R, torque), axes))
    return loads


def write(loads: Sequence[ExportedLoad], path: Path, source: str = "") -> None:
    """Write a .mot file with all loads at the times of the one with the most samples; others are interpolated.

    Args:
        loads: loads with different names.
        path: file to write.
        source: topics of the loads, for the file header.
    """
    time = max((load.time for load in loads), key=len)
    columns = {name: np.interp(time, load.time, values) for load in loads for name, values in load.columns.items()}
    about = {"units": "s, N, m, N m", "axes": "; ".join(filter(None, (GROUND, loads[0].axes)))}
    write_storage(path, time, columns, "External loads", about=about | ({"source": source} if source else {}))


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


def setup(bodies: Mapping[str, str], data: str) -> str:
    """Return the text of OpenSim's set-up file that applies loads to bodies of a model.

    Args:
        bodies: name of the load, as in the columns of the data file -> body on which it acts.
        data: name of the data file.
    """
    return LOADS_XML.format(
        forces="\n".join(FORCE_XML.format(load=load, body=body) for load, body in bodies.items()), data=data
    )
