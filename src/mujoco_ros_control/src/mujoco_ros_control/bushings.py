"""Bushings between links of a scene. How links move, and the forces between them, go out of and into MuJoCo's data as
plain floats, in C (links.c): views of numpy would take ten times as long."""

from collections.abc import Sequence
from typing import Protocol

from hric_control.geometry import quaternion_from_rotation
from hric_control.geometry.quaternions import Quaternion, Vector
from hric_control.native import load
from hric_control.plants import Bushings, Motion
from mujoco_ros_control.scene import Scene

_built = load("hric_mujoco_links")


class Links(Protocol):
    """Pairs of links, one after the other."""

    def motions(self) -> list[tuple[Vector, Quaternion, Vector, Vector]]:
        """Of each link, in the world frame, as of the last update of the scene: position of its origin [m], orientation
        (x, y, z, w), velocity of the origin [m/s], angular velocity [rad/s]."""

    def push(self, pair: int, force: Vector, torque: Vector, point: Vector, /) -> None:
        """A force [N] at a point [m] and a torque [N m] on the first link of a pair for the coming step, and the
        opposite ones on the second, in the world frame."""


def make_links(scene: Scene, names: Sequence[str]) -> Links:
    """Links of a compiled scene by "model::link", two of each pair."""
    rows = []
    for name in names:
        frame = scene.built.frames[name]
        T = frame.T_body_link
        rows.append([scene.bodies[frame.body], *T[:3, 3].tolist(), *quaternion_from_rotation(T[:3, :3])])
    made: Links = _built.Links(scene.m._address, scene.d._address, rows, (scene.m, scene.d))
    return made


class SceneBushings(Bushings):
    """All that are connected, and what they do in MuJoCo.

    Attributes:
        any: whether there is one.
    """

    def bind(self, scene: Scene) -> None:
        """Another scene, or others connected."""
        pairs = list(self.pairs())
        self.any = bool(pairs)
        self._links = make_links(scene, [link for pair in pairs for link in pair])
        scene.set_connected(self.apart())

    def push(self) -> None:
        """Hold both links of each together in the coming step; positions and velocities are those of now."""
        motions = self._links.motions()
        for i, law in enumerate(self.laws.values()):
            load = law.step(Motion(*motions[2 * i]), Motion(*motions[2 * i + 1]))
            self._links.push(i, load.force, load.torque, load.point)
