"""Bushings: elastic connections between two bodies, e.g. a hand around a handle.

Each body has a grip frame. A translational spring acts on the distance of the two origins and a rotational spring on
the rotation vector between the frames, each with a damper. The load is computed at the start of a step and constant
during it. Force and torque act on both bodies with opposite signs at the origin of body b's grip frame, so that
momentum and angular momentum are conserved. The connection slips like a plastic element: if the load would exceed its
limit, it stays at the limit, and the grip frame in body a is moved so that the spring has the corresponding stretch.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from hric_control.plant import Bushing, BushingLoad
from hric_core.errors import HricError, ParameterError, UnknownNameError
from hric_core.geometry import FloatArray, quaternions
from hric_core.geometry.quaternions import Quaternion, Vector, cross, rotated
from hric_core.geometry.transforms import quaternion_from_rotation

ZERO: Vector = (0.0, 0.0, 0.0)


class LinkMotion(NamedTuple):
    """Pose and velocity of a link's frame, in the world frame.

    Attributes:
        position: position of the link frame's origin [m].
        orientation: unit quaternion (x, y, z, w).
        linear, angular: velocity of the origin [m/s], angular velocity [rad/s].
    """

    position: Vector
    orientation: Quaternion
    linear: Vector
    angular: Vector


class BushingLaw:
    """Force law of one bushing, with its accumulated slip.

    Args:
        bushing: parameters of the bushing, checked by `Bushings.connect`.

    Attributes:
        load: load in the last step.
    """

    __slots__ = ("_at_a", "_at_b", "_rotation_a", "_rotation_b", "bushing", "load")

    def __init__(self, bushing: Bushing) -> None:
        self.bushing = bushing
        self.restart()

    def restart(self) -> None:
        """Reset the bushing to its state when it was connected, without slip."""
        (self._at_a, self._rotation_a), (self._at_b, self._rotation_b) = (
            _split(T) for T in (self.bushing.T_a_grip, self.bushing.T_b_grip)
        )
        self.load = BushingLoad(ZERO, ZERO, ZERO, 0.0, 0.0, 0.0)

    def step(self, a: LinkMotion, b: LinkMotion) -> BushingLoad:
        """Return the load of the coming step, from the motions of both links at its start."""
        law = self.bushing
        lever_a, lever_b = rotated(a.orientation, self._at_a), rotated(b.orientation, self._at_b)
        grip_a, point = _sum(a.position, lever_a), _sum(b.position, lever_b)
        stretch = _difference(point, grip_a)
        # Both velocities are taken at the point where the force acts, so that the damper only dissipates energy.
        velocity_a = _sum(a.linear, cross(a.angular, _difference(point, a.position)))
        velocity = _difference(_sum(b.linear, cross(b.angular, lever_b)), velocity_a)
        rotation_a = quaternions.product(a.orientation, self._rotation_a)
        rotation = quaternions.difference(quaternions.product(b.orientation, self._rotation_b), rotation_a)
        spin = _difference(b.angular, a.angular)
        force, slip = _limited(stretch, velocity, law.stiffness, law.damping, law.force_limit)
        torque, twist = _limited(rotation, spin, law.rotational_stiffness, law.rotational_damping, law.torque_limit)
        before = self.load
        slipped, turned = before.slipped, before.turned
        if slip is not None:
            self._at_a = _sum(self._at_a, rotated(quaternions.inverse(a.orientation), slip))
            slipped += math.hypot(*slip)
        if twist is not None:
            moved = quaternions.product(quaternions.from_rotation_vector(twist), rotation_a)
            self._rotation_a = quaternions.product(quaternions.inverse(a.orientation), moved)
            turned += math.hypot(*twist)
        self.load = BushingLoad(force, torque, point, math.hypot(*stretch), slipped, turned)
        return self.load


def _limited(
    stretch: Vector, velocity: Vector, stiffness: float, damping: float, limit: float
) -> tuple[Vector, Vector | None]:
    """Return the load of a spring and damper, within its limit, and the slip of the spring's end; None: no slip."""
    x = stiffness * stretch[0] + damping * velocity[0]
    y = stiffness * stretch[1] + damping * velocity[1]
    z = stiffness * stretch[2] + damping * velocity[2]
    size = math.hypot(x, y, z)
    if size <= limit:
        return (x, y, z), None
    share = limit / size
    load = share * x, share * y, share * z
    if stiffness == 0.0:
        return load, None
    a, b, c = (s - (f - damping * v) / stiffness for s, f, v in zip(stretch, load, velocity, strict=True))
    return load, (a, b, c)


