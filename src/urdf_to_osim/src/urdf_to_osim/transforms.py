"""Conversion of rotations and poses between numpy arrays and OpenSim's types, and handling of OpenSim's messages."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import opensim

from hric_core.geometry.transforms import R_YUP_ZUP, FloatArray, homogeneous


def base_pose(up: str) -> FloatArray:
    """Return the pose of the root link in OpenSim's ground, shape (4, 4).

    up: axis of ground, "y" or "z", that points along z of the root link.
    """
    return homogeneous(R_YUP_ZUP) if up == "y" else np.eye(4)


def body_xyz(R: FloatArray) -> tuple[float, float, float]:
    """Return the body-fixed x-y-z angles (a, b, c) [rad] of R = Rx(a) Ry(b) Rz(c), as OpenSim's `orientation` has them.

    b is computed by atan2, since asin loses half of the digits near a right angle. a is computed from R Rz(-c) = Rx(a)
    Ry(b), whose y axis is (0, cos a, sin a): near the singularity, where only a + c or a - c is determined, a then
    compensates the error of c.
    """
    c = math.atan2(-R[0, 1], R[0, 0])
    y_axis = math.sin(c) * R[:, 0] + math.cos(c) * R[:, 1]
    return math.atan2(y_axis[2], y_axis[1]), math.atan2(R[0, 2], math.hypot(R[0, 0], R[0, 1])), c


def vec3(values: Sequence[float] | FloatArray) -> opensim.Vec3:
    """Return three numbers as an OpenSim vector."""
    return opensim.Vec3(*(float(value) for value in values))


def offset(T: FloatArray) -> tuple[opensim.Vec3, opensim.Vec3]:
    """Return a pose, shape (4, 4), as OpenSim's (translation [m], body-fixed x-y-z angles [rad])."""
    return vec3(T[:3, 3]), vec3(body_xyz(T[:3, :3]))


def set_offset(frame: opensim.PhysicalOffsetFrame, T: FloatArray) -> None:
    """Set the pose of an offset frame in its parent, shape (4, 4) [m]."""
    translation, orientation = offset(T)
    frame.set_translation(translation)
    frame.set_orientation(orientation)


def matrix(T: opensim.Transform) -> FloatArray:
    """Return an OpenSim transform as a matrix, shape (4, 4)."""
    R, p = T.R(), T.p()
    return np.array([*([R.get(i, 0), R.get(i, 1), R.get(i, 2), p.get(i)] for i in range(3)), [0.0, 0.0, 0.0, 1.0]])


def message_of(error: Exception) -> str:
    """Return the message of an OpenSim exception in one line, without its C++ context."""
    words = " ".join(str(error).partition("\tIn Component")[0].split())
    return words.partition("': ")[2] or words


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress OpenSim's log inside the context."""
    level = opensim.Logger.getLevelString()
    opensim.Logger.setLevelString("Off")
    try:
        yield
    finally:
        opensim.Logger.setLevelString(level)
