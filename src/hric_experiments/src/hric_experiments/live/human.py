"""Motion capture of a live experiment: waits until it tracks the body, then starts the emulated human, if any."""

from typing import Any

import rosgraph
import rospy

from hric_analysis.tracking_record import FRAMES
from hric_experiments.live import node as live_node
from hric_msgs.msg import MocapData
from hric_run.definition.parameters import EMULATED_HUMAN, MOCAP_CLIENT


class LiveHuman:
    """Motion capture and emulated human of an experiment with a section `mocap`.

    Args:
        body: name of the tracked body.
    """

    def __init__(self, body: str) -> None:
        self._body, self._bodies, self._tracked = body, "", False
        self._topic = rospy.resolve_name(FRAMES)
        self._subscriber: Any = rospy.Subscriber(self._topic, MocapData, self._on_frame, queue_size=1)

    def _on_frame(self, message: Any) -> None:
        self._bodies = ", ".join(body.name for body in message.rigid_bodies) or "no body"
        self._tracked = any(body.name == self._body and body.tracking_valid for body in message.rigid_bodies)

    def missing(self) -> list[str]:
        """Return what is missing: frames of the motion capture, or the body in them; empty: ready."""
        if self._tracked:
            if self._subscriber is not None:
                self._subscriber.unregister()
                self._subscriber = None
            return []
        if not self._bodies:
            return [f"nothing on {self._topic}; does {MOCAP_CLIENT} run?"]
        return [f"{self._topic} does not track {self._body}; it has {self._bodies}"]

    def nodes(self) -> list[str]:
        """Return the names of the running nodes of the motion capture."""
        published = rosgraph.Master(rospy.get_name()).getSystemState()[0]
        sources = {rospy.resolve_name(name) for name in (MOCAP_CLIENT, EMULATED_HUMAN)}
        return sorted(sources & {node for _, nodes in published for node in nodes})

    def start(self) -> None:
        """Start the emulated human, if there is one.

        Raises:
            HricError: the service does not respond or refuses.
        """
        service = self._service()
        if not service:
            rospy.loginfo("no emulated human: whoever carries %s may move it now", self._body)
            return
        rospy.loginfo("%s", live_node.trigger(service, service, service))

    def _service(self) -> str:
        """Return the name of the service that starts the emulated human in this namespace; "": none."""
        name: str = rospy.resolve_name(f"{EMULATED_HUMAN}/start")
        try:
            rosgraph.Master(rospy.get_name()).lookupService(name)
        except (rosgraph.MasterError, OSError):
            return ""
        return name
