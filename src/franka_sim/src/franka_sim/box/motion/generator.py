"""What every motion generator of the control box does."""

from abc import ABC, abstractmethod

from franka_hw_interface.robot_state import Errors, RobotState
from franka_sim.box.requests import MotionCommand

UNFINISHED = "the motion was finished where it is not at rest"
"""Reason of a refusal."""


class MotionGenerator(ABC):
    """Desired motion from one command per millisecond.

    The box calls `start` once and then `advance` once per millisecond, in its own thread; neither blocks. `q_d`, `dq_d`
    and `ddq_d` of the state are written in place. The Cartesian fields (`O_T_EE_d`, `O_T_EE_c`, `O_dP_EE_d`,
    `O_dP_EE_c`, `O_ddP_EE_c`, `elbow_d`, `elbow_c`, `delbow_c`, `ddelbow_c`) are assigned by Cartesian generators only.
    They are what the client's own filters start from and must stay until the next `advance`, so a state that computes
    them when they are read must not do so while a Cartesian generator runs.

    Attributes:
        reason: what `advance` refused and which limit it passed, in words; empty where the errors' names say it all,
            and after `start`.
    """

    reason: str = ""

    @abstractmethod
    def start(self, state: RobotState) -> Errors:
        """Take the state over and begin at rest at its q_d. Returns why the motion cannot begin there, by libfranka's
        names."""

    @abstractmethod
    def advance(self, command: MotionCommand | None) -> Errors:
        """One millisecond.

        Args:
            command: None if the packet was lost: the motion then goes on with constant acceleration, as on the arm.

        Returns:
            The limits that the command violates, by libfranka's names. The state then stays as it was, and the
            generator is of no use until the next `start`.
        """

    def is_singular(self, state: RobotState) -> bool:
        """Whether the motion would begin at q_d in a pose that its kinematics cannot leave."""
        return False
