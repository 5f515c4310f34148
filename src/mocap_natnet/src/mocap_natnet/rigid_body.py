"""The pose of a rigid body from its markers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hric_control.errors import CommandError
from hric_control.poses import quaternion
from mocap_natnet.codec.types import Vector
from mocap_natnet.poses import Pose, multiply

COLLINEAR = 0.05
"""Markers count as being on one line when their second extent is below this share of the first (our choice)."""


class Fit:
    """The pose that brings marker positions of a body closest to where they were seen (Kabsch 1976, with the sign of the determinant).

    Args:
        in_body: marker positions in the body, shape (n, 3), n >= 3 [m].
        seen: the same markers in the frame of the cameras, shape (n, 3) [m].

    Attributes:
        pose: of the body.
        rms: root mean square distance of the markers [m].

    Raises:
        CommandError: fewer than three markers, markers on one line, or numbers that are not finite.
    """

    def __init__(self, in_body: Sequence[Vector] | NDArray[np.float64], seen: Sequence[Vector] | NDArray[np.float64]) -> None:
        p, q = np.asarray(in_body, float), np.asarray(seen, float)
        if p.shape != q.shape or p.ndim != 2 or p.shape[1] != 3 or len(p) < 3:
            raise CommandError(f"a pose needs three or more pairs of points, got shapes {p.shape} and {q.shape}")
        if not (np.isfinite(p).all() and np.isfinite(q).all()):
            raise CommandError("a pose needs finite points")
        centre_p, centre_q = p.mean(axis=0), q.mean(axis=0)
        for points, what in ((p - centre_p, "in the body"), (q - centre_q, "as seen")):
            extents = np.linalg.svd(points, compute_uv=False)
            if extents[1] <= COLLINEAR * extents[0]:
                raise CommandError(f"a pose needs points that are not on one line; {what} they are: place one farther aside")
        u, _, vt = np.linalg.svd((p - centre_p).T @ (q - centre_q))
        sign = np.sign(np.linalg.det(vt.T @ u.T))
        R = vt.T @ np.diag([1.0, 1.0, sign]) @ u.T
        position = centre_q - R @ centre_p
        self.pose = Pose((float(position[0]), float(position[1]), float(position[2])), quaternion(R))
        self.rms = float(np.sqrt(np.mean(np.sum((p @ R.T + position - q) ** 2, axis=1))))


def inverse(pose: Pose) -> Pose:
    """T_b_a of T_a_b."""
    x, y, z, w = pose.orientation
    back = (-x, -y, -z, w)
    v = multiply(multiply(back, (*pose.position, 0.0)), pose.orientation)
    return Pose((-v[0], -v[1], -v[2]), back)
