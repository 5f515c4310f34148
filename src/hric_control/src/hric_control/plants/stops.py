"""Joint stops: which of them are enabled, and the force law of the stops of spawned models.

A stop is enabled only once the joint has been inside its range. If a joint starts outside its range, as in the thesis
at q = 0, its stop is disabled until then. The engine implements the robot's stops; those of other models are a spring
and a damper, the same in all engines.
"""

import math
from collections.abc import Callable, Iterable, Sequence

from hric_core.native import vectors


class StopMemory:
    """Record of the joint stops that are still disabled, as their joint started outside its range.

    Args:
        limits: (lower, upper) per joint [rad or m], infinite if there is no stop.

    Attributes:
        waiting: (started below the range, started above it) by index of the joint; this stop is disabled.
    """

    def __init__(self, limits: Sequence[tuple[float, float]]) -> None:
        self.limits = list(limits)
        self.waiting: dict[int, tuple[bool, bool]] = {}

    def restart(self, q: Sequence[float]) -> set[int]:
        """Determine which stops are disabled, after the robot was set to the joint positions q [rad or m].

        Return the indices of the joints whose stops may have changed."""
        before = set(self.waiting)
        self.waiting = {
            i: (x < low, x > high)
            for i, (x, (low, high)) in enumerate(zip(q, self.limits, strict=True))
            if not low <= x <= high
        }
        return before | set(self.waiting)

    def check(self, q: Sequence[float]) -> list[int]:
        """Enable the stops of joints that are inside their range now; return the indices of these joints."""
        inside = [i for i in self.waiting if self.limits[i][0] <= q[i] <= self.limits[i][1]]
        for i in inside:
            del self.waiting[i]
        return inside


STOP_RATE = 2.0 * math.pi * 50.0
"""Natural frequency of a joint on its stop, which is critically damped [rad/s] (project default, unconfirmed).

It is a third of a radian per step of 1 ms, so that the force, which is constant during a step, causes no oscillation.
"""


_STUCK = 1e-12
"""Mobility (inverse inertia) up to which a joint counts as immovable [1/(kg m^2) or 1/kg].

An example is a joint that mimics another with a multiplier of 0. Project default, unconfirmed."""


def reciprocals(mobilities: Iterable[float]) -> list[float]:
    """Return the inertias of joints [kg m^2 or kg] from their mobilities (inverses); 0 for a joint that cannot move."""
    return [1.0 / float(mobility) if mobility > _STUCK else 0.0 for mobility in mobilities]


class StopLaw:
    """Stops of a spawned model's joints: effort k (limit - q) - c dq beyond the limit, never pulling outwards.

    Stiffness k and damping c follow from STOP_RATE and the effective inertia of the joint while all other joints are
    free. In a light wrist this is a quarter of the inertia of all links beyond the joint, in a shoulder near its
    singular pose a thousandth. So gains based on the inertia of all links beyond the joint would throw the arm.

    Args:
        limits: (lower, upper) per joint [rad or m]; vectors of this class have the same order.
        inertias: function that returns the effective inertia 1 / (M^-1)_ii of each joint, with the mass matrix M of the
            whole model [kg m^2 or kg], 0 for a joint that cannot move; called while a stop acts.

    Attributes:
        low, high: limits of the joints; within them no stop acts.
    """

    def __init__(self, limits: Sequence[tuple[float, float]], inertias: Callable[[], Sequence[float]]) -> None:
        self._memory, self._inertias = StopMemory(limits), inertias
        self.low, self.high = [low for low, _ in limits], [high for _, high in limits]

    @property
    def waiting(self) -> bool:
        """True if stops are disabled until their joints are inside their ranges."""
        return bool(self._memory.waiting)

    def restart(self, q: Sequence[float]) -> None:
        """Determine which stops are disabled, after the model was set to the joint positions q [rad or m]."""
        self._memory.restart(q)

    def add(self, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> list[float]:
        """Return the efforts tau plus the efforts of the stops at positions q and velocities dq [N m or N]."""
        if self._memory.waiting:
            self._memory.check(q)
        efforts = list(tau)
        if vectors.within(q, self.low, self.high):
            return efforts
        if pushes := self._pushes(q, dq):
            inertias = self._inertias()
            for i, push in pushes.items():
                efforts[i] += inertias[i] * push
        return efforts

    def _pushes(self, q: Sequence[float], dq: Sequence[float]) -> dict[int, float]:
        """Return the acceleration [rad/s^2 or m/s^2] that a joint gets from its stop, by index of the joint."""
        memory, pushes = self._memory, dict[int, float]()
        for i, (x, (low, high)) in enumerate(zip(q, memory.limits, strict=True)):
            if low <= x <= high:
                continue
            below, above = memory.waiting.get(i, (False, False))
            if x < low and not below:
                pushes[i] = max(STOP_RATE**2 * (low - x) - 2.0 * STOP_RATE * dq[i], 0.0)
            elif x > high and not above:
                pushes[i] = min(STOP_RATE**2 * (high - x) - 2.0 * STOP_RATE * dq[i], 0.0)
        return pushes
