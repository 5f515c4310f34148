"""The Franka hand as the gripper's actions see it: requests that return at once, and how they ended. Emulated or
real."""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol


class HandOutcome(Enum):
    """How a request to the hand ended."""

    SUCCESS = "success"
    UNSUCCESSFUL = "unsuccessful"
    """It was carried out but missed its aim: libfranka's call returns false."""
    FAIL = "command failed"
    """It was refused: libfranka's call raises."""
    ABORTED = "command aborted"
    """Another request ended it: libfranka's call raises."""


@dataclass(slots=True, eq=False)
class HandMotion:
    """One request and how it ended.

    Attributes:
        name: "homing", "move", "grasp" or "stop".
        outcome: None while it runs.
        reason: why it did not succeed; empty on success.
    """

    name: str
    outcome: HandOutcome | None = None
    reason: str = ""

    def end(self, outcome: HandOutcome, reason: str = "") -> None:
        """Set the outcome; the reason goes first, so that who sees the one sees the other."""
        self.reason = reason
        self.outcome = outcome


class Hand(Protocol):
    """A hand. A new request ends the one before, which is then aborted. Speeds are rates of the opening [m/s].

    Attributes:
        width: opening between the fingers [m].
    """

    width: float

    @property
    def max_width(self) -> float:
        """Largest opening [m]."""

    def homing(self) -> HandMotion:
        """Find the largest opening."""

    def move(self, width: float, speed: float) -> HandMotion:
        """Go to an opening [m]."""

    def grasp(self, width: float, epsilon_inner: float, epsilon_outer: float, speed: float, force: float) -> HandMotion:
        """Grasp something of a width [m], at most so much narrower and wider [m], with a force [N]."""

    def stop(self) -> HandMotion:
        """End what runs or holds."""

    def advance(self, time: float) -> None:
        """Called again and again with robot time [s]: an emulated hand goes on to it, a real one goes by itself."""
