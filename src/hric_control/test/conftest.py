import pytest
from real_master import ros, roscore
from recorded_calls import FakeController, RecordingRobotHW

from hric_control.manager.controller_manager import ControllerManager
from hric_core.local.node import LocalNode

__all__ = ["ros", "roscore"]

CONFIGURATION = {
    "left": {"type": "fake/Controller", "joints": ["joint1"]},
    "right": {"type": "fake/Controller", "joints": ["joint2"]},
    "both": {"type": "fake/Controller", "joints": ["joint1", "joint2"]},
    "reader": {"type": "fake/Controller"},
}


class ManagerRig:
    """A manager on a fake robot and a LocalNode; `cycle` is the loop."""

    def __init__(self) -> None:
        self.fail: dict[str, Exception] = {}
        self.hw = RecordingRobotHW()
        self.node = LocalNode(CONFIGURATION)
        self.made: dict[str, FakeController] = {}
        self.manager = ControllerManager(self.hw, self.node, {"fake/Controller": self._make})
        self.manager.loop_running = False
        self._cycles = 0

    def _make(self) -> FakeController:
        controller = FakeController()
        controller.fail = dict(self.fail)
        self.last = controller
        return controller

    def load(self, *names: str) -> None:
        for name in names:
            self.manager.load(name)
            self.made[name] = self.last

    def start(self, *names: str) -> None:
        self.load(*names)
        self.manager.switch(names, [])

    def cycle(self, n: int = 1, reset: bool = False) -> None:
        for _ in range(n):
            self.manager.update(self._cycles * 1e-3, 1e-3, reset)
            self._cycles += 1

    def states(self) -> dict[str, str]:
        return {status.name: status.state for status in self.manager.list()}


@pytest.fixture
def rig() -> ManagerRig:
    return ManagerRig()
