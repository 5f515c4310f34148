"""The motion capture of a live experiment: waits until it sees the body, then lets the emulated human begin, if there
is one."""

from typing import Any

import rosgraph
import rospy
from std_srvs.srv import Trigger

from hric_analysis.tracking_record import FRAMES
from hric_core.errors import FailureError
from hric_msgs.msg import MocapData
from hric_run.definition.parameters import EMULATED_HUMAN, MOCAP_CLIENT


class LiveHuman:
    """What an experiment with a section `mocap` waits for and starts.

    Args:
        body: of the section.
    """

    def __init__(self, body: str) -> None:
        self._body, self._bodies, self._tracked = body, "", False
        self._topic = rospy.resolve_name(FRAMES)
        self._subscriber: Any = rospy.Subscriber(self._topic, MocapData, self._on_frame, queue_size=1)

    def _on_frame(self, message: Any) -> None:
        self._bodies = ", ".join(body.name for body in message.rigid_bodies) or "no body"
        self._tracked = any(body.name == self._body and body.tracking_valid for body in message.rigid_bodies)

    def missing(self) -> list[str]:
        """What is not there yet: frames, or the body in them."""
        if self._tracked:
            if self._subscriber is not None:
                self._subscriber.unregister()
                self._subscriber = None
            return []
        if not self._bodies:
            return [f"nothing on {self._topic}; does {MOCAP_CLIENT} run?"]
        return [f"{self._topic} does not track {self._body}; it has {self._bodies}"]

    def nodes(self) -> list[str]:
        """Names of the motion capture's nodes that run."""
        published = rosgraph.Master(rospy.get_name()).getSystemState()[0]
        own = {rospy.resolve_name(name) for name in (MOCAP_CLIENT, EMULATED_HUMAN)}
        return sorted(own & {node for _, nodes in published for node in nodes})

    def start(self) -> None:
        """Let the emulated human begin, if there is one.

        Raises:
            HricError: he refuses.
        """
        service = self._service()
        if not service:
            rospy.loginfo("no emulated human: whoever carries %s may move it now", self._body)
            return
        try:
            response = rospy.ServiceProxy(service, Trigger)()
        except rospy.ServiceException as error:
            raise FailureError(f"{service} does not respond: {error}") from error
        if not response.success:
            raise FailureError(f"{service}: {response.message}")
        rospy.loginfo("%s", response.message)

    def _service(self) -> str:
        """Name of the service that starts him, in this namespace; "": none."""
        name: str = rospy.resolve_name(f"{EMULATED_HUMAN}/start")
        try:
            rosgraph.Master(rospy.get_name()).lookupService(name)
        except (rosgraph.MasterError, OSError):
            return ""
        return name
