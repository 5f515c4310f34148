"""Check and conversion of column-major transforms and payloads from messages."""

import math
from collections.abc import Sequence

import numpy as np

from hric_core.errors import CommandError
from hric_core.geometry import FloatArray, MassProperties
from hric_core.geometry.quaternions import is_rotation

ORTHONORMAL_TOLERANCE = 1e-5
"""Tolerance for the orthonormality of a rotation matrix, as in libfranka."""


def column_major(matrix: FloatArray) -> list[float]:
    """Return the elements of a matrix column by column, in the order of libfranka and franka_msgs."""
    return list(map(float, matrix.T.ravel()))


def from_column_major(values: Sequence[float], columns: int = 4) -> FloatArray:
    """Return the matrix with these column-major elements; columns: number of columns, 4 for a pose."""
    return np.array(values).reshape(columns, -1).T


def _finite(values: Sequence[float] | FloatArray, n: int, what: str) -> FloatArray:
    result = np.asarray(values, dtype=float).reshape(-1)
    if result.size != n:
        raise CommandError(f"{what} has {result.size} values; it needs {n}")
    if not np.isfinite(result).all():
        raise CommandError(f"{what} is not finite: {result.tolist()}")
    return result


def check_transform(values: Sequence[float], what: str) -> FloatArray:
    """Return 16 column-major values as a checked pose, shape (4, 4).

    Raises:
        CommandError: the values are not 16 finite ones, not a rotation, or the last row is not 0 0 0 1; `what` names
            them in the text.
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


def check_frame(values: Sequence[float], what: str) -> FloatArray:
    """Return the pose of a frame fixed to the hand, shape (4, 4), from 16 column-major values.

    Raises:
        CommandError: the values are not a pose, or farther than MAX_FRAME_DISTANCE along an axis.
    """
    T = check_transform(values, what)
    if np.abs(T[:3, 3]).max() > MAX_FRAME_DISTANCE:
        raise CommandError(
            f"{what}: position {T[:3, 3].tolist()} m; valid: up to {MAX_FRAME_DISTANCE:g} m along each axis"
        )
    return T


def check_pose(values: Sequence[float], what: str) -> None:
    """Raise an error if 16 column-major values are not a pose; fast enough for each cycle of a control loop.

    Raises:
        CommandError: the values are not a pose; the text is that of `check_transform`.
    """
    try:
        good = is_pose(values)
    except TypeError:
        good = False
    if not good:
        check_transform(values, what)  # raises an error with the reason


def is_pose(values: Sequence[float], tolerance: float = ORTHONORMAL_TOLERANCE) -> bool:
    """Return True if 16 column-major values are a pose: finite, right-handed rotation, last row 0 0 0 1.

    Also False in cases that only `check_transform` can decide. NaN in any element gives False.
    """
    if len(values) != 16:
        return False
    a, b, c, row_1, d, e, f, row_2, g, h, i, row_3, x, y, z, corner = values
    return (
        is_rotation((a, b, c), (d, e, f), (g, h, i), tolerance)
        and abs(row_1) <= tolerance
        and abs(row_2) <= tolerance
        and abs(row_3) <= tolerance
        and abs(corner - 1.0) <= tolerance
        and math.isfinite(x)
        and math.isfinite(y)
        and math.isfinite(z)
    )


MAX_FRAME_DISTANCE = 2.0
"""Largest distance along each axis of the end-effector and stiffness frames from their parent frames [m].

Project default, unconfirmed; longer than any tool, but below most lengths in mm."""
MAX_LOAD, MAX_LOAD_DISTANCE, MAX_LOAD_INERTIA = 20.0, 1.0, 20.0
"""Maximum payload: mass [kg], distance from the flange along each axis [m], moment of inertia [kg m^2].

Project defaults, unconfirmed; far above the arm's rated payload of 3 kg, but below the same numbers in grams or mm.
"""


def check_load(mass: float, com: Sequence[float] | FloatArray, inertia: Sequence[float] | FloatArray) -> MassProperties:
    """Return a checked payload.

    Args:
        mass: mass, 0 to MAX_LOAD [kg].
        com: centre of mass in the flange frame, 3 values up to MAX_LOAD_DISTANCE [m].
        inertia: inertia about the centre of mass, 9 values or shape (3, 3), symmetric, without negative principal
            moments, up to MAX_LOAD_INERTIA [kg m^2].

    Raises:
        CommandError: one of these conditions is violated.
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
    centre = _finite(com, 3, "load centre of mass")
    if m > MAX_LOAD or np.abs(centre).max() > MAX_LOAD_DISTANCE or np.abs(tensor).max() > MAX_LOAD_INERTIA:
        raise CommandError(
            f"a load of {m:g} kg at {centre.tolist()} m with inertia {tensor.ravel().tolist()} kg m^2 exceeds the "
            f"maximum of {MAX_LOAD:g} kg, {MAX_LOAD_DISTANCE:g} m, {MAX_LOAD_INERTIA:g} kg m^2"
        )
    return MassProperties(m, centre, tensor)
