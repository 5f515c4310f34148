"""What the server needs of a robot, and the simplest one: a robot whose state never changes."""

from collections.abc import Sequence
from typing import Protocol

from franka_hw_interface.robot_state import RobotMode, RobotState
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest, Outcome
from franka_sim.fci.hand_service import Hand
from franka_sim.fci.wire import StateCodec
from hric_control.errors import CommandError

Floats = Sequence[float]


class DeviceState(RobotState):
    """The state of the arm with its two modes, as it goes over the wire."""

    __slots__ = ("controller_mode", "generator_mode")

    def __init__(self) -> None:
        super().__init__()
        self.controller_mode, self.generator_mode = ControllerMode.OTHER, GeneratorMode.IDLE


class Device(Protocol):
    """Plant and control box behind the server. All calls come from the server's thread, requests between two cycles."""

    @property
    def state(self) -> RobotState:
        """After the last cycle, always the same object: a RobotState with `controller_mode` and `generator_mode`."""

    @property
    def hand(self) -> Hand | None:
        """The hand at the flange."""

    def cycle(self, command: MotionCommand | None) -> None:
        """One millisecond: act on the command (None: lost), then `state` is the new one."""

    def encode(self, codec: StateCodec, message_id: int) -> bytes:
        """The state as a datagram."""

    def take_finished(self) -> Outcome | None:
        """How a motion ended since the last call."""

    def connection_lost(self) -> None:
        """The client has gone: end its motion."""

    def urdf(self) -> str:
        """The arm as URDF, without the hand (whose mass is part of the state)."""

    @property
    def model_library(self) -> bytes | None:
        """Compiled model of protocol 5; None: there is none."""

    def move(self, request: MoveRequest) -> Outcome:
        """Begin a motion: STARTED, or why not."""

    def stop_move(self) -> Outcome:
        """End the motion, which is then preempted."""

    def recover(self) -> Outcome:
        """Automatic error recovery."""

    def set_user_stop(self, pressed: bool) -> Outcome:
        """Press or release the user stop."""

    def set_guiding(self, on: bool) -> Outcome:
        """Press or release the guiding buttons."""

    def reset(self) -> None:
        """The arm at its start pose, at rest; time goes on."""

    def push(self, link: str, force: Floats, duration: float) -> None:
        """Act on a link's origin: force in the world frame [N], for a time [s]."""

    def set_collision_behavior(self, *thresholds: Floats) -> Outcome:
        """Lower and upper torque thresholds, acceleration phase then nominal [N m], and force thresholds likewise
        [N]."""

    def set_joint_impedance(self, K_theta: Floats) -> Outcome:
        """7 floats [N m/rad]."""

    def set_cartesian_impedance(self, K_x: Floats) -> Outcome:
        """6 floats [N/m], [N m/rad]."""

    def set_guiding_mode(self, axes: Sequence[bool], elbow: bool) -> Outcome:
        """Which axes a hand can move: x, y, z, R, P, Y, and the elbow."""

    def set_EE_T_K(self, EE_T_K: Floats) -> Outcome:
        """Stiffness frame in the end effector, column-major."""

    def set_NE_T_EE(self, NE_T_EE: Floats) -> Outcome:
        """End effector in the nominal one, column-major."""

    def set_load(self, mass: float, com: Floats, inertia: Floats) -> Outcome:
        """Payload [kg], its centre of mass in the flange [m], inertia about it, column-major [kg m^2]."""

    def set_filters(self, cutoff: Floats) -> Outcome:
        """Cut-off frequencies of joint position and velocity, Cartesian position and velocity, controller [Hz]."""


def _accept(*_: object) -> Outcome:
    return Outcome.SUCCESS


class ConstantDevice:
    """A robot that responds as one should and never moves: for the cost of a bare server.

    Args:
        urdf_xml: response to a client that requests the model.
        hand: a hand, or None.
    """

    model_library = None

    def __init__(self, urdf_xml: str = "", hand: Hand | None = None) -> None:
        self.state, self.hand, self._urdf = DeviceState(), hand, urdf_xml
        self.state.q[:] = self.state.q_d[:] = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
        self.state.O_ddP_O[:] = [0.0, 0.0, -9.81]
        self.state.elbow[:] = self.state.elbow_d[:] = self.state.elbow_c[:] = [0.0, -1.0]
        self._finished: Outcome | None = None
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
        """Time goes on; a motion ends when the client says so."""
        self.state.time += 1e-3
        if command is not None and command.finished and self.state.robot_mode is RobotMode.MOVE:
            self._end()
            self._finished = Outcome.SUCCESS

    def encode(self, codec: StateCodec, message_id: int) -> bytes:
        """As any state is."""
        return codec.encode(message_id, self.state)

    def take_finished(self) -> Outcome | None:
        """How a motion ended since the last call."""
        finished, self._finished = self._finished, None
        return finished

    def connection_lost(self) -> None:
        """Idle."""
        self._end()
        self._finished = None

    def urdf(self) -> str:
        """What was given."""
        return self._urdf

    def move(self, request: MoveRequest) -> Outcome:
        """Begin."""
        state = self.state
        if state.robot_mode is not RobotMode.IDLE:
            return Outcome.NOT_POSSIBLE
        state.robot_mode, state.controller_mode, state.generator_mode = (
            RobotMode.MOVE,
            request.controller,
            request.generator,
        )
        state.control_command_success_rate = 1.0
        return Outcome.STARTED

    def stop_move(self) -> Outcome:
        """End."""
        if self.state.robot_mode is RobotMode.MOVE:
            self._end()
            self._finished = Outcome.PREEMPTED
        return Outcome.SUCCESS

    def recover(self) -> Outcome:
        """Nothing to recover from."""
        return Outcome.SUCCESS

    def reset(self) -> None:
        """It has not moved."""

    def push(self, link: str, force: Floats, duration: float) -> None:
        """It cannot be moved."""
        raise CommandError("a constant robot cannot be pushed")

    set_user_stop = set_guiding = staticmethod(_accept)
    set_collision_behavior = set_joint_impedance = set_cartesian_impedance = set_guiding_mode = staticmethod(_accept)
    set_EE_T_K = set_NE_T_EE = set_load = set_filters = staticmethod(_accept)
