"""Rotations and transforms in OpenSim's terms."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import opensim

from hric_control.geometry.transforms import R_YUP_ZUP, FloatArray, homogeneous


def base_pose(up: str) -> FloatArray:
    """T_ground_base: pose of the root link in OpenSim's ground, shape (4, 4); up: the ground's axis along z of the
    link, "y" or "z"."""
    return homogeneous(R_YUP_ZUP) if up == "y" else np.eye(4)


def body_xyz(R: FloatArray) -> tuple[float, float, float]:
    """Body-fixed x-y-z angles (a, b, c) [rad] of R = Rx(a) Ry(b) Rz(c), shape (3, 3): OpenSim's `orientation`.

    b by atan2: asin loses half of the digits near a right angle. a is taken from R Rz(-c) = Rx(a) Ry(b), whose y axis
    is (0, cos a, sin a), so that where only a + c or a - c is determined the error of c goes into a.
    """
    c = math.atan2(-R[0, 1], R[0, 0])
    y_axis = math.sin(c) * R[:, 0] + math.cos(c) * R[:, 1]
    return math.atan2(y_axis[2], y_axis[1]), math.atan2(R[0, 2], math.hypot(R[0, 0], R[0, 1])), c


def vec3(values: Sequence[float] | FloatArray) -> opensim.Vec3:
    """Three numbers for OpenSim."""
    return opensim.Vec3(*(float(value) for value in values))


def offset(T: FloatArray) -> tuple[opensim.Vec3, opensim.Vec3]:
    """(translation [m], orientation [rad]) of a pose, shape (4, 4), as joints and offset frames take them."""
    return vec3(T[:3, 3]), vec3(body_xyz(T[:3, :3]))


def set_offset(frame: opensim.PhysicalOffsetFrame, T: FloatArray) -> None:
    """Put an offset frame at a pose in its parent, shape (4, 4) [m]."""
    translation, orientation = offset(T)
    frame.set_translation(translation)
    frame.set_orientation(orientation)


def matrix(T: opensim.Transform) -> FloatArray:
    """A transform of OpenSim's as a matrix, shape (4, 4)."""
    R, p = T.R(), T.p()
    return np.array([*([R.get(i, 0), R.get(i, 1), R.get(i, 2), p.get(i)] for i in range(3)), [0.0, 0.0, 0.0, 1.0]])


def said(error: Exception) -> str:
    """What an exception of OpenSim says, in one line, without the C++ around it."""
    words = " ".join(str(error).partition("\tIn Component")[0].split())
    return words.partition("': ")[2] or words


@contextmanager
def quiet() -> Iterator[None]:
    """OpenSim writes no log lines inside."""
    level = opensim.Logger.getLevelString()
    opensim.Logger.setLevelString("Off")
    try:
        yield
    finally:
        opensim.Logger.setLevelString(level)
