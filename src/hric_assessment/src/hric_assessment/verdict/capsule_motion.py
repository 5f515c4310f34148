"""The capsules of an arm and of a person over a recording."""

from collections.abc import Callable, Sequence

import numpy as np

from hric_assessment.separation.capsules import Capsules
from hric_control import urdf
from hric_control.geometry import FloatArray
from hric_control.geometry.transforms import skew
from hric_control.urdf.shapes import Shape, join_capsules

Poses = Callable[[FloatArray], FloatArray]
"""Times, shape (n,) [s] -> poses in the world, shape (n, 4, 4)."""


def capsules_of(tree: urdf.Robot, moved_by: Sequence[str]) -> tuple[Capsules, list[str]]:
    """Those of the collision shapes of all links that some joints move, and the links that have other shapes.

    A cylinder becomes the capsule around it, a box the smallest one along its longest edge that holds it; a mesh is
    left out.

    Args:
        tree: of the arm.
        moved_by: names of joints.
    """
    links, ends, radii, left_out = [], [], [], []
    for name in _behind(tree, moved_by):
        for shape in join_capsules(tree.links[name].collisions):
            found = _capsule(shape)
            if found is None:
                left_out.append(name)
                continue
            along, radius = found
            middle, z = shape.T_link_shape[:3, 3], shape.T_link_shape[:3, :3] @ along
            links.append(name)
            ends.append([middle - z, middle + z])
            radii.append(radius)
    return Capsules(tuple(links), np.array(ends).reshape(-1, 2, 3), np.array(radii)), left_out


def _behind(tree: urdf.Robot, joints: Sequence[str]) -> list[str]:
    moved: set[str] = set()
    for joint in tree.joints.values():  # from the root outwards
        if joint.name in joints or joint.parent in moved:
            moved.add(joint.child)
    return [name for name in tree.links if name in moved]


def _capsule(shape: Shape) -> tuple[FloatArray, float] | None:
    """(half of the straight part, in axes of the shape; radius) [m]; None: a mesh."""
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


class CapsuleMotion:
    """The ends of capsules of a model over time.

    Args:
        tree: its description.
        capsules: of its links.
        joints: names of the columns of q; all others are at zero.
        time: ascending, shape (m,) [s].
        q: shape (m, j) [rad]; between two samples on straight lines.
        root: of its root link.
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
        self._tree, self._capsules, self._time, self._q = tree, capsules, time, q
        self._columns = {name: column for column, name in enumerate(joints)}
        self._root = root or (lambda time: np.tile(np.eye(4), (len(time), 1, 1)))

    def __call__(self, time: FloatArray) -> FloatArray:
        """In the world, shape (n, k, 2, 3) [m]; time: shape (n,) [s]."""
        T = {self._tree.root: self._root(time)}
        for joint in self._tree.joints.values():
            placed = T[joint.parent] @ joint.T_parent_joint
            column = self._columns.get(joint.name)
            if column is not None:
                placed = placed @ _motion(joint, np.interp(time, self._time, self._q[:, column]))
            T[joint.child] = placed
        return self._capsules.placed(np.stack([T[link] for link in self._capsules.links], axis=1))


def _motion(joint: urdf.Joint, q: FloatArray) -> FloatArray:
    """Poses of the child in the joint's frame, shape (n, 4, 4): Rodrigues' formula."""
    T = np.tile(np.eye(4), (len(q), 1, 1))
    if joint.type == "prismatic":
        T[:, :3, 3] = q[:, None] * joint.axis
        return T
    K = skew(joint.axis)
    T[:, :3, :3] += np.sin(q)[:, None, None] * K + (1.0 - np.cos(q))[:, None, None] * (K @ K)
    return T


def speeds(ends: Callable[[FloatArray], FloatArray], time: FloatArray, block: int = 2000) -> FloatArray:
    """Of the fastest end of any capsule, shape (n,) [m/s]: differences over a millisecond to either side.

    Args:
        ends: of the capsules.
        time: shape (n,) [s].
        block: instants at once.
    """
    step = 1e-3
    found = []
    for begin in range(0, len(time), block):
        own = time[begin : begin + block]
        moved = ends(own + step) - ends(own - step)
        found.append(np.linalg.norm(moved, axis=-1).max(axis=(1, 2)) / (2.0 * step))
    return np.concatenate(found)
