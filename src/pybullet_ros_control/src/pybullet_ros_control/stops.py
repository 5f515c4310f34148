"""Joint stops. The engine has them; what it lacks is a start outside the range, as the thesis does at q = 0."""

from __future__ import annotations

from collections.abc import Sequence

import pybullet

from hric_control.plants.stops import StopMemory
from pybullet_ros_control.engine import Body, Engine

_FAR = 1e9
"""A bound that no joint reaches [rad or m]."""


class JointStops:
    """Both stops of each joint; one that the joint started beyond is left open until the joint has been inside.

    Args:
        joints: engine indices.
        limits: (lower, upper) per joint [rad or m], infinite where there is no stop.
    """

    def __init__(self, engine: Engine, body: Body, joints: Sequence[int], limits: Sequence[tuple[float, float]]) -> None:
        self._engine, self._body = engine, body
        self._joints, self._memory = list(joints), StopMemory(limits)

    @property
    def waiting(self) -> bool:
        """Whether a stop is open."""
        return bool(self._memory.waiting)

    def place(self, q: Sequence[float]) -> None:
        """The robot was put at q from outside: decide anew which stops act."""
        for i in self._memory.place(q):
            self._send(i)

    def restore(self, body: Body) -> None:
        """The body was loaded anew, with all stops acting: open the waiting ones again."""
        self._body = body
        for i in self._memory.waiting:
            self._send(i)

    def check(self, q: Sequence[float]) -> None:
        """Let a waiting stop act as soon as the joint is inside its range."""
        for i in self._memory.check(q):
            self._send(i)

    def _send(self, i: int) -> None:
        low, high = self._memory.limits[i]
        below, above = self._memory.waiting.get(i, (False, False))
        pybullet.changeDynamics(
            self._body.id,
            self._joints[i],
            jointLowerLimit=-_FAR if below else low,
            jointUpperLimit=_FAR if above else high,
            physicsClientId=self._engine.client,
        )
