"""Capsules of a description, poses of its links, and the motion of both over a recording."""

from collections.abc import Callable, Collection, Iterable, Sequence

import numpy as np

from hric_assessment.separation.capsules import Capsules
from hric_core import urdf
from hric_core.geometry import FloatArray
from hric_core.geometry.transforms import skew
from hric_core.urdf.shapes import Shape, join_capsules

Poses = Callable[[FloatArray], FloatArray]
"""Function from times, shape (n,) [s], to poses in the world, shape (n, 4, 4)."""


def capsules_of(tree: urdf.Robot, links: Iterable[str]) -> tuple[Capsules, list[str]]:
    """Return the capsules of the collision shapes of some links, and the links whose meshes are left out.

    A cylinder becomes the capsule around it, a box the smallest enclosing capsule along its longest edge.
    """
    names, ends, radii, left_out = [], [], [], []
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


def moved_by(tree: urdf.Robot, joints: Collection[str]) -> list[str]:
    """Return the links that some joints move, from the root outwards."""
    moved: set[str] = set()
    for joint in tree.joints.values():
        if joint.name in joints or joint.parent in moved:
            moved.add(joint.child)
    return [name for name in tree.links if name in moved]


def _capsule(shape: Shape) -> tuple[FloatArray, float] | None:
    """Return (half of the capsule axis, in the frame of the shape; radius) [m]; None: a mesh."""
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
    """Return T_world_link of all links, shape (n, 4, 4) each.

    Args:
        tree: the description.
        joints: names of the columns of q; all other joints are at zero.
        q: joint positions, shape (n, j) [rad or m].
        T_world_root: shape (n, 4, 4); None: the root is the world.
    """
    columns = {name: column for column, name in enumerate(joints)}
    T = {tree.root: np.broadcast_to(np.eye(4), (len(q), 4, 4)) if T_world_root is None else T_world_root}
    for joint in tree.joints.values():
        T_world_joint, column = T[joint.parent] @ joint.T_parent_joint, columns.get(joint.name)
        T[joint.child] = T_world_joint if column is None else T_world_joint @ _motion(joint, q[:, column])
    return T


def _motion(joint: urdf.Joint, q: FloatArray) -> FloatArray:
    """Return the poses of the child in the joint frame by Rodrigues' formula, shape (n, 4, 4)."""
    T = np.tile(np.eye(4), (len(q), 1, 1))
    if joint.type == "prismatic":
        T[:, :3, 3] = q[:, None] * joint.axis
        return T
    K = skew(joint.axis)
    T[:, :3, :3] += np.sin(q)[:, None, None] * K + (1.0 - np.cos(q))[:, None, None] * (K @ K)
    return T


class CapsuleMotion:
    """Ends of the capsules of a model over time.

    Args:
        tree: description of the model.
        capsules: capsules of its links.
        joints: names of the columns of q; all other joints are at zero.
        time: ascending, shape (m,) [s].
        q: joint positions, shape (m, j) [rad]; linear between two samples.
        root: motion of the root link.
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
        self._tree, self._capsules, self._joints = tree, capsules, joints
        self._time, self._q, self._root = time, q, root

    def __call__(self, time: FloatArray) -> FloatArray:
        """Return the ends in the world, shape (n, k, 2, 3) [m]; time: shape (n,) [s]."""
        q = np.array([np.interp(time, self._time, column) for column in self._q.T]).T.reshape(len(time), -1)
        T = poses(self._tree, self._joints, q, None if self._root is None else self._root(time))
        return self._capsules.placed(np.stack([T[link] for link in self._capsules.links], axis=1))


def speeds(ends: Callable[[FloatArray], FloatArray], time: FloatArray, block: int = 2000) -> FloatArray:
    """Return the speed of the fastest end of any capsule, by central differences over +-1 ms, shape (n,) [m/s].

    Args:
        ends: function from times to the ends of the capsules.
        time: shape (n,) [s].
        block: number of instants that are evaluated at once.
    """
    step = 1e-3
    found = []
    for begin in range(0, len(time), block):
        own = time[begin : begin + block]
        moved = ends(own + step) - ends(own - step)
        found.append(np.linalg.norm(moved, axis=-1).max(axis=(1, 2)) / (2.0 * step))
    return np.concatenate(found)
