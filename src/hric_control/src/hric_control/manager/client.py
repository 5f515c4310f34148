"""Client of a controller manager's services, for command-line tools. It needs no `rospy.init_node`."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import rosgraph
import rospy

from controller_manager_msgs.srv import (
    ListControllers,
    ListControllerTypes,
    LoadController,
    ReloadControllerLibraries,
    SwitchController,
    SwitchControllerRequest,
    UnloadController,
)
from hric_control.manager.services import REFUSAL
from hric_core.errors import FailureError

SERVICES = ("load_controller", "unload_controller", "switch_controller", "list_controllers")


def check_master() -> None:
    """Raise an error if there is no ROS master, for which rospy itself would wait silently.

    Raises:
        HricError: no master responds; the message has its address.
    """
    if not rosgraph.is_master_online():
        raise FailureError(
            f"no ROS master at {rosgraph.get_master_uri()}: start one (roscore, roslaunch) or set ROS_MASTER_URI"
        )


class ManagerClient:
    """Client of one controller manager's services; it raises FailureError if the manager refuses a request.

    Args:
        namespace: namespace of the robot; a relative name is resolved in the process's namespace.
    """

    def __init__(self, namespace: str = "") -> None:
        self._prefix = f"{namespace.rstrip('/')}/controller_manager" if namespace else "controller_manager"

    def service(self, name: str) -> str:
        """Return the absolute name of a service of the manager."""
        resolved: str = rospy.resolve_name(f"{self._prefix}/{name}")
        return resolved

    def wait(self, timeout: float | None, say: Callable[[str], None]) -> None:
        """Wait for the manager's services, and report a missing one every 5 s.

        Args:
            timeout: longest wait [s of wall time]; None: no limit.
            say: function that prints a line of text.

        Raises:
            HricError: a service is still missing after the timeout.
        """
        begin = reported = time.monotonic()
        for name in map(self.service, SERVICES):
            while not _service_is_there(name, 0.5):
                if rospy.is_shutdown():
                    raise FailureError(f"interrupted while waiting for the service {name}")
                now = time.monotonic()
                if timeout is not None and now - begin > timeout:
                    raise FailureError(
                        f"no service {name} after {timeout:g} s: is the robot node running, and is the namespace right?"
                    )
                if now - reported > 5.0 or reported == begin:
                    reported = now
                    say(f"waiting for the service {name}")

    def list(self) -> Sequence[Any]:
        """Return the loaded controllers, as controller_manager_msgs/ControllerState."""
        controllers: Sequence[Any] = self._call("list_controllers", ListControllers).controller
        return controllers

    def types(self) -> Sequence[tuple[str, str]]:
        """Return (type, base class) of the controllers that can be loaded."""
        response = self._call("list_controller_types", ListControllerTypes)
        return list(zip(response.types, response.base_classes, strict=True))

    def load(self, name: str) -> None:
        """Load the controller with this name."""
        self._demand(self._call("load_controller", LoadController, name), f"{name} could not be loaded")

    def unload(self, name: str) -> None:
        """Unload the controller with this name."""
        self._demand(self._call("unload_controller", UnloadController, name), f"{name} could not be unloaded")

    def switch(
        self, start: Sequence[str], stop: Sequence[str], strictness: int = SwitchControllerRequest.STRICT
    ) -> None:
        """Stop and start controllers within one control cycle; for `strictness` see SwitchController.srv."""
        request = SwitchControllerRequest(start_controllers=start, stop_controllers=stop, strictness=strictness)
        action = " and ".join(
            f"{verb} {', '.join(names)}" for verb, names in (("start", start), ("stop", stop)) if names
        )
        self._demand(self._call("switch_controller", SwitchController, request), f"could not {action}")

    def reload(self, force_kill: bool) -> None:
        """Reload the Python modules of the controllers; `force_kill`: stop and unload all controllers first."""
        self._demand(
            self._call("reload_controller_libraries", ReloadControllerLibraries, force_kill),
            "could not reload the libraries",
        )

    def _demand(self, response: Any, refusal: str) -> None:
        if not response.ok:
            raise FailureError(f"{refusal}: {rospy.get_param(self.service(REFUSAL), 'no reason was given')}")

    def _call(self, name: str, service_type: Any, *request: Any) -> Any:
        full = self.service(name)
        try:
            return rospy.ServiceProxy(full, service_type)(*request)
        except (rospy.ServiceException, rospy.ROSException) as error:
            raise FailureError(f"the service {full} failed: {error}") from error


def _service_is_there(name: str, timeout: float) -> bool:
    try:
        rospy.wait_for_service(name, timeout)
    except rospy.ROSException:
        return False
    return True
