"""What the simulated and the real arm have in common as a RobotHW: who commands it, how that changes, and the error
state."""

from collections.abc import Sequence

from franka_hw_interface.command_set import CommandSet
from franka_hw_interface.interfaces import FrankaModelInterface, FrankaStateInterface
from franka_hw_interface.model import FrankaModel
from franka_hw_interface.modes import HOLD, Mode, check_one_commander, claimed_modes
from franka_hw_interface.robot_state import RobotState
from hric_control import realtime
from hric_control.errors import HricError
from hric_control.hardware_interface import JointStateInterface, JointStates
from hric_control.limits import LimitCounts
from hric_control.node import Node
from hric_control.robot_hw import ControllerInfo, LogRow, RobotHW


class CommandedArm(RobotHW):
    """Base of the Franka arms. The subclass sets the attributes, calls `_register`, and enters and leaves the
    `_requested` mode in its `run`.

    When the arm ends a motion by itself (a reflex, a command that it refuses), it is in the error state: controllers go
    on being updated, their commands go nowhere, and none that commands can be started. After its recovery the motion
    begins again, and the controllers are restarted.

    Attributes:
        arm_id: prefix of joints and links.
        states: measured joint states.
        robot_state: the Franka state.
        mode: what the arm is commanded by now.
        error: why the last motion ended, until the recovery; empty otherwise.
    """

    compensates_gravity = True

    arm_id: str
    states: JointStates
    robot_state: RobotState
    mode: Mode
    error: str
    _node: Node
    _commands: CommandSet
    _requested: Mode

    @property
    def _running(self) -> bool:
        """Whether `run` drives the arm."""
        raise NotImplementedError

    def _check_mode(self, mode: Mode) -> None:
        """Refuse a mode that this arm does not have [HricError]."""

    def _register(self, model: FrankaModel) -> None:
        self.register_interface(JointStateInterface(self.states))
        self.register_interface(FrankaStateInterface(self.arm_id, self.robot_state))
        self.register_interface(FrankaModelInterface(self.arm_id, model, self.robot_state))
        for interface in self._commands.interfaces():
            self.register_interface(interface)

    def _claimed(self, controllers: Sequence[ControllerInfo]) -> list[Mode]:
        return claimed_modes(controllers, self.arm_id, self.states.names)

    def check_for_conflict(self, controllers: Sequence[ControllerInfo]) -> None:
        """One commander at a time, and it claims the whole arm."""
        super().check_for_conflict(controllers)
        check_one_commander(controllers, self.arm_id, self.states.names)

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """The same for what is to be started; and the arm must be able to move."""
        check_one_commander(start, self.arm_id, self.states.names)
        for mode in self._claimed(start):
            self._check_mode(mode)
            self._refuse_in_error()

    def _refuse_in_error(self) -> None:
        if self.error:
            raise HricError(f"the arm is in the error state, franka_control/error_recovery ends it: {self.error}")

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Remember the mode; `run` enters it. Controllers of the same mode follow each other without leaving it."""
        claimed = self._claimed(start)
        if claimed:
            if claimed[0] != self._requested:  # else the object stays, so that the loop may compare by identity
                self._requested = claimed[0]
        elif self._claimed(stop):
            self._requested = HOLD

    def switch_done(self, start: Sequence[ControllerInfo]) -> bool:
        """Whether the arm takes the commands of these controllers. Before `run` there is nothing to wait for."""
        claimed = self._claimed(start)
        if not claimed or not self._running:
            return True
        self._refuse_in_error()
        return self.mode == claimed[0]

    def _fail(self, text: str) -> None:
        """Enter the error state; in the loop, so that the log is written outside of it."""
        self.error = text
        message = f"{text} -- the arm is in the error state; franka_control/error_recovery ends it"
        realtime.defer(self._node, lambda: self._node.log_error(message), "log")

    def limiter_counts(self) -> LimitCounts:
        """What the joint limits did since the start, over all interfaces."""
        return self._commands.counts

    def log_row(self) -> LogRow:
        """The commands of the last cycle."""
        return self._commands.row
