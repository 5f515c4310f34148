"""Whether what is known of person and arm can be trusted: what cannot is named, and stops the arm."""

import numpy as np

from hric_assessment.supervisor.arm import ArmState
from hric_assessment.supervisor.person import Observation

AHEAD = 0.02
"""By which a stamp may be ahead of the clock [s]: a clock is known by messages 10 ms apart. The constants of this file
are chosen here."""
PAUSE = 1.0
"""Longest time between two decisions; beyond it the clock has jumped [s]."""


class Watch:
    """Looks at each decision's inputs.

    Args:
        frame: in which the person must be.
        max_age: of both [s].
    """

    def __init__(self, frame: str, max_age: float) -> None:
        self._frame, self._max_age = frame, max_age
        self._now: float | None = None
        self._stamps = {"the person": -np.inf, "the arm": -np.inf}

    def fault(self, now: float, arm: ArmState | None, person: Observation | None) -> str:
        """Why nothing can be decided at robot time `now` [s]; empty: nothing is wrong."""
        jumped = self._jumped(now)
        found = [jumped, self._of_person(now, person), self._of_arm(now, arm)]
        return next((text for text in found if text), "")

    def _jumped(self, now: float) -> str:
        before, self._now = self._now, now
        if before is None or 0.0 <= now - before <= PAUSE:
            return ""
        self._stamps = dict.fromkeys(self._stamps, -np.inf)
        return f"the clock jumped by {now - before:+.3f} s"

    def _of_person(self, now: float, person: Observation | None) -> str:
        if person is None:
            return "no pose of a person has come"
        if person.frame != self._frame:
            return f"the person is in frame {person.frame!r}; valid: {self._frame}"
        bad = ~np.isfinite(person.ends).all(axis=(1, 2))
        if bad.any():
            return f"the pose of the person is not finite: {person.links[int(np.argmax(bad))]}"
        return self._in_time("the person", now, person.stamp)

    def _of_arm(self, now: float, arm: ArmState | None) -> str:
        if arm is None:
            return "no state of the arm has come"
        if not (np.isfinite(arm.q).all() and np.isfinite(arm.dq).all()):
            return "the state of the arm is not finite"
        return self._in_time("the arm", now, arm.stamp)

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
