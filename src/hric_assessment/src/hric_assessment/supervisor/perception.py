"""Validity checks of the inputs about persons and arm; an invalid input is named and stops the arm."""

from collections.abc import Collection, Sequence

import numpy as np

from hric_assessment.supervisor.arm import ArmState
from hric_assessment.supervisor.person import Observation
from hric_assessment.supervisor.settings import HUMAN, SupervisorSettings
from hric_assessment.supervisor.validity import PersonValidator

AHEAD = 0.02
"""Largest lead of a stamp over the clock [s]: clock messages are 10 ms apart (project default, unconfirmed)."""
PAUSE = 1.0
"""Longest time between two decisions; a longer one means that the clock jumped [s] (project default, unconfirmed)."""
ARM = "the arm"


class Watch:
    """Checks of the inputs before each decision.

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
        """Return why no decision is possible at robot time `now` [s], or an empty text."""
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
            return f"no pose of {name.replace('the ', 'a ', 1)} has come"
        if person.frame not in self._frames:
            return f"{name} is in frame {person.frame!r}; valid: {', '.join(self._frames)}"
        bad = ~np.isfinite(person.ends).all(axis=(1, 2))
        if bad.any():
            return f"the pose of {name} is not finite: {person.links[int(np.argmax(bad))]}"
        late = self._in_time(name, now, person.stamp)
        return validator.fault(now, person, bool(late)) or late

    def _of_arm(self, now: float, arm: ArmState | None) -> str:
        if arm is None:
            return "no state of the arm has come"
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
            return f"what is known of {what} is stale: {now - stamp:.3f} s old, valid: {self._max_age:g} s"
        return ""
