"""Motion capture and emulated human of a live experiment: waits until the body is tracked, then starts the human."""

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
        """Return messages on what is missing: motion capture frames, or the tracked body in them; empty: ready."""
        if self._tracked:
            if self._subscriber is not None:
                self._subscriber.unregister()
                self._subscriber = None
            return []
        if not self._bodies:
            return [f"no messages on {self._topic}; is the node {MOCAP_CLIENT} running?"]
        return [f"the body {self._body} is not tracked on {self._topic}; bodies in the frames: {self._bodies}"]

    def nodes(self) -> list[str]:
        """Return the names of the running motion capture nodes: client and emulated human."""
        published = rosgraph.Master(rospy.get_name()).getSystemState()[0]
        sources = {rospy.resolve_name(name) for name in (MOCAP_CLIENT, EMULATED_HUMAN)}
        return sorted(sources & {node for _, nodes in published for node in nodes})

    def start(self) -> None:
        """Start the emulated human, if there is one.

        Raises:
            HricError: the service does not respond or reports an error.
        """
        service = self._service()
        if not service:
            rospy.loginfo("no emulated human: the person with the body %s can move now", self._body)
            return
        rospy.loginfo("%s", live_node.trigger(service, f"{service} does not respond", service))

    def _service(self) -> str:
        """Return the name of the service that starts the emulated human in this namespace; "": there is none."""
        name: str = rospy.resolve_name(f"{EMULATED_HUMAN}/start")
        try:
            rosgraph.Master(rospy.get_name()).lookupService(name)
        except (rosgraph.MasterError, OSError):
            return ""
        return name
