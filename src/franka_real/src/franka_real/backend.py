"""The two ways into libfranka behind one face: the Panda's control callbacks and the FR3's read/write loop."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.command_set import ArmCommand
from franka_hw_interface.modes import Mode
from hric_control.errors import HricError


class RobotError(HricError):
    """The arm ended or refused a motion, or refused a setting; it is still there. The message is libfranka's."""


class ConnectionLostError(HricError):
    """The arm does not answer any more."""


@dataclass(frozen=True)
class ControlSettings:
    """How libfranka's loops are run.

    Attributes:
        rate_limiting: keep commands within libfranka's limits of rate.
        cutoff_frequency: of the low-pass on commands [Hz]; 1000 or more: none.
        cartesian_impedance: internal controller of motion generators; False: joint impedance.
        enforce_realtime: refuse a kernel that is not a real-time one.
    """

    rate_limiting: bool
    cutoff_frequency: float
    cartesian_impedance: bool
    enforce_realtime: bool


Cycle = Callable[[Any], ArmCommand]
"""libfranka's state -> command; called each millisecond while a motion runs. What it raises ends the motion and reaches the caller of `control`."""


class Backend(ABC):
    """libfranka's Robot. All calls come from the control loop's thread, and block it, with the interpreter's lock held, until the arm has answered.

    Attributes:
        address: of the arm.
        settings: of the loops.
    """

    name: str = ""

    def __init__(self, address: str, settings: ControlSettings) -> None:
        self.address, self.settings = address, settings

    @abstractmethod
    def read_once(self) -> Any:
        """The newest state, waiting for it [ConnectionLostError]."""

    @abstractmethod
    def milliseconds(self, raw: Any) -> int:
        """The arm's own time of a state [ms]."""

    @abstractmethod
    def check(self, mode: Mode) -> None:
        """Refuse a mode that this arm does not have. Raises HricError."""

    @abstractmethod
    def control(self, mode: Mode, cycle: Cycle) -> None:
        """Run a motion until a command is `finished`.

        Raises:
            RobotError: the arm refused or ended it.
            ConnectionLostError: the arm is gone.
        """

    @abstractmethod
    def set_load(self, mass: float, com: list[float], inertia: list[float]) -> None:
        """Raises RobotError, as the setters below."""

    @abstractmethod
    def set_EE_frame(self, NE_T_EE: list[float]) -> None:
        """Raises RobotError."""

    @abstractmethod
    def set_K_frame(self, EE_T_K: list[float]) -> None:
        """Raises RobotError."""

    @abstractmethod
    def set_joint_impedance(self, stiffness: list[float]) -> None:
        """Raises RobotError."""

    @abstractmethod
    def set_cartesian_impedance(self, stiffness: list[float]) -> None:
        """Raises RobotError."""

    @abstractmethod
    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Raises RobotError."""

    @abstractmethod
    def recover(self) -> None:
        """Automatic error recovery; may take seconds. Raises RobotError."""

    @abstractmethod
    def load_model(self) -> Any:
        """libfranka's model of the arm. Raises RobotError."""

    @abstractmethod
    def close(self) -> None:
        """End the connection."""


def clean(error: BaseException) -> str:
    """libfranka's text in one line, without its prefix."""
    return re.sub(r"\s*\n\s*", "; ", str(error).strip()).removeprefix("libfranka: ")
