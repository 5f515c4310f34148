"""Capsules of a model placed at one instant, compiled, as a control loop or a learning environment needs them."""

from collections.abc import Sequence

import numpy as np

from hric_assessment.separation.capsules import Capsules
from hric_core.geometry import FloatArray
from hric_core.urdf import Robot
from hric_dynamics.tree import Tree, pose_row

WORLD = pose_row(np.eye(4))
"""Pose of a root link that is the world."""


class CapsuleTree:
    """Function from joint positions to the ends of the capsules' axes in the world.

    It gives the same as `Capsules.placed` for the `poses` of the links, which are for recordings, up to rounding.

    Args:
        robot: description of the model.
        joints: names of the joints with known positions; the others are at zero.
        capsules: capsules of the links.
    """

    def __init__(self, robot: Robot, joints: Sequence[str], capsules: Capsules) -> None:
        self._tree = Tree(robot, joints)
        links = np.array([[self._tree.index[link]] for link in capsules.links])
        self._rows = np.hstack([links, capsules.ends.reshape(-1, 6), capsules.radii[:, None]])

    def __call__(self, q: Sequence[float], T_world_root: Sequence[float] = WORLD) -> FloatArray:
        """Return the ends of the axes, shape (k, 2, 3) [m]; not finite if a position is not.

        Args:
            q: joint positions [rad or m].
            T_world_root: pose of the root link, 12 floats as of `pose_row`.

        Raises:
            ValueError: there are more or fewer positions than joints.
        """
        ends = np.empty((len(self._rows), 2, 3))
        self._tree.capsule_ends(q, T_world_root, self._rows, ends)
        return ends
