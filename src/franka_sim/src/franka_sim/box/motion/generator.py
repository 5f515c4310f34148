"""Base class of the motion generators, which turn a client's commands into the desired joint motion."""

from abc import ABC, abstractmethod

from franka_hw_interface.robot_state import Errors, RobotState
from franka_sim.box.requests import MotionCommand

UNFINISHED = "the last command of the motion must bring it to rest within one step; it is too fast for that"
"""Reason for the refusal of a motion's last command."""


class MotionGenerator(ABC):
    """Generator of the desired motion from one command per millisecond.

    The box calls `start` once and then `advance` once per millisecond, in its own thread; neither blocks. `q_d`, `dq_d`
    and `ddq_d` of the state are written in place. The Cartesian fields (`O_T_EE_d`, `O_T_EE_c`, `O_dP_EE_d`,
    `O_dP_EE_c`, `O_ddP_EE_c`, `elbow_d`, `elbow_c`, `delbow_c`, `ddelbow_c`) are assigned by Cartesian generators only.
    The client's filters start from these fields, so they must stay until the next `advance`: a state that computes them
    on demand must not do so while a Cartesian generator runs.

    Attributes:
        reason: explanation of the last refusal with the exceeded limit; empty if the errors' names are enough, and
            after `start`.
    """

    reason: str = ""

    @abstractmethod
    def start(self, state: RobotState) -> Errors:
        """Start at rest at the state's q_d; return the errors that prevent a start, by libfranka's names.

        The generator keeps the state object and writes the desired motion into it from then on.
        """

    @abstractmethod
    def advance(self, command: MotionCommand | None) -> Errors:
        """Check a command and advance the desired motion by one millisecond.

        Args:
            command: command of the client; None if the packet was lost: the motion then continues with constant
                acceleration, as on the arm.

        Returns:
            Violated limits, by libfranka's names. In that case the state is unchanged, and the generator cannot be used
            until the next `start`.
        """

    def is_singular(self, state: RobotState) -> bool:
        """Return True if the motion would start at q_d in a pose that its kinematics cannot leave."""
        return False
