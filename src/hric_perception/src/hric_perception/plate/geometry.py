"""Wrench, centre of pressure and the frame of a force plate. No ROS."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hric_control.errors import ParameterError
from hric_perception.chunk import Chunk, FloatArray, Layout
from hric_perception.human.motion_capture import read_pose
from hric_perception.section import Section
from mocap_natnet.codec.types import Quaternion, Vector
from mocap_natnet.poses import Pose, normalized, z_up

CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
UNITS = ("N", "N", "N", "N m", "N m", "N m")
THRESHOLD = 20.0
"""Least vertical force for which a centre of pressure is told [N]: below it noise decides (facts of practice, common in gait analysis)."""


def mean_wrench(chunk: Chunk) -> tuple[float, FloatArray] | None:
    """(run time [s], wrench shape (6,) [N, N m]) on average over the samples that are numbers; None where there is none."""
    columns = [chunk.layout.channels.index(name) for name in CHANNELS]
    data = chunk.data[:, columns]
    good = np.isfinite(data).all(axis=1)
    if not good.any():
        return None
    return float(chunk.times[good].mean()), data[good].mean(axis=0)


def at_surface(wrench: FloatArray, height: float) -> FloatArray:
    """The same load about the middle of the surface.

    M' = M - p x F with p = (0, 0, height), so Mx' = Mx + height Fy, My' = My - height Fx

    Args:
        wrench: about the plate's electrical origin, z normal to the surface, shape (6,) [N, N m].
        height: of the surface over that origin [m]; the sign differs between makers: check with a known weight.
    """
    fx, fy, fz, mx, my, mz = wrench.tolist()
    return np.array([fx, fy, fz, mx + height * fy, my - height * fx, mz])


def centre_of_pressure(wrench: FloatArray) -> Vector | None:
    """Where the load's line of action meets the surface: px = -My / Fz, py = Mx / Fz.

    Args:
        wrench: about the middle of the surface, z normal to it, shape (6,) [N, N m].

    Returns:
        from the middle of the surface [m]; None up to THRESHOLD.
    """
    _, _, fz, mx, my, _ = wrench.tolist()
    return None if abs(fz) <= THRESHOLD else (-my / fz, mx / fz, 0.0)


def wrench_at(point: Vector, force: Vector) -> FloatArray:
    """Wrench about the origin of a force [N] at a point [m], shape (6,)."""
    return np.concatenate([force, np.cross(point, force)])


def frame_of(corners: Sequence[Vector], up: str) -> Pose:
    """The plate's frame at the centre of its surface, in axes with z up.

    Args:
        corners: four, clockwise from the plate's +x +y, in the axes of the stream [m].
        up: axis of the stream that points up.

    Raises:
        ParameterError: they span no plate.
    """
    a, b, c, d = (np.array(z_up(up, corner)) for corner in corners)
    x, y = (a + b - c - d) / 2, (a + d - b - c) / 2
    z = np.cross(x, y)
    if not np.isfinite([a, b, c, d]).all() or np.linalg.norm(z) < 1e-6:
        raise ParameterError(f"the corners of the force plate are {[tuple(corner) for corner in corners]}; valid: four that span a rectangle [m]")
    z /= np.linalg.norm(z)
    x /= np.linalg.norm(x)
    px, py, pz = ((a + b + c + d) / 4).tolist()
    return Pose((px, py, pz), _quaternion(np.column_stack([x, np.cross(z, x), z])))


def choose_channels(layout: Layout, frame: str) -> Layout:
    """The layout with the six channels by their usual names.

    Args:
        layout: of a source that names them in any case, or has six without names.
        frame: of the vectors.

    Raises:
        ParameterError: a channel is missing.
    """
    usual = {name.lower(): name for name in CHANNELS}
    names = [usual.get(name.lower(), name) for name in layout.channels]
    if len(names) == len(CHANNELS) and all(name.startswith("channel") for name in names):
        names = list(CHANNELS)
    missing = [name for name in CHANNELS if name not in names]
    if missing:
        raise ParameterError(f"{layout.source} has no channel {', '.join(missing)}, but {', '.join(layout.channels)}; valid: {', '.join(CHANNELS)}")
    units = [unit or dict(zip(CHANNELS, UNITS, strict=True)).get(name, "") for name, unit in zip(names, layout.units, strict=True)]
    return Layout(layout.source, tuple(names), tuple(units), layout.rate, frame)


def read_place(section: Section) -> tuple[str, Pose]:
    """(frame, pose in it) of the middle of the surface: keys `frame` ("world"), `xyz` [m], `xyzw`. Raises HricError."""
    pose = {key: value for key, value in section.content.items() if key != "frame"}
    return section.text("frame", "world"), read_pose(Section(section.where, pose))


def _quaternion(R: FloatArray) -> Quaternion:
    """x, y, z, w of a rotation matrix, by its largest part (Shepperd 1978)."""
    squares = [1 + R[0, 0] - R[1, 1] - R[2, 2], 1 - R[0, 0] + R[1, 1] - R[2, 2], 1 - R[0, 0] - R[1, 1] + R[2, 2], 1 + np.trace(R)]
    off = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    both = [[0.0, R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]], [R[0, 1] + R[1, 0], 0.0, R[1, 2] + R[2, 1]], [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 0.0]]
    largest = int(np.argmax(squares))
    q = [*off, squares[3]] if largest == 3 else [*both[largest], off[largest]]
    if largest < 3:
        q[largest] = squares[largest]
    return normalized([float(part) for part in q])
