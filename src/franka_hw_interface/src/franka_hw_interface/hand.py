"""Interface of a Franka hand, emulated or real: non-blocking requests and their outcomes."""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol


class HandOutcome(Enum):
    """Outcome of a request to the hand."""

    SUCCESS = "success"
    UNSUCCESSFUL = "unsuccessful"
    """Executed without reaching its goal: libfranka's call returns false."""
    FAIL = "command failed"
    """Refused: libfranka's call raises."""
    ABORTED = "command aborted"
    """Ended by another request: libfranka's call raises."""


@dataclass(slots=True, eq=False)
class HandMotion:
    """Request to the hand and its outcome.

    Attributes:
        name: "homing", "move", "grasp" or "stop".
        outcome: None while it runs.
        reason: cause of a failure; empty on success.
    """

    name: str
    outcome: HandOutcome | None = None
    reason: str = ""

    def end(self, outcome: HandOutcome, reason: str = "") -> None:
        """Set the outcome; the reason is set first, so that a reader of the outcome also sees the reason."""
        self.reason = reason
        self.outcome = outcome


class FrankaHand(Protocol):
    """Interface of a Franka hand. A new request aborts the previous one. Speeds are rates of the opening [m/s].

    Attributes:
        width: opening between the fingers [m].
    """

    width: float

    @property
    def max_width(self) -> float:
        """Maximum opening [m]."""

    def homing(self) -> HandMotion:
        """Find the maximum opening."""

    def move(self, width: float, speed: float) -> HandMotion:
        """Move to an opening [m] at a speed [m/s]."""

    def grasp(self, width: float, epsilon_inner: float, epsilon_outer: float, speed: float, force: float) -> HandMotion:
        """Grasp an object of a width [m] with a force [N]; epsilon: tolerances for narrower and wider objects [m]."""

    def stop(self) -> HandMotion:
        """End any motion or grasp."""

    def advance(self, time: float) -> None:
        """Advance an emulated hand to robot time [s]; called repeatedly, without effect on a real hand."""
