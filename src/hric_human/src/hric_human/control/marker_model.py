"""Marker positions of a body, and their Jacobian for root and joint motion: one pass over all links."""

from collections.abc import Sequence

import numpy as np

from hric_core.geometry import FloatArray, Pose, Vector, transformed
from hric_core.geometry.quaternions import rotated
from hric_human.body import Body
from hric_human.control.whole_body import WholeBody

ROOT_MOTIONS = 6
"""Number of Jacobian columns for translation and rotation of the root link; those of the joints follow."""


class MarkerModel:
    """Model of marker positions on a body, and of their Jacobian.

    Args:
        body: body of the markers.
        names: names of the markers, in the order of all arrays.

    Attributes:
        body, names: arguments of the constructor.
    """

    def __init__(self, body: Body, names: Sequence[str]) -> None:
        self.body, self.names = body, tuple(names)
        self._dynamics = WholeBody(body)
        links = self._dynamics.links
        self._moving = [(link.name, link.axis, link.joint) for link in links if any(link.axis)]
        self._on: list[tuple[str, Vector]] = []
        self._moved = np.zeros((len(names), len(self._moving), 1))
        index = {link.name: at for at, link in enumerate(links)}
        columns = {name: column for column, (name, _, _) in enumerate(self._moving)}
        for row, name in enumerate(names):
            marker = body.markers[name]
            x, y, z = marker.p_link_marker.tolist()
            self._on.append((marker.link, (x, y, z)))
            at = index.get(marker.link, -1)
            while at >= 0:
                if links[at].name in columns:
                    self._moved[row, columns[links[at].name]] = 1.0
                at = links[at].parent
        self._joints = [ROOT_MOTIONS + joint for _, _, joint in self._moving]

    def at(self, q: Sequence[float], T_world_root: Pose) -> tuple[FloatArray, FloatArray]:
        """Return the positions of the markers, and their Jacobian.

        Args:
            q: positions of all joints, n floats [rad].
            T_world_root: pose of the root link.

        Returns:
            positions, shape (m, 3), in axes of the world [m]; Jacobian, shape (m, 3, 6 + n): columns for translation of
                the root link, its rotation about its origin (both along the axes of the world), and the joints [m/m],
                [m/rad].
        """
        poses = self._dynamics.poses(q, T_world_root)
        p = np.array([transformed(poses[link], p_link) for link, p_link in self._on])
        # A joint's axis has the same coordinates in its parent link and in its child link.
        axes = np.array([rotated(poses[name].orientation, axis) for name, axis, _ in self._moving])
        origins = np.array([poses[name].position for name, _, _ in self._moving])
        J = np.zeros((len(p), 3, ROOT_MOTIONS + len(q)))
        J[:, :, :3] = np.eye(3)
        J[:, :, 3:ROOT_MOTIONS] = _turned(np.eye(3), p[:, None] - np.array(T_world_root.position)).transpose(0, 2, 1)
        turned = self._moved * _turned(axes, p[:, None] - origins)
        J[:, :, self._joints] = turned.transpose(0, 2, 1)
        return p, J


MarkedBody = MarkerModel
"""Former name of MarkerModel, until the next release."""


def _turned(axes: FloatArray, r: FloatArray) -> FloatArray:
    """Return axis x r of each axis (k, 3) and each point (m, k or 1, 3), shape (m, k, 3)."""
    a, b, c = axes.T
    x, y, z = r[..., 0], r[..., 1], r[..., 2]
    return np.stack((b * z - c * y, c * x - a * z, a * y - b * x), axis=-1)
