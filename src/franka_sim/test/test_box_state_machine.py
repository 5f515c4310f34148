"""Every arrow and every missing arrow of the control box's modes."""

import pytest

from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.state_machine import TRANSITIONS, BoxEvent, next_mode

OTHER, IDLE, MOVE, GUIDING = RobotMode.OTHER, RobotMode.IDLE, RobotMode.MOVE, RobotMode.GUIDING
REFLEX, STOPPED, RECOVERY = RobotMode.REFLEX, RobotMode.USER_STOPPED, RobotMode.AUTOMATIC_ERROR_RECOVERY

ARROWS = {
    "the first state makes the box idle": (OTHER, BoxEvent.START, IDLE),
    "an idle arm moves when asked": (IDLE, BoxEvent.MOVE, MOVE),
    "an idle arm that is stopped stays idle": (IDLE, BoxEvent.STOP, IDLE),
    "an idle arm has nothing to recover from": (IDLE, BoxEvent.RECOVER, IDLE),
    "the user stop takes an idle arm": (IDLE, BoxEvent.USER_STOP_PRESSED, STOPPED),
    "an idle arm can be guided": (IDLE, BoxEvent.GUIDING_ON, GUIDING),
    "a finished motion ends at idle": (MOVE, BoxEvent.FINISH, IDLE),
    "a stopped motion ends at idle": (MOVE, BoxEvent.STOP, IDLE),
    "a motion whose client is gone ends at idle": (MOVE, BoxEvent.CONNECTION_LOST, IDLE),
    "a reflex ends a motion": (MOVE, BoxEvent.REFLEX, REFLEX),
    "the user stop ends a motion": (MOVE, BoxEvent.USER_STOP_PRESSED, STOPPED),
    "a reflex ends guiding": (GUIDING, BoxEvent.REFLEX, REFLEX),
    "the user stop ends guiding": (GUIDING, BoxEvent.USER_STOP_PRESSED, STOPPED),
    "guiding ends with its buttons": (GUIDING, BoxEvent.GUIDING_OFF, IDLE),
    "a reflex is left through recovery": (REFLEX, BoxEvent.RECOVER, RECOVERY),
    "the user stop takes an arm in reflex": (REFLEX, BoxEvent.USER_STOP_PRESSED, STOPPED),
    "recovery ends at idle": (RECOVERY, BoxEvent.RECOVERED, IDLE),
    "recovery that fails goes back to reflex": (RECOVERY, BoxEvent.REFLEX, REFLEX),
    "the user stop ends recovery": (RECOVERY, BoxEvent.USER_STOP_PRESSED, STOPPED),
    "a released user stop leaves the arm idle": (STOPPED, BoxEvent.USER_STOP_RELEASED, IDLE),
}
MISSING = sorted(
    {(mode, event) for mode in RobotMode for event in BoxEvent} - {(mode, event) for mode, event, _ in ARROWS.values()},
    key=lambda pair: (pair[0], pair[1].name),
)


@pytest.mark.parametrize("sentence", ARROWS)
def test_arrow(sentence: str) -> None:
    mode, event, expected = ARROWS[sentence]
    assert next_mode(mode, event) is expected


def test_no_other_event_leads_anywhere() -> None:
    assert [(mode.name, event.name) for mode, event in MISSING if next_mode(mode, event) is not None] == []


def test_every_mode_is_in_the_table_and_no_arrow_beyond_those_above() -> None:
    assert set(TRANSITIONS) == set(RobotMode)
    assert sum(len(row) for row in TRANSITIONS.values()) == len(ARROWS)
    assert len(ARROWS) + len(MISSING) == len(RobotMode) * len(BoxEvent)
