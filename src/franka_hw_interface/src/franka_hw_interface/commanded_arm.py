"""Base class of the simulated and the real Franka arm as a RobotHW: command modes, switching, error state."""

from collections.abc import Sequence

from franka_hw_interface.arm_services import ArmServices, ServedArm
from franka_hw_interface.command_set import CommandSet
from franka_hw_interface.interfaces import FrankaModelInterface, FrankaStateInterface
from franka_hw_interface.model import FrankaModel
from franka_hw_interface.modes import HOLD, ArmMode, check_one_commander, claimed_modes
from franka_hw_interface.robot_state import RobotState
from hric_control.hardware_interface import (
    ForceTorqueSensorHandle,
    ForceTorqueSensorInterface,
    JointStateInterface,
    JointStates,
)
from hric_control.limits import LimitCounts
from hric_control.robot_hw import ControllerInfo, LogRow, RobotHW
from hric_core import realtime
from hric_core.errors import HricError
from hric_core.node import Node


class CommandedArm(RobotHW):
    """Base of the simulated and the real Franka arm.

    The subclass sets the attributes, calls `_register`, and enters and leaves the `_requested` mode in its `run`.

    If the arm ends a motion by itself (a reflex, a refused command), it enters the error state: controllers are still
    updated, but without effect, and no controller that commands the arm can be started. After an error recovery the
    motion starts again, and the controllers are restarted.

    Attributes:
        arm_id: prefix of joints and links.
        states: measured joint states.
        robot_state: Franka state of the arm.
        mode: present command mode of the arm.
        error: reason of the error state; empty if there is no error.
    """

    compensates_gravity = True

    arm_id: str
    states: JointStates
    robot_state: RobotState
    mode: ArmMode
    error: str
    _node: Node
    _commands: CommandSet
    _requested: ArmMode
    _early = False
    """True if controllers were started between two runs, before their motion begins."""
    _services: ArmServices

    @property
    def _running(self) -> bool:
        """True while `run` drives the arm."""
        raise NotImplementedError

    def _check_mode(self, mode: ArmMode) -> None:
        """Raise a HricError if this arm does not have the command mode."""

    def _register(self, model: FrankaModel) -> None:
        self.register_interface(JointStateInterface(self.states))
        self.register_interface(FrankaStateInterface(self.arm_id, self.robot_state))
        self.register_interface(FrankaModelInterface(self.arm_id, model, self.robot_state))
        state = self.robot_state
        sensor = ForceTorqueSensorHandle(f"{self.arm_id}_K", f"{self.arm_id}_K", lambda: state.K_F_ext_hat_K)
        self.register_interface(ForceTorqueSensorInterface([sensor]))
        for interface in self._commands.interfaces():
            self.register_interface(interface)

    def _serve(self, arm: ServedArm, root_node: Node) -> None:
        self._services = ArmServices(arm, root_node)

    def _claimed(self, controllers: Sequence[ControllerInfo]) -> list[ArmMode]:
        return claimed_modes(controllers, self.arm_id, self.states.names)

    def check_for_conflict(self, controllers: Sequence[ControllerInfo]) -> None:
        """Raise an error if two controllers would command the arm at once, or one claims only some of the joints."""
        super().check_for_conflict(controllers)
        check_one_commander(controllers, self.arm_id, self.states.names)

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Check the controllers to be started: raise an error for a conflict, or if the arm is in the error state."""
        check_one_commander(start, self.arm_id, self.states.names)
        for mode in self._claimed(start):
            self._check_mode(mode)
            self._refuse_in_error()

    def _refuse_in_error(self) -> None:
        if self.error:
            raise HricError(
                "the arm is in the error state; send a goal to the action franka_control/error_recovery to end it. "
                f"Reason: {self.error}"
            )

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Request the command mode of the started controllers, which `run` enters; keep the mode if it is the same."""
        self._early = not self._running
        claimed = self._claimed(start)
        if claimed:
            if claimed[0] != self._requested:  # otherwise keep the object: the loop compares by identity
                self._requested = claimed[0]
        elif self._claimed(stop):
            self._requested = HOLD

    def switch_done(self, start: Sequence[ControllerInfo]) -> bool:
        """Return True if the arm executes the commands of these controllers; before `run`, always True."""
        claimed = self._claimed(start)
        if not claimed or not self._running:
            return True
        self._refuse_in_error()
        return self.mode == claimed[0]

    def _fail(self, text: str) -> None:
        """Enter the error state; called in the loop, so the log is written outside of it."""
        self.error = text
        message = f"{text} -- the arm is in the error state until the action franka_control/error_recovery succeeds"
        realtime.defer(self._node, lambda: self._node.log_error(message), "log")

    def _refuse_recovery_in_motion(self) -> None:
        if self.mode.commanded:
            raise HricError("the arm is moving: there is nothing to recover from")

    def _warn(self, text: str) -> None:
        """Log a warning, outside of the loop."""
        realtime.defer(self._node, lambda: self._node.log_warn(text), "log")

    def limiter_counts(self) -> LimitCounts:
        """Return how often the joint limiters of all command interfaces have changed a command since the start."""
        return self._commands.counts

    def log_row(self) -> LogRow:
        """Return the last cycle's row of the control log: interface, command before the limits, command sent."""
        return self._commands.row
