"""What a joint command means, and what a plant offers for it."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Protocol, runtime_checkable


class Mode(Enum):
    """What the value given to a joint means."""

    EFFORT = "effort"
    VELOCITY = "velocity"
    POSITION = "position"
    BRAKE = "brake"


@runtime_checkable
class DrivenPlant(Protocol):
    """A plant whose joints have stiff drives of their own, beside efforts."""

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """What `apply` means for each joint from now on."""