def _split(T: FloatArray) -> tuple[Vector, Quaternion]:
    x, y, z = T[:3, 3].tolist()
    return (x, y, z), quaternion_from_rotation(T[:3, :3])


def _sum(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _difference(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


class Bushings:
    """All present bushings by name.

    Args:
        full_name: function that returns the name "model::link" of a body; raises UnknownNameError.
        near: function that returns the names "model::link" of a link and of its neighbours.
    """

    def __init__(self, full_name: Callable[[str], str], near: Callable[[str], Sequence[str]]) -> None:
        self._full_name, self._near = full_name, near
        self.laws: dict[str, BushingLaw] = {}

    def connect(self, name: str, bushing: Bushing) -> None:
        """Add a bushing between two bodies.

        Raises:
            HricError: the name is taken, a body does not exist, both bodies are the same, or a transform or number is
                invalid.
        """
        if not name or name in self.laws:
            raise HricError(
                f"connection name {name!r} is empty or taken; taken names: {', '.join(self.laws) or 'none'}"
            )
        a, b = self._full_name(bushing.body_a), self._full_name(bushing.body_b)
        if a == b:
            raise HricError(f"connection {name}: both bodies are {a}")
        _check(name, bushing)
        self.laws[name] = BushingLaw(replace(bushing, body_a=a, body_b=b))

    def disconnect(self, name: str) -> None:
        """Remove a bushing. Raises UnknownNameError."""
        del self.laws[self._known(name)]

    def load(self, name: str) -> BushingLoad:
        """Return the load of a bushing in the last step. Raises UnknownNameError."""
        return self.laws[self._known(name)].load

    def forget_model(self, model: str) -> None:
        """Remove the bushings of a model that is deleted."""
        self.laws = {
            name: law
            for name, law in self.laws.items()
            if not any(body.startswith(f"{model}::") for body in (law.bushing.body_a, law.bushing.body_b))
        }

    def restart(self) -> None:
        """Reset the slip of all bushings; called after bodies were moved."""
        for law in self.laws.values():
            law.restart()

    def pairs(self) -> Iterable[tuple[str, str]]:
        """Return the pairs of connected links, by their names "model::link"."""
        return [(law.bushing.body_a, law.bushing.body_b) for law in self.laws.values()]

    def apart(self) -> list[tuple[str, str]]:
        """Return the pairs of links, "model::link", without contact: connected links and the neighbours of both."""
        return [pair for a, b in self.pairs() for pair in product(self._near(a), self._near(b))]

    def _known(self, name: str) -> str:
        if name not in self.laws:
            raise UnknownNameError("connection", name, self.laws, "the plant")
        return name


def _check(name: str, bushing: Bushing) -> None:
    for field in ("T_a_grip", "T_b_grip"):
        T = np.asarray(getattr(bushing, field), dtype=float)
        x, y, z = T[:3, :3].T.tolist() if T.shape == (4, 4) else [(0.0, 0.0, 0.0)] * 3
        if not (np.isfinite(T).all() and quaternions.is_rotation(x, y, z, 1e-6)):
            raise ParameterError(f"connection {name}: {field} must be a 4 x 4 transform")
    for field in ("stiffness", "damping", "rotational_stiffness", "rotational_damping"):
        value = getattr(bushing, field)
        if not (math.isfinite(value) and value >= 0.0):
            raise ParameterError(f"connection {name}: {field} must be a finite number of 0 or more; got {value}")
    for field in ("force_limit", "torque_limit"):
        if not getattr(bushing, field) > 0.0:
            raise ParameterError(f"connection {name}: {field} must be above 0; got {getattr(bushing, field)}")
