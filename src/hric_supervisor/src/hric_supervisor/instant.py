"""Distance of an arm and a person at one instant, compiled, as a control loop or a learning environment needs it."""

from collections.abc import Sequence

import numpy as np

from hric_assessment.separation.capsules import Capsules, of_body
from hric_core.geometry import Pose
from hric_core.urdf import Robot, read
from hric_dynamics.tree import Tree, closest, pose_row
from hric_human.body import Body
from hric_supervisor.arm import ArmShape


class _Placed:
    """Capsules of a model, which are placed again at each instant."""

    def __init__(self, robot: Robot, joints: Sequence[str], capsules: Capsules) -> None:
        self._tree = Tree(robot, joints)
        links = [self._tree.index[link] for link in capsules.links]
        count = len(links)
        self._rows = np.hstack([np.array(links)[:, None], capsules.ends.reshape(count, 6), capsules.radii[:, None]])
        self.ends, self.radii = np.empty((count, 2, 3)), np.ascontiguousarray(capsules.radii)

    def update(self, q: Sequence[float], T_world_root: Sequence[float]) -> None:
        self._tree.capsule_ends(q, T_world_root, self._rows, self.ends)


class InstantSeparation:
    """Function from the joint positions of an arm and a person to the smallest distance of their capsules.

    It gives the same as `ArmShape`, `BodyShape` and `distances`, which are for recordings, up to rounding.

    Args:
        arm: capsules of the arm.
        body: body of the person.
    """

    def __init__(self, arm: ArmShape, body: Body) -> None:
        self._arm = _Placed(arm.tree, arm.joints, arm.capsules)
        self._person = _Placed(read(body.urdf), tuple(body.joints), of_body(body))
        self._base = pose_row(np.eye(4))

    def __call__(self, q: Sequence[float], q_person: Sequence[float], root: Pose) -> float:
        """Return the distance [m], negative if they overlap; NaN if a position is not finite.

        Args:
            q: joint positions of the arm [rad or m].
            q_person: joint positions of the person [rad].
            root: pose of the person's root link in the world.
        """
        arm, person = self._arm, self._person
        arm.update(q, self._base)
        person.update(q_person, pose_row(root.transform()))
        return closest(arm.ends, arm.radii, person.ends, person.radii)
