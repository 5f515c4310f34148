"""Services of the user stop and the guiding button of the simulated arm."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from std_srvs.srv import SetBoolRequest

from franka_hw_interface.robot_state import RobotMode
from hric_control.hardware_interface import VelocityJointInterface
from hric_core.errors import HricError

STOP, GUIDING = "franka_control/set_user_stop", "franka_control/set_guiding"


def press(arm: Any, button: str, on: bool) -> str:
    """Press or release a button; return the message of a refusal."""
    response = arm.node.call(button, SetBoolRequest(on))
    assert response.success == (response.message == "")
    return response.message


@pytest.fixture
def moving(make_arm: Callable[..., Any], claim: Callable[..., Any]) -> Iterator[Any]:
    """Arm whose first joint turns at 0.5 rad/s."""
    arm = make_arm()
    group = arm.hw.get(VelocityJointInterface).group()
    arm.hw.prepare_switch([claim(VelocityJointInterface)], [])
    arm.hw.do_switch([claim(VelocityJointInterface)], [])
    arm.run(0.5, lambda time: group.set_command([min(time, 0.5)] + [0.0] * 6))
    arm.command = lambda time: group.set_command([0.5] + [0.0] * 6)
    yield arm


def test_the_user_stop_ends_a_motion_and_needs_release_and_recovery(moving: Any) -> None:
    hw = moving.hw
    assert press(moving, STOP, True) == ""
    moving.run(0.5, moving.command)
    assert hw.robot_state.robot_mode is RobotMode.USER_STOPPED
    assert np.abs(hw.states.velocity).max() < 1e-5 and "aborted" in hw.error
    with pytest.raises(HricError, match="recovery is refused"):
        hw.recover()
    assert press(moving, STOP, False) == ""
    hw.recover()
    moving.run(0.5, moving.command)
    assert hw.error == "" and hw.states.velocity[0] == pytest.approx(0.5, abs=0.02)


def test_a_hand_moves_a_guided_arm_and_it_stays_there(make_arm: Callable[..., Any]) -> None:
    arm = make_arm()
    before = np.array(arm.hw.states.position)
    assert press(arm, GUIDING, True) == ""
    arm.hw.plant.apply_wrench("panda_link8", (0.0, 5.0, 0.0), (0.0,) * 3, (0.0,) * 3, 0.3)
    arm.run(0.3)
    assert arm.hw.robot_state.robot_mode is RobotMode.GUIDING
    assert press(arm, GUIDING, False) == ""
    arm.run(0.5)
    after = np.array(arm.hw.states.position)
    assert np.abs(after - before).max() > 0.01 and np.abs(arm.hw.states.velocity).max() < 1e-3


def test_guiding_is_refused_during_a_motion(moving: Any) -> None:
    assert press(moving, GUIDING, True) == "command not possible in the current mode"
    assert moving.hw.robot_state.robot_mode is RobotMode.MOVE
