"""Node `natnet_client`: receives a NatNet stream, and publishes it on ROS topics."""

import time
from collections import deque
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_srvs.srv import Trigger, TriggerResponse
from tf2_msgs.msg import TFMessage

from hric_core.errors import HricError
from hric_core.robot_time.follower import RobotTime
from hric_core.robot_time.progress import ProgressReport
from hric_core.ros import RosNode
from hric_core.ros.process import NodeApp
from mocap_natnet.client import ClientHealth, ClientSettings, NatNetClient, Received
from mocap_natnet.codec.descriptions import ServerModel
from mocap_natnet.node import take
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.node.publisher import MocapPublisher, static_transform

LAST_WORDS = 0.5
"""Longest time for which queued frames are still published after a shutdown request [s].

Project default, unconfirmed.
"""
_RESTART = "restart"
_SERVICES = {
    "start_recording": take.START,
    "stop_recording": take.STOP,
    "live_mode": "LiveMode",
    "edit_mode": "EditMode",
}


class ClientNode(NodeApp):
    """Node `natnet_client`: NatNet client and publisher in one thread, diagnostics and services.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: RosNode) -> None:
        self._node = node
        self._settings, self._publishing = ClientSettings.read(node), Publishing.read(node)
        self._robot_time, self._progress = RobotTime(node), ProgressReport(node)
        self._publisher = MocapPublisher(node, self._publishing, self._robot_time.robot_time)
        # Frames that arrive while one is published wait here, not in the kernel, which drops them when it has no room.
        self._queue: deque[Received | ServerModel | str] = deque()
        self._client = NatNetClient(
            self._settings, self._queue.append, self._queue.append, lambda: self._queue.append(_RESTART), self._work
        )
        self._recorder = take.TakeRecorder(node, self._client.request) if self._publishing.record else None
        self._diagnostics = node.advertise("/diagnostics", DiagnosticArray)
        self._health = ""
        for name in _SERVICES:
            node.service(name, Trigger, lambda request, name=name: self._serve(name))  # type: ignore[misc]
        self._static = self._publish_static()
        self._client.start()

    def close(self) -> None:
        """Stop the client, and publish the frames that are still queued, for at most LAST_WORDS."""
        self._robot_time.close()
        if self._recorder is not None:
            self._recorder.close()
        self._client.close()
        end = time.monotonic() + LAST_WORDS
        while self._work() and time.monotonic() < end:
            pass
        self._progress.close()

    def tick(self) -> None:
        """Publish the diagnostics, and log changes of the stream's health.

        Raises:
            HricError: the run is not paced.
        """
        self._robot_time.tick()
        state, values = self._client.health(), self._values()
        if state.level and self._robot_time.standing:
            state = ClientHealth(DiagnosticStatus.WARN, f"the run is paused or has not begun; {state.text}")
        elif state.level and state.text != self._health:
            (self._node.log_error if state.level == DiagnosticStatus.ERROR else self._node.log_warn)(state.text)
        elif not state.level and self._health != "":
            self._node.log_info(state.text)
        self._health = state.text if state.level else ""
        message = DiagnosticArray()
        message.header.stamp = self._node.now()
        pairs = [KeyValue(key, str(value)) for key, value in values.items()]
        name = f"{self._node.namespace.strip('/')}: stream"
        message.status.append(DiagnosticStatus(state.level, name, state.text, self._client.server, pairs))
        self._diagnostics.publish(message)

    def _values(self) -> dict[str, object]:
        session, tracker = self._client.session, self._publisher.tracker
        statistics, echo = session.statistics, session.clock.echo
        values: dict[str, object] = {
            "rate [Hz]": f"{statistics.rate(time.monotonic_ns()):.0f}",
            "frames": statistics.frames,
            "frames lost": statistics.lost,
            "latency [ms]": f"{1e3 * statistics.latency():.2f}",
            "connects": statistics.connects,
            "restarts": statistics.restarts,
            "waiting to be published": len(self._queue),
            "source of robot time": self._robot_time.source,
            "frames before robot time was known": self._publisher.untimed,
            "stamps moved forward to stay in order": self._publisher.held,
            "unknown bytes skipped": statistics.skipped,
        }
        if echo is not None and echo.round_trip is not None:
            values |= {"round trip [us]": f"{1e6 * echo.round_trip:.0f}", "clock drift [ppm]": f"{echo.drift:.1f}"}
        values |= {f"times from {means}": count for means, count in statistics.means.copy().items()}
        values |= {f"refused: {reason}": count for reason, count in statistics.refused.copy().items()}
        values |= {f"implausible: {reason}": count for reason, count in tracker.validator.refused.copy().items()}
        return values | {f"tracking lost: {body}": count for body, count in tracker.lost.copy().items()}

    def _work(self) -> bool:
        """Process the oldest queued frame, description or restart; return True if more are queued."""
        queue = self._queue
        if rospy.is_shutdown():
            queue.clear()
        if not queue:
            self._progress.reached(self._robot_time.now())
            return False
        item = queue.popleft()
        if isinstance(item, Received):
            self._publisher.publish(item)
        elif isinstance(item, ServerModel):
            self._publisher.describe(item)
        else:
            self._publisher.restart()
        return bool(queue)

    def _publish_static(self) -> Any:
        message = static_transform(self._publishing, self._node.now())
        if message is None:
            return None
        publisher = self._node.advertise("/tf_static", TFMessage, latch=True)
        publisher.publish(message)
        return publisher

    def _serve(self, name: str) -> Any:
        try:
            if name == "start_recording":
                take.start(self._client.request, self._publishing.take)
            else:
                take.order(self._client.request, _SERVICES[name])
        except HricError as error:
            return TriggerResponse(False, str(error))
        return TriggerResponse(True, "done")
