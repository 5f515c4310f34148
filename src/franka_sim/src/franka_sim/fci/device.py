"""Robots that the network server can serve: their common type, and the simplest, whose state is constant.

All calls come from the server's thread; requests come between two cycles. `state` is one object that is updated."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

from franka_hw_interface.robot_state import RobotMode, RobotState
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest, RequestOutcome
from franka_sim.fci.wire import StateCodec
from franka_sim.gripper import Gripper
from hric_core.errors import CommandError

if TYPE_CHECKING:
    from franka_sim.fci.arm_device import ArmDevice

Floats = Sequence[float]
Device: TypeAlias = "ArmDevice | ConstantDevice"


class DeviceState(RobotState):
    """Robot state with controller mode and motion generator mode, as sent to the client."""

    __slots__ = ("controller_mode", "generator_mode")

    def __init__(self) -> None:
        super().__init__()
        self.controller_mode, self.generator_mode = ControllerMode.OTHER, GeneratorMode.IDLE


def _accept(*_: object) -> RequestOutcome:
    return RequestOutcome.SUCCESS


class ConstantDevice:
    """Robot that responds correctly and never moves, to measure the cost of the server alone.

    The setters accept everything; their arguments are those of `box.control_box.ControlBox`.

    Args:
        urdf_xml: robot description for clients that request it.
        hand: emulated hand; None: no hand.
    """

    model_library = None

    def __init__(self, urdf_xml: str = "", hand: Gripper | None = None) -> None:
        self.state, self.hand, self._urdf = DeviceState(), hand, urdf_xml
        self.state.q[:] = self.state.q_d[:] = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
        self.state.O_ddP_O[:] = [0.0, 0.0, -9.81]
        self.state.elbow[:] = self.state.elbow_d[:] = self.state.elbow_c[:] = [0.0, -1.0]
        self._finished: RequestOutcome | None = None
        self._end()

    def _end(self) -> None:
        state = self.state
        state.robot_mode, state.controller_mode, state.generator_mode = (
            RobotMode.IDLE,
            ControllerMode.OTHER,
            GeneratorMode.IDLE,
        )
        state.control_command_success_rate = 0.0

    def cycle(self, command: MotionCommand | None) -> None:
        """Advance robot time by 1 ms; a motion ends with the client's last command."""
        self.state.time += 1e-3
        if command is not None and command.finished and self.state.moving:
            self._end()
            self._finished = RequestOutcome.SUCCESS

    def encode(self, codec: StateCodec, message_id: int) -> bytes:
        """Return the robot state as a datagram of the codec's protocol."""
        return codec.encode(message_id, self.state)

    def take_finished(self) -> RequestOutcome | None:
        """Return the outcome of a motion that ended since the last call, or None."""
        finished, self._finished = self._finished, None
        return finished

    def connection_lost(self) -> None:
        """Return to idle mode after the client's connection ended."""
        self._end()
        self._finished = None

    def urdf(self) -> str:
        """Return the robot description for clients."""
        return self._urdf

    def move(self, request: MoveRequest) -> RequestOutcome:
        """Start a motion, in which the robot does not move; NOT_POSSIBLE if one runs."""
        state = self.state
        if not state.idle:
            return RequestOutcome.NOT_POSSIBLE
        state.robot_mode, state.controller_mode, state.generator_mode = (
            RobotMode.MOVE,
            request.controller,
            request.generator,
        )
        state.control_command_success_rate = 1.0
        return RequestOutcome.STARTED

    def stop_move(self) -> RequestOutcome:
        """End the motion as preempted, if one runs."""
        if self.state.moving:
            self._end()
            self._finished = RequestOutcome.PREEMPTED
        return RequestOutcome.SUCCESS

    def recover(self) -> RequestOutcome:
        """Return SUCCESS: there are no errors to recover from."""
        return RequestOutcome.SUCCESS

    def reset(self) -> None:
        """Do nothing: the robot never moves."""

    def push(self, link: str, force: Floats, duration: float) -> None:
        """Raise a CommandError: the robot never moves."""
        raise CommandError("push refused: this robot has a constant state (--constant) and no physics")

    set_user_stop = set_guiding = staticmethod(_accept)
    set_collision_behavior = set_joint_impedance = set_cartesian_impedance = set_guiding_mode = staticmethod(_accept)
    set_EE_T_K = set_NE_T_EE = set_load = set_filters = staticmethod(_accept)
