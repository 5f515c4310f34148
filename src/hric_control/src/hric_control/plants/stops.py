"""Joint stops: which of them act, and what those of spawned models do.

A stop acts only once the joint has been inside its range: a start outside, as the thesis does at q = 0, leaves it open
until then. The robot's stops are of its engine; those of other models are a spring and a damper, alike in all engines.
"""

import math
from collections.abc import Sequence

import numpy as np

from hric_control.geometry import MassProperties
from hric_control.urdf import Joint, Robot


class StopMemory:
    """Remembers which stops are still open.

    Args:
        limits: (lower, upper) per joint [rad or m], infinite where there is no stop.

    Attributes:
        waiting: for each joint that started outside, by its place: whether it is (below, above) and that stop therefore
            open.
    """

    def __init__(self, limits: Sequence[tuple[float, float]]) -> None:
        self.limits = list(limits)
        self.waiting: dict[int, tuple[bool, bool]] = {}

    def restart(self, q: Sequence[float]) -> set[int]:
        """The robot was put at q from outside: decide again which stops act. Returns the joints whose stops may have
        changed."""
        before = set(self.waiting)
        self.waiting = {
            i: (x < low, x > high)
            for i, (x, (low, high)) in enumerate(zip(q, self.limits, strict=True))
            if not low <= x <= high
        }
        return before | set(self.waiting)

    def check(self, q: Sequence[float]) -> list[int]:
        """Let a waiting stop act as soon as the joint is inside its range. Returns the joints whose stops act from now
        on."""
        inside = [i for i in self.waiting if self.limits[i][0] <= q[i] <= self.limits[i][1]]
        for i in inside:
            del self.waiting[i]
        return inside


STOP_RATE = 2.0 * math.pi * 50.0
"""Natural frequency of a joint on its stop, critically damped [rad/s]: a third of a radian per step of 1 ms, so that a
force held over the step does not shake it (default chosen by this project, unconfirmed)."""


class StopLaw:
    """What the ends of the ranges of a spawned model's joints do: k (limit - q) - c dq beyond the limit, never inwards.

    k and c follow from STOP_RATE and the inertia of all that hangs on the joint, about its axis, with all joints at
    zero.

    Args:
        tree: description of the model.
        joints: names of the moving joints, in the order of all vectors here.
    """

    def __init__(self, tree: Robot, joints: Sequence[str]) -> None:
        ends = [tree.joints[name] for name in joints]
        self._memory = StopMemory([(joint.lower, joint.upper) for joint in ends])
        inertias = [_carried(tree, joint) for joint in ends]
        self._stiffness = [STOP_RATE**2 * inertia for inertia in inertias]
        self._damping = [2.0 * STOP_RATE * inertia for inertia in inertias]

    def restart(self, q: Sequence[float]) -> None:
        """The model was put at q from outside: decide again which stops act."""
        self._memory.restart(q)

    def add(self, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> list[float]:
        """Efforts tau with those of the stops at q, dq added [N m or N]."""
        memory, total = self._memory, list(tau)
        if memory.waiting:
            memory.check(q)
        for i, (x, (low, high)) in enumerate(zip(q, memory.limits, strict=True)):
            if low <= x <= high:
                continue
            below, above = memory.waiting.get(i, (False, False))
            if x < low and not below:
                total[i] += max(self._stiffness[i] * (low - x) - self._damping[i] * dq[i], 0.0)
            elif x > high and not above:
                total[i] += min(self._stiffness[i] * (high - x) - self._damping[i] * dq[i], 0.0)
        return total


def _carried(tree: Robot, joint: Joint) -> float:
    """Inertia of all that hangs on a joint, about its axis [kg m^2]; mass, if it slides [kg]."""
    whole = tree.links[joint.child].mass or MassProperties()
    for further, T_joint_link in tree.beyond(joint.child):
        mass = tree.links[further.child].mass
        if mass is not None:
            whole = whole + mass.moved(T_joint_link)
    if joint.type == "prismatic":
        return whole.mass
    lever = np.cross(joint.axis, whole.com)
    return float(joint.axis @ whole.inertia @ joint.axis + whole.mass * (lever @ lever))
