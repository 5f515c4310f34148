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
"""Size of the plate's surface along x and y, as emulated [m] (default chosen by this project, unconfirmed)."""
THRESHOLD = 20.0
"""Minimum vertical force for which a centre of pressure is published [N]; below it noise dominates.

The value is common in gait analysis.
"""


def plate_name(name: str) -> str:
    """Return a part of topic names. Raises ValueError: letters, digits and _ only."""
    if not name.replace("_", "").isalnum() or not name.isascii():
        raise ValueError
    return name


PLATE_ID: Any = text(
    "1", valid="letters, digits and _", figures=True, made=plate_name, name="id", text="in the names of topics"
)


@dataclass(frozen=True)
class PlatePose(PoseSettings):
    """Pose of the middle of the surface."""

    xyz: Vector = numbers(3, ORIGIN, unit="m", text="of the middle of the surface, in `frame`")
    frame: str = text("world")


def mean_wrench(chunk: Chunk) -> tuple[float, FloatArray] | None:
    """Return the mean (robot time [s], wrench shape (6,) [N, N m]) of the finite samples; None without any."""
    columns = [chunk.layout.channels.index(name) for name in CHANNELS]
    data = chunk.data[:, columns]
    good = np.isfinite(data).all(axis=1)
    if not good.any():
        return None
    return float(chunk.times[good].mean()), data[good].mean(axis=0)


def at_surface(wrench: FloatArray, height: float) -> FloatArray:
    """Return the load about the middle of the surface.

    M' = M - p x F with p = (0, 0, height), so Mx' = Mx + height Fy, My' = My - height Fx

    Args:
        wrench: about the plate's electrical origin, z normal to the surface, shape (6,) [N, N m].
        height: height of the surface above that origin [m]; the sign differs between makers: check with a known weight.
    """
    fx, fy, fz, mx, my, mz = wrench.tolist()
    return np.array([fx, fy, fz, mx + height * fy, my - height * fx, mz])


def centre_of_pressure(wrench: FloatArray) -> Vector | None:
    """Return where the load's line of action intersects the surface: px = -My / Fz, py = Mx / Fz.

    Args:
        wrench: about the middle of the surface, z normal to it, shape (6,) [N, N m].

    Returns:
        from the middle of the surface [m]; None up to THRESHOLD.
    """
    _, _, fz, mx, my, _ = wrench.tolist()
    return None if abs(fz) <= THRESHOLD else (-my / fz, mx / fz, 0.0)


def wrench_at(point: Vector, force: Vector) -> FloatArray:
    """Return the wrench about the origin of a force [N] at a point [m], shape (6,)."""
    return np.concatenate([force, np.cross(point, force)])


def frame_of(corners: Sequence[Vector], up: str) -> Pose:
    """Return the plate's frame at the centre of its surface, in axes with z up.

    Args:
        corners: four, clockwise from the plate's +x +y, in the axes of the stream [m].
        up: axis of the stream that points up.

    Raises:
        ParameterError: the corners span no plate.
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
    """Return the layout with the six channels by their usual names.

    Args:
        layout: layout of a source that names them in any case, or has six without names.
        frame: frame of the vectors.

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
            f"{layout.source} has no channel {', '.join(missing)}, but {', '.join(layout.channels)}; valid: "
            f"{', '.join(CHANNELS)}"
        )
    units = [
        unit or dict(zip(CHANNELS, UNITS, strict=True)).get(name, "")
        for name, unit in zip(names, layout.units, strict=True)
    ]
    return Layout(layout.source, tuple(names), tuple(units), layout.rate, frame)
