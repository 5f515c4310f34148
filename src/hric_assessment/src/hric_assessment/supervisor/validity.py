"""Detection of impossible person data: a jump, a change of size, two bodies in one, a frozen tracker.

Each such fault stops the arm. It ends when the data was valid for `person_hold`.
"""

import numpy as np

from hric_assessment.supervisor.person import Observation
from hric_assessment.supervisor.settings import SupervisorSettings
from hric_core.geometry import FloatArray

SAME_SIZE = 1e-3
"""Largest change of a capsule's length or radius due to rounding [m] (project default, unconfirmed)."""


class PersonValidator:
    """Check of each observation of one person against the previous one.

    An unobserved person may reappear elsewhere: a gap allows `person_max_speed` times its duration, plus
    `person_uncertainty` for noise. A measured pose that repeats to the last bit is as old as its first occurrence:
    cameras have noise, and only a frozen tracker repeats a pose. A simulated person may truly stand still.

    Args:
        name: name of the person, for the texts.
        measured: False for the person in the robot's plant.
        settings: parameters of the supervisor.
    """

    def __init__(self, name: str, measured: bool, settings: SupervisorSettings) -> None:
        self._name, self._measured, self._settings = name, measured, settings
        self.reset()

    def reset(self) -> None:
        """Forget all observations, after a jump of the clock."""
        self._last: Observation | None = None
        self._changed_at = -np.inf
        self._fault, self._until = "", -np.inf

    def fault(self, now: float, newest: Observation, late: bool) -> str:
        """Return the fault of a person, or an empty text.

        Args:
            now: robot time [s].
            newest: newest observation, with the earlier ones since the last call.
            late: True if its stamp is not usable.
        """
        for observation in (*newest.earlier, newest):
            text = observation.fault or ("" if len(observation.ends) else "has no shape")
            if not (late or text) and observation is not self._last and np.isfinite(observation.ends).all():
                text, self._last = self._impossible(observation), observation
            if text:
                self._fault, self._until = f"{self._name} {text}", now + self._settings.person_hold
        if now < self._until:
            return f"{self._fault}; the arm waits for {self._settings.person_hold:g} s of valid data"
        return ""

    def _impossible(self, observation: Observation) -> str:
        """Return why a finite observation is impossible after the last one, or an empty text."""
        last = self._last
        if last is None:
            self._changed_at = observation.stamp
            return ""
        if last.links != observation.links:
            return f"has other links: {', '.join(last.links)} before, {', '.join(observation.links)} now"
        if (change := np.abs(_sizes(observation) - _sizes(last)).max()) > SAME_SIZE:
            return f"changed size: a length or radius by {change:.3f} m"
        distance = np.linalg.norm(observation.ends - last.ends, axis=2).max(axis=1)
        at, gap = int(np.argmax(distance)), observation.stamp - last.stamp
        own = self._settings
        if distance[at] > own.person_max_speed * max(gap, 0.0) + own.person_uncertainty:
            return (
                f"jumped: {observation.links[at]} by {distance[at]:.2f} m within {gap:.3f} s; valid: "
                f"{own.person_max_speed:g} m/s and {own.person_uncertainty:g} m"
            )
        if distance[at] > 0.0 or not self._measured:
            self._changed_at = observation.stamp
        if (age := observation.stamp - self._changed_at) > own.max_age:
            return f"is frozen: the same pose to the last bit for {age:.3f} s, as of a tracker that hangs"
        return ""


def _sizes(observation: Observation) -> FloatArray:
    """Return lengths and radii of the capsules, shape (2 m,) [m]."""
    lengths = np.linalg.norm(observation.ends[:, 1] - observation.ends[:, 0], axis=1)
    return np.concatenate([lengths, observation.radii])
