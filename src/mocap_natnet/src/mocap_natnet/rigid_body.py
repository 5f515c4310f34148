"""Pose of a rigid body from the positions of its markers."""

from collections.abc import Sequence

import numpy as np

from hric_core.errors import CommandError
from hric_core.geometry import FloatArray, Pose, Vector, quaternion_from_rotation

COLLINEAR = 0.05
"""Ratio of second to first principal extent of markers up to which they count as collinear [1].

Project default, unconfirmed.
"""


class Fit:
    """Pose of a body fitted to its markers by `poses_of_points`.

    Args:
        in_body: marker positions in the body, shape (n, 3), n >= 3 [m].
        seen: the same markers in the frame of the cameras, shape (n, 3) [m].

    Attributes:
        pose: pose of the body.
        rms: root mean square distance of the markers [m].

    Raises:
        CommandError: fewer than three markers, collinear markers, or numbers that are not finite.
    """

    def __init__(self, in_body: Sequence[Vector] | FloatArray, seen: Sequence[Vector] | FloatArray) -> None:
        p, q = np.asarray(in_body, float), np.asarray(seen, float)
        if p.shape != q.shape or p.ndim != 2 or p.shape[1] != 3 or len(p) < 3:
            raise CommandError(f"a pose needs three or more pairs of points, got shapes {p.shape} and {q.shape}")
        if not (np.isfinite(p).all() and np.isfinite(q).all()):
            raise CommandError("a pose needs finite points")
        for points, what in ((p, "in the body"), (q, "seen by the cameras")):
            if on_one_line(points):
                raise CommandError(
                    f"a pose needs points that are not collinear, but those {what} are; move one of them off the line"
                )
        (position,), (R,) = poses_of_points(p, q[None])
        x, y, z = position.tolist()
        self.pose = Pose((x, y, z), quaternion_from_rotation(R))
        self.rms = float(np.sqrt(np.mean(np.sum((p @ R.T + position - q) ** 2, axis=1))))


def poses_of_points(in_body: FloatArray, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the poses that best fit points of a body to measured ones (Kabsch 1976, with the sign of the determinant).

    Args:
        in_body: points in the body, shape (n, 3) [m].
        seen: measured positions of these points in each frame, shape (frames, n, 3) [m].

    Returns:
        Positions, shape (frames, 3) [m], and rotations, shape (frames, 3, 3), of the body.
    """
    centre_body, centre_measured = in_body.mean(axis=0), seen.mean(axis=1)
    u, _, vt = np.linalg.svd(np.einsum("mi,fmj->fij", in_body - centre_body, seen - centre_measured[:, None]))
    v, ut = np.swapaxes(vt, 1, 2), np.swapaxes(u, 1, 2)
    v[:, :, 2] *= np.sign(np.linalg.det(v @ ut))[:, None]
    R = v @ ut
    return centre_measured - R @ centre_body, R


def on_one_line(points: FloatArray) -> bool:
    """Return True if points, shape (n, 3), are collinear and give no orientation."""
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(extents[1] <= COLLINEAR * extents[0])
