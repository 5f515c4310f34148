"""State machine of the control box: modes, events and transitions."""

from collections.abc import Mapping
from enum import Enum

from franka_hw_interface.robot_state import RobotMode


class BoxEvent(Enum):
    """Events that change the mode of the control box."""

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


TRANSITIONS: Mapping[RobotMode, Mapping[BoxEvent, RobotMode]] = {
    RobotMode.OTHER: {
        BoxEvent.START: RobotMode.IDLE,
    },
    RobotMode.IDLE: {
        BoxEvent.MOVE: RobotMode.MOVE,
        BoxEvent.STOP: RobotMode.IDLE,
        BoxEvent.RECOVER: RobotMode.IDLE,
        BoxEvent.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
        BoxEvent.GUIDING_ON: RobotMode.GUIDING,
    },
    RobotMode.MOVE: {
        BoxEvent.FINISH: RobotMode.IDLE,
        BoxEvent.STOP: RobotMode.IDLE,
        BoxEvent.CONNECTION_LOST: RobotMode.IDLE,
        BoxEvent.REFLEX: RobotMode.REFLEX,
        BoxEvent.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
    },
    RobotMode.GUIDING: {
        BoxEvent.REFLEX: RobotMode.REFLEX,
        BoxEvent.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
        BoxEvent.GUIDING_OFF: RobotMode.IDLE,
    },
    RobotMode.REFLEX: {
        BoxEvent.RECOVER: RobotMode.AUTOMATIC_ERROR_RECOVERY,
        BoxEvent.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
    },
    RobotMode.AUTOMATIC_ERROR_RECOVERY: {
        BoxEvent.RECOVERED: RobotMode.IDLE,
        BoxEvent.REFLEX: RobotMode.REFLEX,
        BoxEvent.USER_STOP_PRESSED: RobotMode.USER_STOPPED,
    },
    RobotMode.USER_STOPPED: {
        BoxEvent.USER_STOP_RELEASED: RobotMode.IDLE,
    },
}
"""Next mode of the control box by mode and event. An event that is missing changes nothing; such a request is refused.

libfranka documents the modes and which of them refuse a motion; the rest is a project default, unconfirmed: recovery
and stop in idle mode succeed without effect; releasing the user stop leads to idle, also after a reflex; in idle mode
the arm has no reflexes and holds its position.
"""


def next_mode(mode: RobotMode, event: BoxEvent) -> RobotMode | None:
    """Return the mode that the event leads to, None if there is no such transition."""
    return TRANSITIONS[mode].get(event)
