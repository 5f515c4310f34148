"""State machine of the control box: modes, events and transitions."""

from collections.abc import Mapping
from enum import Enum

from franka_hw_interface.robot_state import RobotMode


class Event(Enum):
    """Events of the box."""

    START = "the first state of the arm arrives"
    MOVE = "a motion is requested"
    FINISH = "the client ends its motion"
    STOP = "a stop is requested"
    CONNECTION_LOST = "the client is gone"
    REFLEX = "the arm protects itself"
    RECOVER = "recovery is requested"
    RECOVERED = "recovery is done"
    USER_STOP_PRESSED = "the user stop is pressed"
    USER_STOP_RELEASED = "the user stop is released"
    GUIDING_ON = "the guiding buttons are pressed"
    GUIDING_OFF = "the guiding buttons are released"


TRANSITIONS: Mapping[RobotMode, Mapping[Event, RobotMode]] = {
    RobotMode.OTHER: {
        Event.START: RobotMode.IDLE,
    },
    RobotMode.IDLE: {
        Event.MOVE: RobotMode.MOVE,
        Event.STOP: RobotMode.IDLE,
        Event.RECOVER: RobotMode.IDLE,
        Event.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
        Event.GUIDING_ON: RobotMode.GUIDING,
    },
    RobotMode.MOVE: {
        Event.FINISH: RobotMode.IDLE,
        Event.STOP: RobotMode.IDLE,
        Event.CONNECTION_LOST: RobotMode.IDLE,
        Event.REFLEX: RobotMode.REFLEX,
        Event.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
    },
    RobotMode.GUIDING: {
        Event.REFLEX: RobotMode.REFLEX,
        Event.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
        Event.GUIDING_OFF: RobotMode.IDLE,
    },
    RobotMode.REFLEX: {
        Event.RECOVER: RobotMode.AUTOMATIC_ERROR_RECOVERY,
        Event.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
    },
    RobotMode.AUTOMATIC_ERROR_RECOVERY: {
        Event.RECOVERED: RobotMode.IDLE,
        Event.REFLEX: RobotMode.REFLEX,
        Event.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
    },
    RobotMode.USER_STOPPED: {
        Event.USER_STOP_RELEASED: RobotMode.IDLE,
    },
}
"""Mapping (mode, event) -> mode. Without a transition, the event changes nothing and a request is refused.

libfranka documents the modes and which of them refuse a motion; the rest is a project default, unconfirmed: recovery
and stop in idle mode succeed without effect; releasing the user stop leads to idle, also after a reflex; in idle mode
the arm has no reflexes and holds its position.
"""


def next_mode(mode: RobotMode, event: Event) -> RobotMode | None:
    """Return the mode that the event leads to, None if there is no such transition."""
    return TRANSITIONS[mode].get(event)
