"""RobotHW backends for the contract tests, with the same interface: in process on each engine, and through libfranka
with an emulated control box."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from driven_robot import QUIET, Robot
from fci_peer import control_box

from franka_msgs.msg import ErrorRecoveryGoal
from franka_real.franka_hw import FrankaHW
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_core import plugins

PLANTS = {engine: info.name for engine, info in plugins.engines().items()}
BACKENDS = (*PLANTS, "panda", "fr3")
"""Names of the backends: the engines, and panda (libfranka 0.9) and fr3 (pylibfranka) with an emulated control box."""


class Boxes:
    """Emulated control boxes in separate processes, started on first use, in lock-step and as fast as the client.

    Args:
        words: further arguments of the command.
    """

    def __init__(self, *words: str) -> None:
        self._words = words or ("--no-collision",)
        self._stack = ExitStack()
        self._boxes: dict[str, tuple[str, Any]] = {}

    def address(self, robot: str) -> str:
        """Return the address of the control box of this type of robot."""
        if robot not in self._boxes:
            words = ("--robot", robot, "--real-time-factor", "0", "--console")
            self._boxes[robot] = self._stack.enter_context(control_box(*words, *self._words))
        return self._boxes[robot][0]

    def order(self, robot: str, line: str) -> None:
        """Send a line to the console of the control box, which executes it between two of the next cycles."""
        console = self._boxes[robot][1].stdin
        console.write(line + "\n")
        console.flush()

    def close(self) -> None:
        self._stack.close()


@contextmanager
def connected(backend: str, boxes: Boxes, **parameters: Any) -> Iterator[Robot]:
    """Yield a robot of this backend.

    Args:
        backend: name in BACKENDS.
        boxes: emulated control boxes.
        parameters: private parameters of the robot.
    """
    if backend in PLANTS:
        own = {
            "real_time_factor": 0.0,
            "plant_type": PLANTS[backend],
            "plant": {"collision": False, "self_collision": False},
        }
        robot = Robot(FrankaHWSim(), {"robot": {**own, **parameters}})
    else:
        robot = Robot(
            FrankaHW(), {"robot": {"robot_ip": boxes.address(backend), "robot": backend, **QUIET, **parameters}}
        )
        robot.node.send_goal("franka_control/error_recovery", ErrorRecoveryGoal())  # clear errors of the previous test
    try:
        yield robot
    finally:
        robot.close()
