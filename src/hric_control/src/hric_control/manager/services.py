"""Services and statistics topic of the controller manager, with the names and types of ros_control."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from controller_manager_msgs import msg, srv
from hric_control.manager.controller_manager import ControllerManager
from hric_control.manager.loaded_controller import ControllerStatus, UpdateStatistics
from hric_core import realtime
from hric_core.errors import HricError
from hric_core.node import Node
from hric_core.robot_time import stamps

NAMESPACE = "controller_manager"
REFUSAL = "refusal"
"""Name of the parameter with the reason of the last refused request, in the manager's namespace."""
STATISTICS_PERIOD = 1.0
"""Time between two statistics messages [s of robot time]."""


class ManagerServices:
    """Services and statistics topic of ros_control in the namespace `<node>/controller_manager`.

    The response to a refused request has `ok` false. The reason is logged and stored in the parameter `refusal`, as the
    services' types have no field for it.

    Args:
        manager: controller manager; its control loop runs in another thread.
        node: node of the robot's namespace.
    """

    def __init__(self, manager: ControllerManager, node: Node) -> None:
        self._manager, self._node = manager, node.child(NAMESPACE)
        self._services = [
            self._node.service("list_controllers", srv.ListControllers, self._list),
            self._node.service("list_controller_types", srv.ListControllerTypes, self._types),
            self._node.service("load_controller", srv.LoadController, self._load),
            self._node.service("unload_controller", srv.UnloadController, self._unload),
            self._node.service("switch_controller", srv.SwitchController, self._switch),
            self._node.service("reload_controller_libraries", srv.ReloadControllerLibraries, self._reload),
        ]
        self._publisher = realtime.publisher(self._node, "statistics", msg.ControllersStatistics)
        manager.call_periodically(STATISTICS_PERIOD, self._publish)

    def _try(self, what: str, request: Callable[[], None]) -> bool:
        try:
            request()
        except HricError as error:
            self._node.log_error(f"{what} refused: {error}")
            self._node.set_param(REFUSAL, str(error))
            return False
        return True

    def _list(self, request: Any) -> Any:
        return srv.ListControllersResponse(controller=[_state(status) for status in self._manager.list()])

    def _types(self, request: Any) -> Any:
        types = self._manager.types()
        return srv.ListControllerTypesResponse(types=list(types), base_classes=list(types.values()))

    def _load(self, request: Any) -> Any:
        return srv.LoadControllerResponse(
            ok=self._try(f"loading {request.name!r}", lambda: self._manager.load(request.name))
        )

    def _unload(self, request: Any) -> Any:
        return srv.UnloadControllerResponse(
            ok=self._try(f"unloading {request.name!r}", lambda: self._manager.unload(request.name))
        )

    def _switch(self, request: Any) -> Any:
        start, stop = list(request.start_controllers), list(request.stop_controllers)
        what = f"switch (start {', '.join(start) or 'none'}; stop {', '.join(stop) or 'none'})"
        ok = self._try(
            what, lambda: self._manager.switch(start, stop, request.strictness, request.start_asap, request.timeout)
        )
        return srv.SwitchControllerResponse(ok=ok)

    def _reload(self, request: Any) -> Any:
        return srv.ReloadControllerLibrariesResponse(
            ok=self._try("reloading", lambda: self._manager.reload(request.force_kill))
        )

    def _publish(self, time: float) -> None:
        self._publisher.publish(_statistics, self._manager.statistics(), time)


def _state(status: ControllerStatus) -> Any:
    claims = [
        msg.HardwareInterfaceResources(hardware_interface=name, resources=list(joints))
        for name, joints in status.claims.items()
    ]
    return msg.ControllerState(name=status.name, state=status.state, type=status.type, claimed_resources=claims)


def _statistics(snapshot: Sequence[UpdateStatistics], time: float) -> Any:
    message = msg.ControllersStatistics()
    message.header.stamp = stamps.to_time(time)
    message.controller = [
        msg.ControllerStatistics(
            name=entry.name,
            type=entry.type,
            timestamp=message.header.stamp,
            running=entry.running,
            max_time=stamps.to_duration(entry.max_time),
            mean_time=stamps.to_duration(entry.mean_time),
            # The field is a duration, so it contains the standard deviation instead of the variance, as in
            # pr2_controller_manager, which defined the message.
            variance_time=stamps.to_duration(math.sqrt(entry.variance_time)),
            num_control_loop_overruns=entry.overruns,
            time_last_control_loop_overrun=stamps.to_time(max(entry.last_overrun, 0.0)),
        )
        for entry in snapshot
    ]
    return message
