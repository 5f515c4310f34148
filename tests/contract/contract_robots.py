"""The RobotHW back ends that the contract is tested on, each driven alike: in process on PyBullet, and through libfranka on an emulated box."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from driven_robot import QUIET, Robot
from fci_peer import control_box

from franka_msgs.msg import ErrorRecoveryGoal
from franka_real.franka_hw import FrankaHW
from franka_sim.franka_hw_sim import FrankaHWSim

BACKENDS = ("pybullet", "panda", "fr3")
"""In process; through libfranka 0.9 and through pylibfranka, on an emulated box in another process."""


class Boxes:
    """Emulated control boxes in processes of their own, started when first asked for, lock-step and as fast as the client."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._addresses: dict[str, str] = {}

    def address(self, robot: str) -> str:
        """Of the box of this kind."""
        if robot not in self._addresses:
            words = ("--robot", robot, "--no-collision", "--real-time-factor", "0")
            self._addresses[robot] = self._stack.enter_context(control_box(*words))[0]
        return self._addresses[robot]

    def close(self) -> None:
        self._stack.close()


@contextmanager
def connected(backend: str, boxes: Boxes, **parameters: Any) -> Iterator[Robot]:
    """A robot of this back end.

    Args:
        backend: one of BACKENDS.
        boxes: the control boxes.
        parameters: private ones of the robot.
    """
    if backend == "pybullet":
        own = {"real_time_factor": 0.0, "plant": {"collision": False, "self_collision": False}}
        robot = Robot(FrankaHWSim(), {"robot": {**own, **parameters}})
    else:
        robot = Robot(FrankaHW(), {"robot": {"robot_ip": boxes.address(backend), "robot": backend, **QUIET, **parameters}})
        robot.node.send_goal("franka_control/error_recovery", ErrorRecoveryGoal())  # whatever the test before left behind
    try:
        yield robot
    finally:
        robot.close()
