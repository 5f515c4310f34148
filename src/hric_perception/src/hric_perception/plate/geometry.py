"""Wrench, centre of pressure and frame of a force plate. No ROS."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import ORIGIN, Pose, Vector, quaternion_from_rotation
from hric_core.geometry.poses import PoseSettings, z_up
from hric_core.parameters import numbers, text
from hric_perception.chunk import Chunk, FloatArray, Layout

CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
UNITS = ("N", "N", "N", "N m", "N m", "N m")
PLATE_SIZE = (0.6, 0.4)
"""Size of an emulated plate's surface along x and y [m] (default chosen by this project, unconfirmed)."""
THRESHOLD = 20.0
"""Vertical force above which a centre of pressure is published [N]; below it noise dominates.

The value is common in gait analysis.
"""


def plate_name(name: str) -> str:
    """Return a plate's name, a part of topic names. Raises ValueError unless it has only letters, digits and _."""
    if not name.replace("_", "").isalnum() or not name.isascii():
        raise ValueError
    return name


PLATE_ID: Any = text(
    "1",
    valid="letters, digits and _",
    figures=True,
    made=plate_name,
    name="id",
    text="id of the plate in the names of topics",
)


@dataclass(frozen=True)
class PlatePose(PoseSettings):
    """Parameters of a force plate's pose: middle of its surface, z normal to it, in a parent frame."""

    xyz: Vector = numbers(3, ORIGIN, unit="m", text="position of the middle of the surface in `frame`")
    frame: str = text("world")


def mean_wrench(chunk: Chunk) -> tuple[float, FloatArray] | None:
    """Return (mean robot time [s], mean wrench, shape (6,) [N, N m]) of a chunk's finite samples; None without any."""
    data = chunk.data[:, [chunk.layout.channels.index(name) for name in CHANNELS]]
    good = np.isfinite(data).all(axis=1)
    if not good.any():
        return None
    return float(chunk.times[good].mean()), data[good].mean(axis=0)


def at_surface(wrench: FloatArray, height: float) -> FloatArray:
    """Return the wrench on a plate about the middle of its surface, shape (6,) [N, N m].

    M' = M - p x F with p = (0, 0, height), so Mx' = Mx + height Fy, My' = My - height Fx

    Args:
        wrench: wrench about the plate's electrical origin, z normal to the surface, shape (6,) [N, N m].
        height: height of the surface above that origin [m]; the sign differs between makers: check with a known weight.
    """
    fx, fy, fz, mx, my, mz = wrench.tolist()
    return np.array([fx, fy, fz, mx + height * fy, my - height * fx, mz])


def centre_of_pressure(wrench: FloatArray) -> Vector | None:
    """Return the centre of pressure on a plate's surface: px = -My / Fz, py = Mx / Fz.

    Args:
        wrench: wrench about the middle of the surface, z normal to it, shape (6,) [N, N m].

    Returns:
        position from the middle of the surface [m]; None if the vertical force is at most THRESHOLD.
    """
    _, _, fz, mx, my, _ = wrench.tolist()
    return None if abs(fz) <= THRESHOLD else (-my / fz, mx / fz, 0.0)


def wrench_at(point: Vector, force: Vector) -> FloatArray:
    """Return the wrench about the origin of a force [N] that acts at a point [m], shape (6,) [N, N m]."""
    return np.concatenate([force, np.cross(point, force)])


def frame_of(corners: Sequence[Vector], up: str) -> Pose:
    """Return the pose of a plate's frame (centre of its surface) in the stream's frame, turned to z up.

    Args:
        corners: four corners, clockwise from the plate's +x +y, in the axes of the stream [m].
        up: axis of the stream that points up, e.g. "y".

    Raises:
        ParameterError: the corners do not span a rectangle.
    """
    a, b, c, d = (np.array(z_up(up, corner)) for corner in corners)
    x, y = (a + b - c - d) / 2, (a + d - b - c) / 2
    z = np.cross(x, y)
    if not np.isfinite([a, b, c, d]).all() or np.linalg.norm(z) < 1e-6:
        raise ParameterError(
            f"the corners of the force plate are {[tuple(corner) for corner in corners]}; valid: four that span a "
            "rectangle [m]"
        )
    z /= np.linalg.norm(z)
    x /= np.linalg.norm(x)
    px, py, pz = ((a + b + c + d) / 4).tolist()
    return Pose((px, py, pz), quaternion_from_rotation(np.column_stack([x, np.cross(z, x), z])))


def choose_channels(layout: Layout, frame: str) -> Layout:
    """Return the layout of a force plate with its six channels renamed to Fx ... Mz.

    Args:
        layout: layout of the source, which names these channels in any letter case, or has six unnamed channels.
        frame: coordinate frame of force and moment.

    Raises:
        ParameterError: a channel is missing.
    """
    usual = {name.lower(): name for name in CHANNELS}
    names = [usual.get(name.lower(), name) for name in layout.channels]
    if len(names) == len(CHANNELS) and all(name.startswith("channel") for name in names):
        names = list(CHANNELS)
    missing = [name for name in CHANNELS if name not in names]
    if missing:
        raise ParameterError(
            f"{layout.source} has no channel {', '.join(missing)}, only {', '.join(layout.channels)}; valid: "
            f"{', '.join(CHANNELS)}"
        )
    units = [
        unit or dict(zip(CHANNELS, UNITS, strict=True)).get(name, "")
        for name, unit in zip(names, layout.units, strict=True)
    ]
    return Layout(layout.source, tuple(names), tuple(units), layout.rate, frame)
