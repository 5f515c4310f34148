"""State machine of the control box: its modes, the events, and the transitions."""

from collections.abc import Mapping
from enum import Enum

from franka_hw_interface.robot_state import RobotMode


class Event(Enum):
    """What can happen to the box."""

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
"""(mode, event) -> mode. Where a transition is missing, the event changes nothing and a request is refused.

libfranka documents the modes and which of them refuse a motion; what it leaves open is project default, unconfirmed:
recovery and stop at idle succeed and do nothing; releasing the user stop leads to idle also from a
reflex before it; while idle the arm has no reflexes and holds itself.
"""


def next_mode(mode: RobotMode, event: Event) -> RobotMode | None:
    """The mode that the event leads to; None: there is no such transition."""
    return TRANSITIONS[mode].get(event)
