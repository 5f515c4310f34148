"""A RobotHW with a manager on a LocalNode, driven for so much robot time, and controllers that note what happens to
them."""

import functools
import math
from collections.abc import Callable
from typing import Any

import panda_description
from hric_control.controller import Controller
from hric_control.hardware_interface import (
    EffortJointInterface,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_control.manager.controller_manager import ControllerManager
from hric_control.robot_hw import RobotHW
from hric_core.errors import HricError
from hric_core.local.node import LocalNode

READY = [0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4]
JOINTS = tuple(f"panda_joint{i}" for i in range(1, 8))
INTERFACES: dict[str, Any] = {
    "effort": EffortJointInterface,
    "velocity": VelocityJointInterface,
    "position": PositionJointInterface,
}
QUIET = {"realtime_priority": 0, "lock_memory": False, "watchdog_timeout": 10.0}
"""A test must not take the machine from the others."""


@functools.cache
def description(robot: str) -> str:
    inertials, limits = ("fr3", "fr3") if robot == "fr3" else ("barycentric", "panda")
    return panda_description.load(inertials=inertials, limits=limits, meshes=False, collision=False)


class Law(Controller):
    """Controller that claims the resources in its parameters, writes a constant command and records the calls to it."""

    def init(self, robot_hw: RobotHW, root_node: Any, controller_node: Any) -> None:
        self.joints = robot_hw.get(INTERFACES[controller_node.param("interface")]).group(
            controller_node.param("joints", None)
        )
        self.command, self.fail_at = controller_node.param("command", None), controller_node.param("fail_at", math.inf)
        self.calls: list[tuple[str, float]] = [("init", 0.0)]

    def starting(self, time: float) -> None:
        self.calls.append(("starting", time))
        self.updates = 0
        if self.command == "stay":
            self.joints.set_command(self.joints.positions())

    def update(self, time: float, period: float) -> None:
        self.updates += 1
        if time >= self.fail_at:
            raise HricError("this law cannot go on")
        if isinstance(self.command, list):
            self.joints.set_command(self.command)

    def stopping(self, time: float) -> None:
        self.calls.append(("stopping", time))

    def shutdown(self) -> None:
        self.calls.append(("shutdown", 0.0))


class Broadcaster(Controller):
    """Controller that claims nothing and records the times of its updates."""

    def init(self, robot_hw: RobotHW, root_node: Any, controller_node: Any) -> None:
        self.states = robot_hw.get(JointStateInterface).group()
        self.times: list[float] = []

    def update(self, time: float, period: float) -> None:
        self.times.append(time)


class Robot:
    """A RobotHW, its node and its manager; `run` drives it for a while of robot time.

    Attributes:
        times: robot time of each cycle so far [s].
    """

    def __init__(self, hw: RobotHW, parameters: dict[str, Any]) -> None:
        robot = parameters.get("robot", {}).get("robot", "panda")
        self.node = LocalNode({"robot_description": description(robot), **parameters})
        self.hw: Any = hw
        self.hw.init(self.node, self.node.child("robot"))
        self.manager = ControllerManager(hw, self.node, {"test/Law": Law, "test/Broadcaster": Broadcaster})
        self.times: list[float] = []

    def load(self, name: str, **parameters: Any) -> Any:
        """Load a controller with these parameters; return it."""
        self.node.set_param(name, {"type": "test/Law", **parameters})
        self.manager.load(name)
        return self.manager._loaded[name].controller

    def switch(self, start: list[str], stop: list[str]) -> None:
        """Switch controllers, before or between runs."""
        self.manager.switch(start, stop, loop_running=False)

    def run(self, duration: float, hook: Callable[[float], None] | None = None) -> None:
        """Run for `duration` [s of robot time]; `hook(time)` before each update."""
        begin: list[float] = []

        def on_cycle(time: float, period: float, reset_controllers: bool) -> bool:
            begin.append(time) if not begin else None
            self.times.append(time)
            if hook is not None:
                hook(time)
            self.manager.update(time, period, reset_controllers)
            if time - begin[0] + 1.5 * self.hw.period > duration:
                self.hw.stop()
            return self.hw.loop is not None or not self.manager.switch_pending

        self.hw.run(on_cycle)

    @property
    def positions(self) -> list[float]:
        """Return the measured joint positions, 7 floats [rad]."""
        return list(self.hw.get(JointStateInterface).states.position)

    def close(self) -> None:
        self.manager.shutdown()
        self.hw.shutdown()
