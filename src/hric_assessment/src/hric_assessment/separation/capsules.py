"""Capsules that enclose the links of a person or a robot: their distances, vectorised, and motion over a recording."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_core import urdf
from hric_core.geometry import FloatArray
from hric_core.geometry.transforms import skew
from hric_core.urdf.shapes import Shape, join_capsules
from hric_human.body import Body

IntArray = np.ndarray[Any, np.dtype[np.int64]]
_TINY = 1e-300
"""Replacement for a squared axis length of zero [m^2], since a capsule may be a sphere."""


@dataclass(frozen=True)
class Capsules:
    """Capsules of the links of a model.

    Attributes:
        links: link of each capsule, k names; a link may have several.
        ends: ends of the axes, in the frames of the links, shape (k, 2, 3) [m].
        radii: radii of the capsules, shape (k,) [m].
    """

    links: tuple[str, ...]
    ends: FloatArray
    radii: FloatArray

    def placed(self, T_world_link: FloatArray) -> FloatArray:
        """Return the axis ends in the world, shape (n, k, 2, 3) [m].

        Args:
            T_world_link: pose of each capsule's link at n instants, shape (n, k, 4, 4).
        """
        placed, points = np.empty((*T_world_link.shape[:2], 2, 3)), np.ones((len(self.ends), 4, 2))
        points[:, :3] = np.swapaxes(self.ends, 1, 2)
        for k, ends in enumerate(points):  # one product of all rows costs half of a product for each instant
            placed[:, k] = np.swapaxes((T_world_link[:, k].reshape(-1, 4) @ ends).reshape(-1, 4, 2)[:, :3], 1, 2)
        return placed


def of_body(body: Body) -> Capsules:
    """Return the capsules of a simulated person, one for each segment."""
    segments = list(body.segments.values())
    return Capsules(
        tuple(segment.link for segment in segments),
        np.array([segment.straight for segment in segments]),
        np.array([segment.radius for segment in segments]),
    )


def segment_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distances of pairs of line segments, shape (...,) [m], NaN for unknown ends; shapes broadcast.

    Args:
        a: both ends of each first segment, shape (..., 2, 3) [m].
        b: both ends of each second segment, shape (..., 2, 3) [m].
    """
    square, _, _ = _nearest(a, b)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def nearest_points(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the point of each segment that is nearest to the other, shape (..., 3) each [m].

    If there are several nearest points, any of them is returned. Arguments: see `segment_distance`.
    """
    _, s, t = _nearest(a, b)
    return a[..., 0, :] + s[..., None] * (a[..., 1, :] - a[..., 0, :]), b[..., 0, :] + t[..., None] * (
        b[..., 1, :] - b[..., 0, :]
    )


def _nearest(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the squared distance [m^2], and the positions along both segments from 0 to 1, shape (...,) each.

    The squared distance is a convex quadratic of the positions s and t on the unit square. Its minimum in the plane,
    clamped to the square one coordinate after the other, is the minimum in the square (Ericson, Real-Time Collision
    Detection, 5.1.9). Parallel segments have no unique minimum; starting at an end of the first segment finds one.
    """
    u, v, w = a[..., 1, :] - a[..., 0, :], b[..., 1, :] - b[..., 0, :], a[..., 0, :] - b[..., 0, :]
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw, ww = _dot(u, w), _dot(v, w), _dot(w, w)
    safe_u, safe_v = np.maximum(uu, _TINY), np.maximum(vv, _TINY)
    determinant = uu * vv - uv * uv
    s = np.clip((uv * vw - vv * uw) / np.maximum(determinant, _TINY), 0.0, 1.0)
    best, best_s, best_t = np.full(np.shape(ww), np.inf), np.zeros(np.shape(ww)), np.zeros(np.shape(ww))
    for start in (s, np.zeros_like(s), np.ones_like(s)):
        t = np.clip((uv * start + vw) / safe_v, 0.0, 1.0)
        near = np.clip((uv * t - uw) / safe_u, 0.0, 1.0)
        square = ww + near * (near * uu + 2.0 * uw) + t * (t * vv - 2.0 * vw) - 2.0 * near * t * uv
        better = square < best
        best, best_s, best_t = (np.where(better, *pair) for pair in ((square, best), (near, best_s), (t, best_t)))
    return np.where(np.isfinite(uu + vv + ww), best, np.nan), best_s, best_t


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def distances(a: FloatArray, radii_a: FloatArray, b: FloatArray, radii_b: FloatArray) -> FloatArray:
    """Return the distance of each capsule of one model from each of another, shape (n, k, m) [m]; negative: overlap.

    Args:
        a: axis ends of the first model's capsules, shape (n, k, 2, 3) [m].
        radii_a: radii of the first model's capsules, shape (k,) [m].
        b: axis ends of the second model's capsules, shape (n, m, 2, 3) [m].
        radii_b: radii of the second model's capsules, shape (m,) [m].
    """
    return segment_distance(a[:, :, None], b[:, None]) - radii_a[:, None] - radii_b


Poses = Callable[[FloatArray], FloatArray]
"""Function from times, shape (n,) [s], to poses in the world, shape (n, 4, 4)."""


def capsules_of(tree: urdf.Robot, links: Iterable[str]) -> tuple[Capsules, list[str]]:
    """Return the capsules around the collision shapes of some links, and the links with a shape that none encloses.

    These are meshes, and links without collision shape. A cylinder becomes the capsule around it, a box the smallest
    enclosing capsule along its longest edge.
    """
    links = list(links)
    names, ends, radii, left_out = [], [], [], shapeless(tree, links)
    for name in links:
        for shape in join_capsules(tree.links[name].collisions):
            capsule = _capsule(shape)
            if capsule is None:
                left_out.append(name)
                continue
            along, radius = capsule
            middle, z = shape.T_link_shape[:3, 3], shape.T_link_shape[:3, :3] @ along
            names.append(name)
            ends.append([middle - z, middle + z])
            radii.append(radius)
    return Capsules(tuple(names), np.array(ends).reshape(-1, 2, 3), np.array(radii)), left_out


def shapeless(tree: urdf.Robot, links: Iterable[str]) -> list[str]:
    """Return the links that have a mass or a visual shape, but no collision shape, so that nothing can touch them."""
    bodies = [(name, tree.links[name]) for name in links]
    solid = [(name, body) for name, body in bodies if body.visuals or (body.mass is not None and body.mass.mass > 0.0)]
    return [name for name, body in solid if not body.collisions]


def moved_by(tree: urdf.Robot, joints: Collection[str]) -> list[str]:
    """Return the links that some joints move, in the order of the tree's links."""
    moved: set[str] = set()
    for joint in tree.joints.values():
        if joint.name in joints or joint.parent in moved:
            moved.add(joint.child)
    return [name for name in tree.links if name in moved]


def unlogged(tree: urdf.Robot, joints: Collection[str]) -> tuple[str, ...]:
    """Return the movable joints without known position; fingers at the end of the arm do not count."""
    free = [joint for joint in tree.joints.values() if joint.type != "fixed" and joint.mimic is None]
    moved = moved_by(tree, joints)
    return tuple(joint.name for joint in free if joint.name not in joints and joint.parent not in moved)


def _capsule(shape: Shape) -> tuple[FloatArray, float] | None:
    """Return the vector from a capsule's middle to an axis end, in the frame of the shape, and its radius [m].

    Return None for a mesh.
    """
    z = np.array([0.0, 0.0, 1.0])
    if shape.kind == "sphere":
        return 0.0 * z, shape.size[0]
    if shape.kind in ("capsule", "cylinder"):
        return 0.5 * shape.size[1] * z, shape.size[0]
    if shape.kind != "box":
        return None
    longest = int(np.argmax(shape.size))
    others = np.delete(np.array(shape.size), longest)
    return 0.5 * shape.size[longest] * np.eye(3)[longest], 0.5 * float(np.linalg.norm(others))


def poses(
    tree: urdf.Robot, joints: Sequence[str], q: FloatArray, T_world_root: FloatArray | None = None
) -> dict[str, FloatArray]:
    """Return the poses of all links in the world by name, shape (n, 4, 4) each.

    Args:
        tree: URDF of the model.
        joints: names of the columns of q; all other joints are at zero.
        q: joint positions, shape (n, j) [rad or m].
        T_world_root: pose of the root link, shape (n, 4, 4); None: the root is the world.
    """
    columns = {name: column for column, name in enumerate(joints)}
    T = {tree.root: np.broadcast_to(np.eye(4), (len(q), 4, 4)) if T_world_root is None else T_world_root}
    for joint in tree.joints.values():
        # One product of all rows costs a quarter of a product for each instant.
        T[joint.child] = (T[joint.parent].reshape(-1, 4) @ joint.T_parent_joint).reshape(-1, 4, 4)
        if (column := columns.get(joint.name)) is not None:
            _move(T[joint.child], joint, q[:, column])
    return T


def _move(T: FloatArray, joint: urdf.Joint, q: FloatArray) -> None:
    """Turn poses of a joint frame, shape (n, 4, 4), into those of the child link; q: joint positions, shape (n,)."""
    if joint.type == "prismatic":
        along = np.tile(np.eye(4), (len(q), 1, 1))
        along[:, :3, 3] = q[:, None] * joint.axis
        T[:] = T @ along
        return
    K = skew(joint.axis)
    R = np.eye(3) + (np.multiply.outer(np.sin(q), K) + np.multiply.outer(1.0 - np.cos(q), K @ K))
    T[:, :3, :3] = T[:, :3, :3] @ R


class CapsuleMotion:
    """Motion of a model's capsules over time, from recorded joint positions.

    Args:
        tree: URDF of the model.
        capsules: capsules of the model's links.
        joints: names of the columns of q; all other joints are at zero.
        time: ascending times of the samples, shape (m,) [s].
        q: joint positions, shape (m, j) [rad]; interpolated linearly between two samples.
        root: function from times to poses of the root link; None: the root is the world.

    Attributes:
        tree, capsules: as above.
    """

    def __init__(
        self,
        tree: urdf.Robot,
        capsules: Capsules,
        joints: Sequence[str],
        time: FloatArray,
        q: FloatArray,
        root: Poses | None = None,
    ) -> None:
        self.tree, self.capsules, self._joints = tree, capsules, joints
        self._time, self._q, self._root = time, q, root

    def __call__(self, time: FloatArray) -> FloatArray:
        """Return the axis ends of the capsules in the world, shape (n, k, 2, 3) [m]; time: times, shape (n,) [s]."""
        q = np.array([np.interp(time, self._time, column) for column in self._q.T]).T.reshape(len(time), -1)
        T = poses(self.tree, self._joints, q, None if self._root is None else self._root(time))
        return self.capsules.placed(np.stack([T[link] for link in self.capsules.links]).swapaxes(0, 1))


def speeds(ends: Callable[[FloatArray], FloatArray], time: FloatArray, block: int = 2000) -> FloatArray:
    """Return the speed of the fastest axis end of all capsules, by central differences over +-1 ms, shape (n,) [m/s].

    Args:
        ends: function from times to the axis ends of the capsules.
        time: times, shape (n,) [s].
        block: number of instants that are evaluated at once.
    """
    step = 1e-3
    blocks = []
    for begin in range(0, len(time), block):
        instants = time[begin : begin + block]
        moved = ends(instants + step) - ends(instants - step)
        blocks.append(np.linalg.norm(moved, axis=-1).max(axis=(1, 2)) / (2.0 * step))
    return np.concatenate(blocks)
