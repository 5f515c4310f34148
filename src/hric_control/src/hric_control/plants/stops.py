"""Joint stops: which of them act, and the stop law of spawned models.

A stop acts only once the joint has been inside its range: a start outside, as the thesis has at q = 0, leaves it open
until then. The engine implements the robot's stops; those of other models are a spring and a damper, alike in all
engines.
"""

import math
from collections.abc import Callable, Iterable, Sequence


class StopMemory:
    """Memory of the stops that are still open.

    Args:
        limits: (lower, upper) per joint [rad or m], infinite if there is no stop.

    Attributes:
        waiting: for each joint that started outside, by its index: (is below, is above); that stop is open.
    """

    def __init__(self, limits: Sequence[tuple[float, float]]) -> None:
        self.limits = list(limits)
        self.waiting: dict[int, tuple[bool, bool]] = {}

    def restart(self, q: Sequence[float]) -> set[int]:
        """Decide again which stops act, with the robot put at q. Return the joints whose stops may have changed."""
        before = set(self.waiting)
        self.waiting = {
            i: (x < low, x > high)
            for i, (x, (low, high)) in enumerate(zip(q, self.limits, strict=True))
            if not low <= x <= high
        }
        return before | set(self.waiting)

    def check(self, q: Sequence[float]) -> list[int]:
        """Close an open stop once its joint is inside the range. Return the joints whose stops act from now on."""
        inside = [i for i in self.waiting if self.limits[i][0] <= q[i] <= self.limits[i][1]]
        for i in inside:
            del self.waiting[i]
        return inside


STOP_RATE = 2.0 * math.pi * 50.0
"""Natural frequency of a joint on its stop, critically damped [rad/s] (project default, unconfirmed).

A third of a radian per step of 1 ms, so that a force held over the step causes no oscillation."""


_STUCK = 1e-12
"""Mobility below which a joint moves only by rounding [1/(kg m^2) or 1/kg] (project default, unconfirmed).

An example is a joint that mimics another with a multiplier of 0."""


def reciprocals(mobilities: Iterable[float]) -> list[float]:
    """Return the inertias of joints from their mobilities [1/(kg m^2) or 1/kg]; 0 for a joint that cannot move."""
    return [1.0 / float(mobility) if mobility > _STUCK else 0.0 for mobility in mobilities]


class StopLaw:
    """Stops of a spawned model's joints: k (limit - q) - c dq beyond the limit, never pulling outwards.

    k and c follow from STOP_RATE and the inertia at the stop, that of the joint while all others are free: in a light
    wrist a quarter of what hangs on the joint, in a shoulder near its singular pose a thousandth, so that a force from
    the inertia of all that hangs there would throw the arm.

    Args:
        limits: (lower, upper) per joint [rad or m], in the order of all vectors here.
        inertias: function that returns the current 1 / (M^-1)_ii of each joint, M of the whole model [kg m^2 or kg], 0
            for a joint that cannot move; needed while a stop acts.
    """

    def __init__(self, limits: Sequence[tuple[float, float]], inertias: Callable[[], Sequence[float]]) -> None:
        self._memory, self._inertias = StopMemory(limits), inertias

    def restart(self, q: Sequence[float]) -> None:
        """Decide again which stops act, after the model was put at q."""
        self._memory.restart(q)

    def add(self, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> list[float]:
        """Return efforts tau with those of the stops at q, dq added [N m or N]."""
        if self._memory.waiting:
            self._memory.check(q)
        efforts, pushes = list(tau), self._pushes(q, dq)
        if pushes:
            inertias = self._inertias()
            for i, push in pushes.items():
                efforts[i] += inertias[i] * push
        return efforts

    def _pushes(self, q: Sequence[float], dq: Sequence[float]) -> dict[int, float]:
        """Return the acceleration that its stop alone gives each joint, by joint index [rad/s^2 or m/s^2]."""
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
