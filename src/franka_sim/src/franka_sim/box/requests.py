"""Requests to the control box and their outcomes, by libfranka's names and independent of the protocol version."""

from dataclasses import dataclass
from enum import Enum, IntEnum

from franka_hw_interface.command_set import ArmCommand


class ControllerMode(IntEnum):
    """Controller of a motion: where its joint torques come from. Numbers as in the Franka state message."""

    JOINT_IMPEDANCE = 0
    CARTESIAN_IMPEDANCE = 1
    EXTERNAL = 2
    OTHER = 3


class GeneratorMode(IntEnum):
    """Motion generator: the quantity that the client commands. Numbers as in the Franka state message."""

    IDLE = 0
    JOINT_POSITION = 1
    JOINT_VELOCITY = 2
    CARTESIAN_POSITION = 3
    CARTESIAN_VELOCITY = 4
    NONE = 5


@dataclass(frozen=True, slots=True)
class MoveRequest:
    """Request to start a motion.

    Attributes:
        controller, generator: requested modes.
        max_path_deviation, max_goal_deviation: allowed deviation of the end effector from path and goal: translation
            [m], rotation [rad], elbow [rad]; libfranka's defaults.
        maximum_velocity: maximum joint velocities of an asynchronous motion, whose commands are sparse targets, 7
            floats [rad/s]; None: the motion has a command in each millisecond.
    """

    controller: ControllerMode
    generator: GeneratorMode
    max_path_deviation: tuple[float, float, float] = (10.0, 3.12, 6.283185307179586)
    max_goal_deviation: tuple[float, float, float] = (10.0, 3.12, 6.283185307179586)
    maximum_velocity: tuple[float, ...] | None = None


class RequestOutcome(Enum):
    """Response to a request, or the way a motion ended; a protocol that lacks one sends its nearest equivalent."""

    SUCCESS = "success"
    STARTED = "motion started"
    PREEMPTED = "preempted"
    NOT_POSSIBLE = "command not possible in the current mode"
    SINGULAR_START = "start at singular pose"
    INVALID_ARGUMENT = "invalid argument"
    REFLEX_ABORTED = "aborted by reflex"
    EMERGENCY_ABORTED = "aborted by emergency stop"
    INPUT_ERROR_ABORTED = "aborted by input error"
    ABORTED = "aborted"
    MANUAL_RECOVERY_REQUIRED = "manual error recovery required"


MotionCommand = ArmCommand
"""Command of a client in one millisecond; only the fields of the active modes are used."""
