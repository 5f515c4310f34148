"""Node `equilibrium_marker`: interactive marker with which rviz moves the equilibrium of an impedance controller."""

import math
import time
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import PoseStamped
from interactive_markers.interactive_marker_server import InteractiveMarkerServer
from visualization_msgs.msg import InteractiveMarker, InteractiveMarkerControl, InteractiveMarkerFeedback

from hric_core.parameters import Settings, number, text
from hric_core.ros import RosNode
from hric_core.ros.process import NodeApp

NAME = "equilibrium"
"""Name of the marker."""
RATE = 10.0
"""Rate at which the marker follows the equilibrium while nobody drags it [Hz] (project default, unconfirmed)."""
RELEASE = 2.0
"""Time without feedback after which a dragged marker counts as released [s] (project default, unconfirmed)."""


@dataclass(frozen=True)
class EquilibriumMarkerSettings(Settings):
    """Parameters of the node `equilibrium_marker`."""

    controller: str = text(
        "cartesian_impedance_controller", empty=False, text="name of the controller whose equilibrium the marker moves"
    )
    scale: float = number(0.3, above=0.0, maximum=2.0, unit="m", text="size of the marker")


def marker(pose: Any, scale: float) -> Any:
    """Return a marker with an arrow and a ring for each axis of its frame.

    Args:
        pose: its pose, geometry_msgs/PoseStamped.
        scale: its size [m].
    """
    result = InteractiveMarker(header=pose.header, name=NAME, scale=scale, pose=pose.pose)
    result.header.stamp.secs = result.header.stamp.nsecs = 0  # the newest transform
    result.description = "equilibrium pose"
    half = math.sqrt(0.5)
    for index, axis in enumerate("xyz"):
        for kind, mode in (
            ("move", InteractiveMarkerControl.MOVE_AXIS),
            ("turn", InteractiveMarkerControl.ROTATE_AXIS),
        ):
            control = InteractiveMarkerControl(name=f"{kind}_{axis}", interaction_mode=mode)
            control.orientation.w = half
            # A control acts along its own x axis: for y and z a quarter turn about z and y.
            setattr(control.orientation, "xzy"[index], half)
            result.controls.append(control)
    return result


class EquilibriumMarkerNode(NodeApp):
    """Node that publishes each pose of the dragged marker, and otherwise moves the marker to the equilibrium.

    Args:
        node: private node.
    """

    def __init__(self, node: RosNode) -> None:
        self._settings = EquilibriumMarkerSettings.read(node)
        where = node.beside(self._settings.controller)
        self._server = InteractiveMarkerServer(node.namespace, q_size=10)
        self._dragged, self._shown, self._known = -math.inf, -math.inf, False
        self._equilibrium = node.advertise(f"{where}/equilibrium_pose", PoseStamped, queue_size=1)
        node.subscribe(f"{where}/desired_pose", PoseStamped, self._on_desired, queue_size=1)

    def _on_desired(self, message: Any) -> None:
        """Move the marker, which appears with the first message, to the equilibrium."""
        now = time.monotonic()
        if now < max(self._dragged + RELEASE, self._shown + 1.0 / RATE):
            return
        self._shown = now
        if self._known:
            self._server.setPose(NAME, message.pose)
        else:
            self._server.insert(marker(message, self._settings.scale), self._on_feedback)
            self._known = True
        self._server.applyChanges()

    def _on_feedback(self, feedback: Any) -> None:
        """Publish the pose to which the marker is dragged."""
        released = feedback.event_type == InteractiveMarkerFeedback.MOUSE_UP
        self._dragged = -math.inf if released else time.monotonic()
        if feedback.event_type == InteractiveMarkerFeedback.POSE_UPDATE:
            self._equilibrium.publish(PoseStamped(header=feedback.header, pose=feedback.pose))

    def close(self) -> None:
        """Remove the marker."""
        self._server.clear()
        self._server.applyChanges()
