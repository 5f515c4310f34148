"""Bushings: springs and dampers that hold two links of a MuJoCo scene together.

Link motions and bushing loads are exchanged with MuJoCo's data as plain floats by C code (links.c); numpy views would
take ten times as long.
"""

from collections.abc import Sequence
from typing import Protocol

from hric_control.plants import Bushings, LinkMotion
from hric_core.geometry import quaternion_from_rotation
from hric_core.geometry.quaternions import Quaternion, Vector
from hric_core.native import load
from mujoco_ros_control.scene import CompiledScene

_built = load("hric_mujoco_links")


class MujocoBushingLinks(Protocol):
    """Interface of the compiled object that has the two links of each bushing."""

    def motions(self) -> list[tuple[Vector, Quaternion, Vector, Vector]]:
        """Return the motion of each link's frame in the world frame, at the last update of the scene.

        Position [m], orientation (x, y, z, w), linear velocity [m/s], angular velocity [rad/s]; the two links of the
        first bushing, then those of the second, and so on.
        """

    def push(self, pair: int, force: Vector, torque: Vector, point: Vector, /) -> None:
        """Apply a force [N] at a point [m] and a torque [N m] to a bushing's first link, the opposite to its second.

        They act during the coming step; pair: index of the bushing; all vectors in the world frame.
        """


def make_links(scene: CompiledScene, names: Sequence[str]) -> MujocoBushingLinks:
    """Return the compiled object for the links of bushings.

    Args:
        scene: compiled scene.
        names: links by "model::link", the two links of each bushing one after the other.
    """
    rows = []
    for name in names:
        frame = scene.built.frames[name]
        T = frame.T_body_link
        rows.append([scene.bodies[frame.body], *T[:3, 3].tolist(), *quaternion_from_rotation(T[:3, :3])])
    made: MujocoBushingLinks = _built.Links(scene.m._address, scene.d._address, rows, (scene.m, scene.d))
    return made


class SceneBushings(Bushings):
    """All bushings of a MuJoCo plant, and the application of their loads.

    Attributes:
        any: True if there is a bushing.
    """

    def bind(self, scene: CompiledScene) -> None:
        """Find the links of all bushings in a newly compiled scene, or after bushings were added or removed."""
        pairs = list(self.pairs())
        self.any = bool(pairs)
        self._links = make_links(scene, [link for pair in pairs for link in pair])
        scene.set_connected(self.apart())

    def push(self) -> None:
        """Apply the loads of all bushings, from the present positions and velocities, in the coming step."""
        motions = self._links.motions()
        for i, law in enumerate(self.laws.values()):
            load = law.step(LinkMotion(*motions[2 * i]), LinkMotion(*motions[2 * i + 1]))
            self._links.push(i, load.force, load.torque, load.point)
