"""The motions that libfranka's examples command from the ready pose pass the box without a rate limiter, and end at
rest."""

from collections.abc import Callable

import numpy as np
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import RobotState
from franka_sim.box.motion import make_generator
from franka_sim.box.requests import GeneratorMode, MotionCommand

READY = [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]
DT = 0.001
Law = Callable[[float, RobotState, MotionCommand], None]


def joint_position(t: float, start: RobotState, command: MotionCommand) -> None:
    """Joints 4, 5 and 7 swing by pi/4 in 5 s."""
    swing = np.pi / 8 * (1.0 - np.cos(np.pi / 2.5 * t))
    command.q = [q + swing * (i in (3, 4, 6)) for i, q in enumerate(start.q_d)]


def joint_velocity(t: float, start: RobotState, command: MotionCommand) -> None:
    """Joints 4 to 7 go out for a second and come back in another, at up to 1 rad/s."""
    speed = (1.0 if t < 1.0 else -1.0) * 0.5 * (1.0 - np.cos(2.0 * np.pi * t))
    command.dq = [speed * (i >= 3) for i in range(7)]


def cartesian_pose(t: float, start: RobotState, command: MotionCommand) -> None:
    """An arc of radius 0.3 m in the x-z plane, there and back in 10 s."""
    angle = np.pi / 4 * (1.0 - np.cos(np.pi / 5.0 * t))
    command.O_T_EE = start.O_T_EE_c[:]
    command.O_T_EE[12] += 0.3 * np.sin(angle)
    command.O_T_EE[14] += 0.3 * (np.cos(angle) - 1.0)


def cartesian_velocity(t: float, start: RobotState, command: MotionCommand) -> None:
    """Down and forward at up to 0.1 m/s for 4 s, and back."""
    speed = (1.0 if t < 4.0 else -1.0) * 0.05 * (1.0 - np.cos(np.pi / 2.0 * t))
    command.O_dP_EE = [np.cos(np.pi / 4) * speed, 0.0, -np.sin(np.pi / 4) * speed, 0.0, 0.0, 0.0]


def elbow(t: float, start: RobotState, command: MotionCommand) -> None:
    """The elbow swings by pi/5 in 10 s, the pose stays."""
    swing = np.pi / 10 * (1.0 - np.cos(np.pi / 5.0 * t))
    command.O_T_EE, command.elbow = start.O_T_EE_c[:], (start.elbow_c[0] + swing, start.elbow_c[1])


@pytest.mark.parametrize(
    ("kind", "law", "duration"),
    [
        (GeneratorMode.JOINT_POSITION, joint_position, 5.0),
        (GeneratorMode.JOINT_VELOCITY, joint_velocity, 2.0),
        (GeneratorMode.CARTESIAN_POSITION, cartesian_pose, 10.0),
        (GeneratorMode.CARTESIAN_VELOCITY, cartesian_velocity, 8.0),
        (GeneratorMode.CARTESIAN_POSITION, elbow, 10.0),
    ],
)
def test_the_motion_passes_and_comes_back_to_where_it_began(kind: GeneratorMode, law: Law, duration: float) -> None:
    model = KdlFrankaModel(panda_description.load(meshes=False, collision=False), "panda")
    generator, state = make_generator(kind, model, franka_limits(), DT), RobotState()
    state.q_d[:] = READY
    assert generator.start(state) == frozenset()
    start, steps, furthest = state.snapshot(), round(duration / DT), 0.0
    for step in range(steps + 1):
        command = MotionCommand([0.0] * 7, [0.0] * 7, [0.0] * 16, [0.0] * 6, None, [0.0] * 7, finished=step == steps)
        law(step * DT, start, command)
        assert generator.advance(command) == frozenset(), f"at {step * DT:.3f} s"
        furthest = max(furthest, np.abs(np.subtract(state.q_d, READY)).max())
    assert furthest > 0.3
    np.testing.assert_allclose(state.q_d, READY, atol=5e-3)
    np.testing.assert_allclose(
        model.pose(FrankaFrame.END_EFFECTOR, state.q_d), model.pose(FrankaFrame.END_EFFECTOR, READY), atol=2e-3
    )
