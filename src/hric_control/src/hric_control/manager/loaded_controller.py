"""Loaded controller with its state, claims, and statistics of its updates' durations."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from hric_control.controller import Controller
from hric_control.robot_hw import ControllerInfo
from hric_control.speed_scale import RESOURCE, SpeedScaleInterface
from hric_core.scoped_node import ScopedNode


class ControllerState(StrEnum):
    """States of a controller, spelled as in controller_manager_msgs."""

    INITIALIZED = "initialized"
    RUNNING = "running"
    STOPPED = "stopped"
    WAITING = "waiting"
    ABORTED = "aborted"


@dataclass(frozen=True)
class ControllerStatus:
    """Status of a controller, as `ControllerManager.list` returns it.

    Attributes:
        name: name of the controller.
        type: plugin type string.
        state: "initialized", "running", "stopped", "waiting" (for the robot) or "aborted".
        claims: claimed joints by the ros_control name of the interface; also the speed scale, if the controller obeys
            it.
        error: reason why the controller is aborted; else empty.
    """

    name: str
    type: str
    state: str
    claims: dict[str, tuple[str, ...]]
    error: str = ""


@dataclass(frozen=True)
class UpdateStatistics:
    """Durations of a controller's updates since it was last started.

    Attributes:
        name, type: name and type of the controller.
        running: True if the controller is running.
        updates: number of updates.
        max_time, mean_time: largest and mean duration [s].
        variance_time: variance of the duration [s^2].
        overruns: number of updates that took longer than the period.
        last_overrun: robot time of the last overrun [s]; negative if there was none.
    """

    name: str
    type: str
    running: bool
    updates: int
    max_time: float
    mean_time: float
    variance_time: float
    overruns: int
    last_overrun: float


class LoadedController:
    """Loaded controller with its state.

    The control loop reads `controller` and `update` and writes the statistics, which are plain floats. `obeys`: True if
    the controller has declared that it obeys the robot's speed scale. `error`: reason of the last abort."""

    __slots__ = (
        "controller",
        "error",
        "info",
        "last_overrun",
        "max_time",
        "mean_time",
        "obeys",
        "overruns",
        "scope",
        "squares",
        "state",
        "update",
        "updates",
    )

    def __init__(self, controller: Controller, info: ControllerInfo, scope: ScopedNode, obeys: bool = False) -> None:
        self.controller, self.info, self.scope, self.obeys = controller, info, scope, obeys
        self.update: Callable[[float, float], None] = controller.update
        self.state, self.error = ControllerState.INITIALIZED, ""
        self.clear_statistics()

    @property
    def name(self) -> str:
        """Name of the controller."""
        return self.info.name

    @property
    def running(self) -> bool:
        """True if the controller is updated in each cycle."""
        return self.state is ControllerState.RUNNING

    def abort(self, error: str) -> None:
        """Set the state to aborted, which ends the controller's updates; `error`: reason."""
        self.state, self.error = ControllerState.ABORTED, error

    def clear_statistics(self) -> None:
        """Reset the statistics of the updates' durations; called when the controller starts."""
        self.updates = self.overruns = 0
        self.max_time = self.mean_time = self.squares = 0.0
        self.last_overrun = -1.0

    def status(self) -> ControllerStatus:
        """Return the present status of the controller."""
        claims = {interface: tuple(sorted(joints)) for interface, joints in self.info.claims.items()}
        if self.obeys:
            claims[SpeedScaleInterface.cpp_name] = (RESOURCE,)
        error = self.error if self.state is ControllerState.ABORTED else ""
        return ControllerStatus(self.name, self.info.type, self.state.value, claims, error)

    def statistics(self) -> UpdateStatistics:
        """Return the present statistics of the updates' durations."""
        variance = self.squares / self.updates if self.updates else 0.0
        return UpdateStatistics(
            self.name,
            self.info.type,
            self.running,
            self.updates,
            self.max_time,
            self.mean_time,
            variance,
            self.overruns,
            self.last_overrun,
        )
