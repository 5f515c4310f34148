"""Column-major transforms and payloads as they stand in messages: checked and converted at the border."""

import math
from collections.abc import Sequence

import numpy as np

from hric_control.errors import CommandError
from hric_control.geometry import FloatArray, MassProperties
from hric_control.geometry.quaternions import is_rotation

ORTHONORMAL_TOLERANCE = 1e-5
"""How far a rotation matrix may be from orthonormal, as libfranka allows it."""


def column_major(matrix: FloatArray) -> list[float]:
    """Elements of a matrix column by column, as libfranka and franka_msgs order them."""
    return list(map(float, matrix.T.ravel()))


def from_column_major(values: Sequence[float], columns: int = 4) -> FloatArray:
    """The matrix that `column_major` took apart; a pose by default."""
    return np.array(values).reshape(columns, -1).T


def _finite(values: Sequence[float] | FloatArray, n: int, what: str) -> FloatArray:
    result = np.asarray(values, dtype=float).reshape(-1)
    if result.size != n:
        raise CommandError(f"{what} has {result.size} values; it needs {n}")
    if not np.isfinite(result).all():
        raise CommandError(f"{what} is not finite: {result.tolist()}")
    return result


def check_transform(values: Sequence[float], what: str) -> FloatArray:
    """Pose, shape (4, 4), from 16 column-major values.

    Raises:
        CommandError: wrong length, not finite, or not a rotation with the last row 0 0 0 1.
    """
    T = _finite(values, 16, what).reshape(4, 4).T
    if np.abs(T[3] - (0.0, 0.0, 0.0, 1.0)).max() > ORTHONORMAL_TOLERANCE:
        raise CommandError(
            f"{what}: the last row must be 0 0 0 1 (elements 4, 8, 12, 16 of 16 column-major ones); got {T[3].tolist()}"
        )
    R = T[:3, :3]
    error = float(np.abs(R.T @ R - np.eye(3)).max())
    if error > ORTHONORMAL_TOLERANCE or np.linalg.det(R) < 0.0:
        raise CommandError(
            f"{what}: its rotation is not orthonormal and right-handed (error {error:.1e}, determinant "
            f"{np.linalg.det(R):.3f})"
        )
    return np.ascontiguousarray(T)


def check_pose(values: Sequence[float], what: str) -> None:
    """The same check for one cycle of the control loop: on plain floats, in a tenth of the time, without the matrix.

    Raises:
        CommandError: as `check_transform` says it.
    """
    try:
        good = is_pose(values)
    except TypeError:
        good = False
    if not good:
        check_transform(values, what)  # says what is wrong


def is_pose(values: Sequence[float], tolerance: float = ORTHONORMAL_TOLERANCE) -> bool:
    """Whether 16 column-major values are finite, with an orthonormal, right-handed rotation and the last row 0 0 0 1.

    False also where `check_transform` has to look itself. Written so that a NaN fails.
    """
    if len(values) != 16:
        return False
    a, b, c, row_1, d, e, f, row_2, g, h, i, row_3, x, y, z, one = values
    return (
        is_rotation((a, b, c), (d, e, f), (g, h, i), tolerance)
        and abs(row_1) <= tolerance
        and abs(row_2) <= tolerance
        and abs(row_3) <= tolerance
        and abs(one - 1.0) <= tolerance
        and math.isfinite(x)
        and math.isfinite(y)
        and math.isfinite(z)
    )


def check_load(mass: float, com: Sequence[float] | FloatArray, inertia: Sequence[float] | FloatArray) -> MassProperties:
    """A payload.

    Args:
        mass: not negative [kg].
        com: centre of mass in the flange frame, 3 values [m].
        inertia: about the centre of mass, 9 values or shape (3, 3), symmetric without negative principal moments [kg
            m^2].

    Raises:
        CommandError: one of these does not hold.
    """
    m = float(_finite([mass], 1, "load mass")[0])
    if m < 0.0:
        raise CommandError(f"load mass must not be negative; got {m} kg")
    tensor = _finite(inertia, 9, "load inertia").reshape(3, 3)
    scale = max(float(np.abs(tensor).max()), 1e-12)
    if np.abs(tensor - tensor.T).max() > 1e-9 * scale:
        raise CommandError(f"load inertia is not symmetric: {tensor.tolist()}")
    principal = np.linalg.eigvalsh(tensor)
    if principal[0] < -1e-9 * scale:
        raise CommandError(f"load inertia has a negative principal moment: {principal.tolist()} kg m^2")
    return MassProperties(m, _finite(com, 3, "load centre of mass"), tensor)
