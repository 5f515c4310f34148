"""Supervisor as a ROS node."""

import threading
from typing import Any

import rospy

from hric_core.errors import HricError
from hric_core.ros import RosNode, run
from hric_core.ros.process import NodeApp
from hric_supervisor.app import SupervisorApp
from hric_supervisor.settings import SupervisorNodeSettings

CONTROLLERS_PERIOD = 0.5
"""Period at which running controllers are checked [s of wall time] (project default, unconfirmed)."""
CALL_TIMEOUT = 2.0
"""Maximum time to wait for a service [s of wall time] (project default, unconfirmed)."""


class SupervisorNode(NodeApp):
    """ROS node of the supervisor: it decides on each new pose of a person, and at its rate without new poses.

    Args:
        node: node of the supervisor, with private names.
    """

    def __init__(self, node: RosNode) -> None:
        self._node, self._app = node, SupervisorApp(node, _call)
        self.period = 1.0 / self._app.settings.rate
        self._decided, self._deciding = -1.0, threading.Lock()
        self._stop = threading.Event()
        self._app.on_person(self._decide)
        self._thread = threading.Thread(target=self._watch_controllers, name="controllers", daemon=True)
        self._thread.start()

    def tick(self) -> None:
        """Decide even without a new pose, so that stale data is detected."""
        self._decide()

    def _decide(self) -> None:
        """Decide unless the last decision was less than half a period ago in robot time."""
        now = self._node.now().to_sec()
        with self._deciding:
            if now <= 0.0 or 0.0 <= now - self._decided < 0.5 * self.period:
                return
            self._decided = now
        self._app.decide(now)

    def _watch_controllers(self) -> None:
        while not self._stop.wait(CONTROLLERS_PERIOD):
            try:
                self._app.stop_others(self._node.now().to_sec())
            except HricError as error:
                rospy.logwarn_throttle(
                    10.0, f"controllers that do not obey the speed scale cannot be found, nor stopped: {error}"
                )

    def close(self) -> None:
        """Stop the node and log the latencies of its slow-downs."""
        self._stop.set()
        self._thread.join(CALL_TIMEOUT)
        self._node.log_info(self._app.latency_text())
        self._app.close()


def _call(name: str, service: type, request: Any) -> Any:
    try:
        rospy.wait_for_service(name, CALL_TIMEOUT)
        return rospy.ServiceProxy(name, service)(request)
    except (rospy.ROSException, rospy.ServiceException) as error:
        raise HricError(f"{name}: {error}") from error


def main(text: str) -> int:
    """Run the node and return its exit code; text: description for --help."""
    return run("supervisor", text, SupervisorNode, SupervisorNodeSettings)
