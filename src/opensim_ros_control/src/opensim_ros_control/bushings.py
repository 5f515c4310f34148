"""Bushings: springs and dampers that hold two links of an OpenSim model together.

Link motions and bushing loads are exchanged with OpenSim's memory as plain floats by C code (links.c); Simbody then
converts the loads on all bodies into joint efforts in one call.
"""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import opensim

from hric_control.plants import Bushings, LinkMotion
from hric_core.geometry import FloatArray
from hric_core.geometry.quaternions import Quaternion, Vector
from hric_core.native import load
from opensim_ros_control.bodies import BodyForce, Kinematics
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.stages import view

_built = load("hric_opensim_links")


class OpenSimBushingLinks(Protocol):
    """Interface of the compiled object that has the two links of each bushing."""

    def motions(self) -> list[tuple[Vector, Quaternion, Vector, Vector]]:
        """Return the motion of each link's frame in the world frame, and set all loads to zero.

        Position [m], orientation (x, y, z, w), linear velocity [m/s], angular velocity [rad/s]; the two links of the
        first bushing, then those of the second, and so on.
        """

    def push(self, pair: int, force: Vector, torque: Vector, point: Vector, /) -> None:
        """Add a force [N] at a point [m] and a torque [N m] to a bushing's first link, the opposite to its second.

        pair: index of the bushing; all vectors in the world frame.
        """


def _zero() -> opensim.SpatialVec:
    return opensim.SpatialVec(opensim.Vec3(0.0), opensim.Vec3(0.0))


class OpenSimBushings(Bushings):
    """All bushings of an OpenSim plant, and their loads as joint efforts.

    Args:
        full_name: function that completes the name of a link to "model::link", as in `Bushings`.
        near: function that returns the links next to a link, as in `Bushings`.
        R_ground_world: rotation of the world in OpenSim's ground, shape (3, 3).

    Attributes:
        any: True if there is a bushing.
    """

    def __init__(
        self, full_name: Callable[[str], str], near: Callable[[str], Sequence[str]], R_ground_world: FloatArray
    ) -> None:
        super().__init__(full_name, near)
        self._R, self.any = R_ground_world, False

    def bind(self, engine: OpenSimEngine, kinematics: Kinematics, frame: Callable[[str], str]) -> None:
        """Find the links of all bushings in a new build of the model, or after bushings were added or removed.

        Args:
            engine: engine with the model.
            kinematics: kinematics of the same engine.
            frame: function that returns the engine's frame name of "model::link".
        """
        carriers = [kinematics.carrier(engine.frame(frame(link))) for pair in self.pairs() for link in pair]
        self.any = bool(carriers)
        if not self.any:
            return
        self._engine = engine
        self._numbers = [number for number, _ in carriers]
        self._bodies = {number: kinematics.body(number) for number in self._numbers}
        self._forces = {number: _zero() for number in self._numbers}
        engine.model.realizeVelocity(engine.system_state)
        self._of_all = opensim.VectorOfSpatialVec(kinematics.count(), _zero())
        self._efforts = opensim.Vector(engine.nu, 0.0)
        self._efforts_view = view(self._efforts)
        self._links = self._make_links(carriers)

    def _make_links(self, carriers: Sequence[tuple[int, FloatArray]]) -> OpenSimBushingLinks:
        rows = []
        for number, T in carriers:
            held = *self._motion(self._bodies[number]), self._forces[number]
            rows.append((*(int(thing.this) for thing in held), [*T[:3, :3].ravel().tolist(), *T[:3, 3].tolist()]))
        made: OpenSimBushingLinks = _built.Links(rows, self._R.T.ravel().tolist(), (self._engine, self._forces))
        return made

    def _motion(self, body: opensim.PhysicalFrame) -> tuple[Any, Any]:
        """Return pose and velocity of a body as references to OpenSim's memory, valid until the state changes."""
        state = self._engine.system_state
        return body.getTransformInGround(state), body.getVelocityInGround(state)

    def efforts(self, y: FloatArray) -> FloatArray:
        """Return the joint efforts of all bushings in a step that starts in the state y, shape (nu,) [N m or N]."""
        engine = self._engine
        engine.put_y(y)
        engine.model.realizeVelocity(engine.system_state)
        for body in self._bodies.values():
            self._motion(body)
        motions = self._links.motions()
        for i, law in enumerate(self.laws.values()):
            done = law.step(LinkMotion(*motions[2 * i]), LinkMotion(*motions[2 * i + 1]))
            self._links.push(i, done.force, done.torque, done.point)
        for number, force in self._forces.items():
            self._of_all.set(number, force)
        engine.matter.multiplyBySystemJacobianTranspose(engine.system_state, self._of_all, self._efforts)
        return self._efforts_view.copy()

    def loads(self) -> list[BodyForce]:
        """Return the loads of all bushings on the bodies in the last step."""
        loads = []
        for i, law in enumerate(self.laws.values()):
            force, torque, point = (self._R @ vector for vector in law.load[:3])
            for number, sign in zip(self._numbers[2 * i : 2 * i + 2], (1.0, -1.0), strict=True):
                loads.append(BodyForce(number, point, sign * force, sign * torque))
        return loads
