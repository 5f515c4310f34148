"""Loads that joints carry, for plants that can tell them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable


@dataclass(frozen=True)
class JointReaction:
    """What the parent link does to the child link through a joint, its drive included.

    Attributes:
        joint: of the description.
        link: the child.
        position: origin of the child link, where the torque is meant, world frame, 3 floats [m].
        force, torque: on the child, world frame, 3 floats each [N], [N m].
    """

    joint: str
    link: str
    position: tuple[float, float, float]
    force: tuple[float, float, float]
    torque: tuple[float, float, float]


@runtime_checkable
class ReactingPlant(Protocol):
    """A plant that tells the loads in its joints."""

    def joint_reactions(self) -> list[JointReaction]:
        """Loads of the robot's moving joints in the last step; empty before the first."""
