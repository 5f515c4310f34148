"""A robot and a controller without physics that record the calls of the manager, and fail where a test says so."""

from collections.abc import Sequence

from hric_control.controller import Controller
from hric_control.fakes import FakeRobotHW
from hric_control.hardware_interface import EffortJointInterface
from hric_control.robot_hw import ControllerInfo, RobotHW
from hric_core.node import Node


class RecordingRobotHW(FakeRobotHW):
    """Robot that records the calls of the manager.

    `calls`: recorded calls, e.g. ("do_switch", ["a"], ["b"]). `ready`: return value of `switch_done`, or an
    error that it raises. `refuse`: error that `prepare_switch` raises, or None."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[tuple[str, list[str], list[str]]] = []
        self.ready: bool | Exception = True
        self.refuse: Exception | None = None

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        self._note("prepare_switch", start, stop)
        if self.refuse is not None:
            raise self.refuse

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        self._note("do_switch", start, stop)

    def switch_done(self, start: Sequence[ControllerInfo]) -> bool:
        if isinstance(self.ready, Exception):
            raise self.ready
        return self.ready

    def _note(self, what: str, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        self.calls.append((what, [info.name for info in start], [info.name for info in stop]))


class FakeController(Controller):
    """Controller that claims the efforts of its parameter `joints` (none by default) and records its calls.

    Attributes:
        calls: "init", "starting", "update", "stopping", "shutdown".
        fail: error to raise, by the name of the method that raises it.
    """

    fail: dict[str, Exception] = {}  # noqa: RUF012  # a test sets it on a subclass or an instance

    def __init__(self) -> None:
        self.calls: list[str] = []

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Take the handles and record the call."""
        self.node = controller_node
        joints = controller_node.param("joints", [])
        if joints:
            robot_hw.get(EffortJointInterface).group(joints)
        self._note("init")

    def starting(self, time: float) -> None:
        """Record the call."""
        self._note("starting")

    def update(self, time: float, period: float) -> None:
        """Record the call."""
        self._note("update")

    def stopping(self, time: float) -> None:
        """Record the call."""
        self._note("stopping")

    def shutdown(self) -> None:
        """Record the call."""
        self._note("shutdown")

    def _note(self, what: str) -> None:
        self.calls.append(what)
        if what in self.fail:
            raise self.fail[what]
