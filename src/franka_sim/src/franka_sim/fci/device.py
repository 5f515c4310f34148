"""Interface of a robot to the server, and the simplest robot: one with a constant state."""

from collections.abc import Sequence
from typing import Protocol

from franka_hw_interface.robot_state import RobotMode, RobotState
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest, Outcome
from franka_sim.fci.hand_service import Hand
from franka_sim.fci.wire import StateCodec
from hric_core.errors import CommandError

Floats = Sequence[float]


class DeviceState(RobotState):
    """State of the arm with its two modes, as sent to the client."""

    __slots__ = ("controller_mode", "generator_mode")

    def __init__(self) -> None:
        super().__init__()
        self.controller_mode, self.generator_mode = ControllerMode.OTHER, GeneratorMode.IDLE


class Device(Protocol):
    """Plant and control box behind the server. All calls come from the server's thread, requests between two cycles."""

    @property
    def state(self) -> RobotState:
        """State after the last cycle, always the same RobotState, with `controller_mode` and `generator_mode`."""

    @property
    def hand(self) -> Hand | None:
        """Hand at the flange, None without one."""

    def cycle(self, command: MotionCommand | None) -> None:
        """Run one millisecond with the command (None: lost); afterwards `state` is the new one."""

    def encode(self, codec: StateCodec, message_id: int) -> bytes:
        """Return the state as a datagram."""

    def take_finished(self) -> Outcome | None:
        """Return the outcome of a motion that ended since the last call, or None."""

    def connection_lost(self) -> None:
        """End the motion of a client that has disconnected."""

    def urdf(self) -> str:
        """Return the arm as URDF, without the hand (whose mass is part of the state)."""

    @property
    def model_library(self) -> bytes | None:
        """Compiled model of protocol 5; None: not available."""

    def move(self, request: MoveRequest) -> Outcome:
        """Start a motion and return STARTED, or the reason of the refusal."""

    def stop_move(self) -> Outcome:
        """End the motion as preempted."""

    def recover(self) -> Outcome:
        """Run automatic error recovery."""

    def set_user_stop(self, pressed: bool) -> Outcome:
        """Press or release the user stop."""

    def set_guiding(self, on: bool) -> Outcome:
        """Press or release the guiding buttons."""

    def reset(self) -> None:
        """Put the arm at its start pose, at rest; time goes on."""

    def push(self, link: str, force: Floats, duration: float) -> None:
        """Apply a force in the world frame [N] to a link's origin for a duration [s]."""

    def set_collision_behavior(self, *thresholds: Floats) -> Outcome:
        """Set lower and upper thresholds of torque [N m] and force [N], each for acceleration, then nominal."""

    def set_joint_impedance(self, K_theta: Floats) -> Outcome:
        """Set the stiffness of the internal joint impedance, 7 floats [N m/rad]."""

    def set_cartesian_impedance(self, K_x: Floats) -> Outcome:
        """Set the stiffness of the internal Cartesian impedance, 6 floats [N/m], [N m/rad]."""

    def set_guiding_mode(self, axes: Sequence[bool], elbow: bool) -> Outcome:
        """Set the axes x, y, z, R, P, Y, and if the elbow, may be guided by hand."""

    def set_EE_T_K(self, EE_T_K: Floats) -> Outcome:
        """Set the stiffness frame in the end effector, column-major."""

    def set_NE_T_EE(self, NE_T_EE: Floats) -> Outcome:
        """Set the end effector in the nominal end-effector frame, column-major."""

    def set_load(self, mass: float, com: Floats, inertia: Floats) -> Outcome:
        """Set the payload: mass [kg], centre of mass in the flange [m], inertia about it, column-major [kg m^2]."""

    def set_filters(self, cutoff: Floats) -> Outcome:
        """Set cut-off frequencies [Hz]: joint position and velocity, Cartesian position and velocity, controller."""


def _accept(*_: object) -> Outcome:
    return Outcome.SUCCESS


class ConstantDevice:
    """Robot that responds correctly and never moves, to measure the cost of the server alone.

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
        """Advance time; a motion ends with the client's last command."""
        self.state.time += 1e-3
        if command is not None and command.finished and self.state.robot_mode is RobotMode.MOVE:
            self._end()
            self._finished = Outcome.SUCCESS

    def encode(self, codec: StateCodec, message_id: int) -> bytes:
        """Return the state as a datagram."""
        return codec.encode(message_id, self.state)

    def take_finished(self) -> Outcome | None:
        """Return the outcome of a motion that ended since the last call, or None."""
        finished, self._finished = self._finished, None
        return finished

    def connection_lost(self) -> None:
        """Return to idle mode."""
        self._end()
        self._finished = None

    def urdf(self) -> str:
        """Return the description from the constructor."""
        return self._urdf

    def move(self, request: MoveRequest) -> Outcome:
        """Start a motion."""
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
        """End the motion."""
        if self.state.robot_mode is RobotMode.MOVE:
            self._end()
            self._finished = Outcome.PREEMPTED
        return Outcome.SUCCESS

    def recover(self) -> Outcome:
        """Return SUCCESS: there are no errors to recover from."""
        return Outcome.SUCCESS

    def reset(self) -> None:
        """Do nothing: the robot never moves."""

    def push(self, link: str, force: Floats, duration: float) -> None:
        """Raise a CommandError: the robot never moves."""
        raise CommandError("a constant robot cannot be pushed")

    set_user_stop = set_guiding = staticmethod(_accept)
    set_collision_behavior = set_joint_impedance = set_cartesian_impedance = set_guiding_mode = staticmethod(_accept)
    set_EE_T_K = set_NE_T_EE = set_load = set_filters = staticmethod(_accept)
