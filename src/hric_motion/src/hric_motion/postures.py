"""Marker positions of a body in many postures at once, and their derivatives by the posture and the body's geometry."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from hric_core.geometry import FloatArray
from hric_human.body import Body
from hric_human.body.markers import ExtraMarker, markers
from hric_human.body.segments import BodySegment
from hric_human.control.marker_model import ROOT_MOTIONS
from hric_human.control.whole_body import WholeBody


class BodyPostures(NamedTuple):
    """Postures of a body at n instants.

    Attributes:
        R: rotation of the root link in the laboratory, shape (n, 3, 3).
        p: position of the root link in the laboratory, shape (n, 3) [m].
        q: joint positions, shape (n, j) [rad].
    """

    R: FloatArray
    p: FloatArray
    q: FloatArray

    def rows(self, chosen: npt.NDArray[np.intp] | npt.NDArray[np.bool_]) -> "BodyPostures":
        """Return the postures of some instants; chosen: their indices, or a mask."""
        return BodyPostures(self.R[chosen], self.p[chosen], self.q[chosen])

    def moved(self, step: FloatArray) -> "BodyPostures":
        """Return the postures after small motions of the root (translation, rotation vector) and the joints.

        step: motions in the order of the Jacobian of `MarkerPostures.at`, shape (n, 6 + j) [m], [rad].
        """
        rotation = Rotation.from_rotvec(step[:, 3:ROOT_MOTIONS]).as_matrix()
        return BodyPostures(rotation @ self.R, self.p + step[:, :3], self.q + step[:, ROOT_MOTIONS:])


class Geometry(NamedTuple):
    """Places of joints and markers on the links of a body, or changes of these.

    Attributes:
        joints: position of each joint in axes of its parent link, shape (l, 3) [m].
        markers: position of each marker in axes of its link, shape (m, 3) [m].
    """

    joints: FloatArray
    markers: FloatArray


class PlacedMarkers(NamedTuple):
    """Markers of a body at n instants.

    Attributes:
        p: positions of the markers in the laboratory, shape (n, m, 3) [m].
        J: derivatives of `p` by translation and rotation of the root link, both along the axes of the laboratory, and
            by the joints, shape (n, m, 3, 6 + j) [m/m], [m/rad].
        R: rotations of the links that the markers are on, shape (n, m, 3, 3): derivatives of `p` by the places of the
            markers on their links.
    """

    p: FloatArray
    J: FloatArray
    R: FloatArray


class MarkerPostures:
    """Kinematics of the markers on a body, for many postures at once.

    Args:
        body: body of the markers.
        names: names of the markers, in the order of all arrays.
        extra: markers that are not in the table of the body.

    Attributes:
        geometry: places of the joints and markers.
    """

    def __init__(self, body: Body, names: Sequence[str], extra: Sequence[ExtraMarker] = ()) -> None:
        tree = WholeBody(body)
        self._names, self._links, self._extra = tuple(names), tree.links, tuple(extra)
        placed = {marker.name: marker for marker in markers(tuple(body.segments.values()), extra)} | dict(body.markers)
        self._on = [tree.index.get(placed[name].link, -1) for name in names]
        joints = np.array([link.offset for link in self._links])
        self.geometry = Geometry(joints, np.array([placed[name].p_link_marker for name in names]))
        self._joints = {name: self._joint(tree, segment) for name, segment in body.segments.items()}
        self._turning = [at for at, link in enumerate(self._links) if any(link.axis)]
        self._axes = np.array([self._links[at].axis for at in self._turning])
        self._joint_of = np.array([self._links[at].joint for at in self._turning], dtype=np.intp)
        moves = list[tuple[int, int]]()  # rows of markers, and places in _turning of the joints that move them
        for row, at in enumerate(self._on):
            while at >= 0:
                if any(self._links[at].axis):
                    moves.append((row, self._turning.index(at)))
                at = self._links[at].parent
        self._moved, self._by = np.array(moves, dtype=np.intp).reshape(-1, 2).T

    def geometry_of(self, segments: Sequence[BodySegment]) -> Geometry:
        """Return the places of joints and markers on the segments of a subject with other lengths."""
        joints = self.geometry.joints.copy()
        placed = {marker.name: marker.p_link_marker for marker in markers(segments, self._extra)}
        for segment in segments:
            joints[self._joints[segment.name]] = segment.p_parent_link
        return Geometry(joints, np.array([placed[name] for name in self._names]))

    def at(self, postures: BodyPostures, geometry: Geometry | None = None) -> PlacedMarkers:
        """Return the markers and their derivatives; geometry: places of joints and markers, None: those of the body."""
        rotations = self._rotations(postures)
        origins, p = self._placed(rotations, postures, geometry or self.geometry)
        J = np.zeros((*p.shape, ROOT_MOTIONS + postures.q.shape[1]))
        J[..., :3] = np.eye(3)
        arms = p - postures.p[:, None]
        J[..., 3:ROOT_MOTIONS] = _cross(np.eye(3), arms[:, :, None]).swapaxes(-1, -2)
        turning = zip(self._turning, self._axes, strict=True)
        axes = np.stack([rotations[at] @ axis for at, axis in turning], axis=1)[:, self._by]
        centres = np.stack([origins[at] for at in self._turning], axis=1)[:, self._by]
        columns = ROOT_MOTIONS + self._joint_of[self._by]
        J[:, self._moved, :, columns] = _cross(axes, p[:, self._moved] - centres).swapaxes(0, 1)
        return PlacedMarkers(p, J, np.stack([rotations[at] for at in self._on], axis=1))

    def positions(self, postures: BodyPostures, geometry: Geometry | None = None) -> FloatArray:
        """Return the positions of the markers, shape (n, m, 3) [m]; geometry: see `at`."""
        return self._placed(self._rotations(postures), postures, geometry or self.geometry)[1]

    def by_geometry(self, postures: BodyPostures, changes: Sequence[Geometry]) -> FloatArray:
        """Return the derivatives of the positions by changes of the geometry, shape (n, m, 3, len(changes)).

        The positions are linear in the geometry.
        """
        rotations, still = self._rotations(postures), postures._replace(p=np.zeros_like(postures.p))
        return np.stack([self._placed(rotations, still, change)[1] for change in changes], axis=-1)

    def _joint(self, tree: WholeBody, segment: BodySegment) -> int:
        """Return the index of the first link after a segment's parent; its origin is where the segment is attached."""
        at = tree.index[segment.link]
        while (before := self._links[at].parent) >= 0 and self._links[before].name != segment.parent:
            at = before
        return at

    def _rotations(self, postures: BodyPostures) -> list[FloatArray]:
        """Return the rotations of all links, of shape (n, 3, 3) each; the last one, index -1, is that of the root."""
        angles = postures.q[:, self._joint_of, None] * self._axes
        R_joints = iter(
            Rotation.from_rotvec(angles.reshape(-1, 3)).as_matrix().reshape(*angles.shape, 3).swapaxes(0, 1)
        )
        rotations = list[FloatArray]()
        for link in self._links:
            R = postures.R if link.parent < 0 else rotations[link.parent]
            rotations.append(R @ next(R_joints) if any(link.axis) else R)
        return [*rotations, postures.R]

    def _placed(
        self, rotations: Sequence[FloatArray], postures: BodyPostures, geometry: Geometry
    ) -> tuple[list[FloatArray], FloatArray]:
        """Return the origins of the links, of shape (n, 3) each, the root's as the last one, and the markers."""
        origins = list[FloatArray]()
        for link, joint in zip(self._links, geometry.joints, strict=True):
            origin = postures.p if link.parent < 0 else origins[link.parent]
            origins.append(origin + rotations[link.parent] @ joint)
        origins.append(postures.p)
        markers = zip(self._on, geometry.markers, strict=True)
        return origins, np.stack([origins[at] + rotations[at] @ p_link for at, p_link in markers], axis=1)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a x b along the last axis; numpy.cross takes twice as long for arrays of this size."""
    x, y, z = np.moveaxis(a, -1, 0)
    u, v, w = np.moveaxis(b, -1, 0)
    return np.stack((y * w - z * v, z * u - x * w, x * v - y * u), axis=-1)
