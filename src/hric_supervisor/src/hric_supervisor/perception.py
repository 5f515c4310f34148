"""Validity checks of the data about persons and arm; invalid data is reported as a fault and stops the arm.

A person's data is invalid after a jump or a change of size, if two bodies are mixed, or if the tracker is frozen. Such
a fault ends when the data has been valid for the time `person_hold`.
"""

from collections.abc import Collection, Sequence

import numpy as np

from hric_core.geometry import FloatArray
from hric_supervisor.arm import ArmState
from hric_supervisor.person import Observation
from hric_supervisor.settings import HUMAN, SupervisorSettings

AHEAD = 0.02
"""Maximum lead of a stamp over the clock [s]; clock messages are 10 ms apart (project default, unconfirmed)."""
PAUSE = 1.0
"""Maximum time between two decisions [s]; after a longer one the clock has jumped (project default, unconfirmed)."""
ARM = "the arm"
SAME_SIZE = 1e-3
"""Maximum change of a capsule's length or radius that counts as rounding [m] (project default, unconfirmed)."""


class PersonValidator:
    """Validity check of one person's observations, each against the previous one.

    After a gap the person may be elsewhere: a point may have moved by `person_max_speed` times the duration of the gap,
    plus `person_uncertainty` for noise. A measured pose that repeats bit for bit counts as old as its first occurrence,
    since cameras have noise and only a frozen tracker repeats a pose. A simulated person may truly stand still.

    Args:
        name: name of the person, for the faults' texts.
        measured: False for the simulated human in the robot's plant.
        settings: parameters of the supervisor.
    """

    def __init__(self, name: str, measured: bool, settings: SupervisorSettings) -> None:
        self._name, self._measured, self._settings = name, measured, settings
        self.reset()

    def reset(self) -> None:
        """Forget all observations and faults, after a jump of the clock."""
        self._last: Observation | None = None
        self._changed_at = -np.inf
        self._fault, self._until = "", -np.inf

    def fault(self, now: float, newest: Observation, late: bool) -> str:
        """Return the fault of the person's data as text; empty: the data is valid.

        Args:
            now: robot time [s].
            newest: newest observation, with those since the last call in `earlier`.
            late: True if the observation's stamp is invalid or too old.
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
        """Return the reason why an observation cannot follow the last one; empty: it can."""
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
        settings = self._settings
        if distance[at] > settings.person_max_speed * max(gap, 0.0) + settings.person_uncertainty:
            return (
                f"jumped: {observation.links[at]} by {distance[at]:.2f} m within {gap:.3f} s; valid: "
                f"{settings.person_max_speed:g} m/s and {settings.person_uncertainty:g} m"
            )
        if distance[at] > 0.0 or not self._measured:
            self._changed_at = observation.stamp
        if (age := observation.stamp - self._changed_at) > settings.max_age:
            return f"is frozen: exactly the same pose for {age:.3f} s, as from a tracker that hangs"
        return ""


def _sizes(observation: Observation) -> FloatArray:
    """Return lengths and radii of a person's m capsules, shape (2 m,) [m]."""
    lengths = np.linalg.norm(observation.ends[:, 1] - observation.ends[:, 0], axis=1)
    return np.concatenate([lengths, observation.radii])


class Watch:
    """Validity checks of the data of arm and persons before each decision.

    Args:
        settings: parameters of the supervisor.
        frames: frames in which persons may be observed.
    """

    def __init__(self, settings: SupervisorSettings, frames: Collection[str]) -> None:
        self._frames, self._max_age = frames, settings.max_age
        self._now: float | None = None
        self._names = [name for name, _ in settings.persons]
        self._validators = [PersonValidator(name, source != HUMAN, settings) for name, source in settings.persons]
        self._stamps = dict.fromkeys([ARM, *self._names], -np.inf)

    def fault(self, now: float, arm: ArmState | None, persons: Sequence[Observation | None]) -> str:
        """Return the reason why no decision is possible at robot time `now` [s]; empty: it is possible."""
        jumped = self._jumped(now)
        of_persons = [
            self._of_person(now, name, validator, person)
            for name, validator, person in zip(self._names, self._validators, persons, strict=True)
        ]
        return next((text for text in (jumped, *of_persons, self._of_arm(now, arm)) if text), "")

    def _jumped(self, now: float) -> str:
        before, self._now = self._now, now
        if before is None or 0.0 <= now - before <= PAUSE:
            return ""
        self._stamps = dict.fromkeys(self._stamps, -np.inf)
        for validator in self._validators:
            validator.reset()
        return f"the clock jumped by {now - before:+.3f} s"

    def _of_person(self, now: float, name: str, validator: PersonValidator, person: Observation | None) -> str:
        if person is None:
            return f"no pose of {name.replace('the ', 'a ', 1)} has been received"
        if person.frame not in self._frames:
            return f"the pose of {name} is given in frame {person.frame!r}; valid: {', '.join(self._frames)}"
        bad = ~np.isfinite(person.ends).all(axis=(1, 2))
        if bad.any():
            return f"the pose of {name} is not finite: link {person.links[int(np.argmax(bad))]}"
        late = self._in_time(name, now, person.stamp)
        return validator.fault(now, person, bool(late)) or late

    def _of_arm(self, now: float, arm: ArmState | None) -> str:
        if arm is None:
            return "no state of the arm has been received"
        if arm.fault:
            return f"{ARM} {arm.fault}"
        if not (np.isfinite(arm.q).all() and np.isfinite(arm.dq).all()):
            return "the state of the arm is not finite"
        return self._in_time(ARM, now, arm.stamp)

    def _in_time(self, what: str, now: float, stamp: float) -> str:
        before, self._stamps[what] = self._stamps[what], stamp
        if not np.isfinite(stamp):
            return f"the stamp of {what} is not finite"
        if stamp < before:
            return f"the clock of {what} jumped back by {before - stamp:.3f} s"
        if stamp > now + AHEAD:
            return f"the clock of {what} is ahead by {stamp - now:.3f} s"
        if now - stamp > self._max_age:
            return f"the data of {what} is stale: {now - stamp:.3f} s old, valid: {self._max_age:g} s"
        return ""
