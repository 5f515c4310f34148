"""Bushings between links of a scene.

Link motions and bushing forces are exchanged with MuJoCo's data as plain floats, in C (links.c): numpy views would take
ten times as long.
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
    """Interface of the link pairs in C, one pair after the other."""

    def motions(self) -> list[tuple[Vector, Quaternion, Vector, Vector]]:
        """Return the motion of each link's frame, world frame, at the last update of the scene.

        Position [m], orientation (x, y, z, w), linear velocity [m/s], angular velocity [rad/s].
        """

    def push(self, pair: int, force: Vector, torque: Vector, point: Vector, /) -> None:
        """Apply a force [N] at a point [m] and a torque [N m] to the first link of a pair, the opposite to the second.

        They act in the coming step, in the world frame.
        """


def make_links(scene: CompiledScene, names: Sequence[str]) -> MujocoBushingLinks:
    """Return the links of a compiled scene by "model::link", two of each pair."""
    rows = []
    for name in names:
        frame = scene.built.frames[name]
        T = frame.T_body_link
        rows.append([scene.bodies[frame.body], *T[:3, 3].tolist(), *quaternion_from_rotation(T[:3, :3])])
    made: MujocoBushingLinks = _built.Links(scene.m._address, scene.d._address, rows, (scene.m, scene.d))
    return made


class SceneBushings(Bushings):
    """Connected bushings, and their forces in MuJoCo.

    Attributes:
        any: True if there is a bushing.
    """

    def bind(self, scene: CompiledScene) -> None:
        """Bind to another scene, or after a change of the connections."""
        pairs = list(self.pairs())
        self.any = bool(pairs)
        self._links = make_links(scene, [link for pair in pairs for link in pair])
        scene.set_connected(self.apart())

    def push(self) -> None:
        """Apply the bushing forces of the present positions and velocities in the coming step."""
        motions = self._links.motions()
        for i, law in enumerate(self.laws.values()):
            load = law.step(LinkMotion(*motions[2 * i]), LinkMotion(*motions[2 * i + 1]))
            self._links.push(i, load.force, load.torque, load.point)
