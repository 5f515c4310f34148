"""Publisher of NatNet frames on ROS topics: the same code live, on rospy, and headless, on a `LocalNode`."""

import math
import re
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Point, PointStamped, Pose2D, PoseStamped, Quaternion
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from hric_core.geometry import Pose, Vector, compose, from_rotation_vector, stamped
from hric_core.node import Node, Publisher
from hric_core.robot_time import stamps
from hric_msgs.msg import MocapData
from mocap_natnet.client import Received
from mocap_natnet.codec.descriptions import ServerModel
from mocap_natnet.node import messages
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.tracking.tracking import TrackedBody, Tracker
from mocap_natnet.tracking.validity import PoseValidator

TRAIL_TOPIC = "mocap/trail"
POINTS_RATE = 50.0
"""Points of a body's trail in rviz per second of robot time.

The constants of the trail are project defaults, unconfirmed.
"""
PIECE = 10
"""Number of line segments of the trail per message."""
BREAK = 0.25
"""Time between two positions beyond which the trail is interrupted [s]."""
TRAIL_WIDTH = 0.004
"""Width of the trail's line [m]."""
TRAIL_COLOUR = (0.95, 0.45, 0.1, 0.9)
"""Colour of the trail: orange; red, green, blue, alpha."""
NS = 1e-9
BACK = 0.1
"""Largest backward step of a stamp that is corrected to keep stamps in order [s]; after more, the run restarted.

Project default, unconfirmed.
"""
MIN_STEP = 2e-9
"""Minimum time between two stamps [s], so that they differ in whole nanoseconds.

It is small, since a real Motive continues to stream while the run is paused.
"""


class Trail:
    """Publisher of a body's trail for rviz, in pieces: visualization_msgs/Marker of type LINE_STRIP.

    Args:
        node: node that publishes.
        length: time for which a piece is shown [s].
    """

    def __init__(self, node: Node, length: float) -> None:
        self._publisher = node.advertise(node.beside(TRAIL_TOPIC), Marker, queue_size=10)
        self._length, self._points, self._pieces = length, list[Vector](), 0
        self._last = float("-inf")

    def add(self, head: Any, time: float, position: Vector) -> None:
        """Add a position of the body.

        Args:
            head: header with stamp and tf frame.
            time: stamp in seconds [s].
            position: position in the tf frame [m].
        """
        since = time - self._last
        if 0.0 <= since < 1.0 / POINTS_RATE:
            return
        if not 0.0 <= since < BREAK:
            self._points = []
        self._last = time
        self._points.append(position)
        if len(self._points) > PIECE:
            self._publisher.publish(self._piece(head))
            self._points = [position]

    def _piece(self, head: Any) -> Any:
        piece = Marker(header=head, ns="trail", id=self._pieces % 2**31, type=Marker.LINE_STRIP, action=Marker.ADD)
        self._pieces += 1
        piece.pose.orientation, piece.scale.x = Quaternion(w=1.0), TRAIL_WIDTH
        piece.color.r, piece.color.g, piece.color.b, piece.color.a = TRAIL_COLOUR
        piece.lifetime = stamps.to_duration(self._length)
        piece.points = [Point(*point) for point in self._points]
        return piece


def ros_name(body: str) -> str:
    """Return a body's name with all characters replaced that a ROS topic or frame must not have."""
    clean = re.sub(r"\W", "_", body, flags=re.ASCII)
    return clean if re.match(r"[A-Za-z]", clean) else f"body_{clean}"


class MocapPublisher:
    """Publisher that converts frames to messages; called from one thread.

    Args:
        node: node that publishes.
        publishing: settings of topics and frames.
        robot_time: function from monotonic time [ns] to robot time [s]; None while that is not known: then nothing is
            published.

    Attributes:
        tracker: tracker that names and validates the bodies.
        untimed: number of frames received before robot time was known.
        held: number of frames whose stamp was moved forward, because it would have equalled the last one, as in a
            paused run, or gone back a little.
    """

    def __init__(self, node: Node, publishing: Publishing, robot_time: Callable[[int], float | None]) -> None:
        self._node, self._publishing, self._robot_time = node, publishing, robot_time
        base = publishing.base_from_mocap if publishing.base_frame else None
        self.tracker = Tracker(publishing.up_axis, base, PoseValidator(publishing.volume, publishing.max_speed))
        self.untimed = self.held = 0
        self._last = (0, float("-inf"))
        self._data = self._advertise("hric/perception/mocap", MocapData)
        self._point = self._advertise("mocap/marker", Point)
        self._stamped = self._advertise("mocap/marker_stamped", PointStamped)
        self._tf = node.advertise("/tf", TFMessage, queue_size=100) if publishing.tf_rate else None
        self._balls = self._advertise("mocap/markers", MarkerArray, 10) if publishing.markers_rate else None
        self._trail = Trail(node, publishing.trail_length) if publishing.trail_length else None
        self._publishers: dict[tuple[str, str], Publisher] = {}
        self._next_tf = self._next_balls = float("-inf")
        self._was_valid: dict[str, bool] = {}

    def describe(self, model: ServerModel) -> None:
        """Store a description of the server's bodies."""
        self.tracker.describe(model)

    def restart(self) -> None:
        """Forget the state of the tracked bodies, because another stream begins."""
        self.tracker.restart()
        self._next_tf = self._next_balls = float("-inf")

    def publish(self, received: Received) -> None:
        """Publish the bodies and markers of a received frame."""
        time = self._time(received.exposed)
        if time is None:
            self.untimed += 1
            return
        head = stamped.header(stamps.to_time(time), self._publishing.frame)
        frame = received.frame
        bodies = self.tracker.bodies(frame, received.exposed * NS, received.received * NS)
        if self._data.subscribers():
            latency = (received.received - received.exposed) * NS if received.means != "reception" else float("nan")
            self._data.publish(messages.mocap_data(head, frame.number, bodies, self.tracker.markers(frame), latency))
        self._publish_bodies(head, time, bodies)
        if self._tf is not None and time >= self._next_tf:
            self._next_tf = _next(self._next_tf, time, self._publishing.tf_rate)
            self._publish_tf(self._tf, head, bodies, self.tracker.bones(frame))
        if self._balls is not None and time >= self._next_balls:
            self._next_balls = _next(self._next_balls, time, self._publishing.markers_rate)
            if self._balls.subscribers():
                self._balls.publish(messages.marker_array(head, self.tracker.markers(frame)))

    def _time(self, exposed: int) -> float | None:
        """Return the robot time of an exposure [s]; it increases for frames in order, also in a paused run."""
        time = self._robot_time(exposed)
        if time is None or time < 0:
            return None
        before, last = self._last
        step = max(MIN_STEP, math.ulp(time))
        if exposed > before and last - BACK < time < last + step:
            self.held += 1
            time = last + step
        if exposed > before:
            self._last = (exposed, time)
        return time

    def _publish_bodies(self, head: Any, time: float, bodies: list[TrackedBody]) -> None:
        preset = self._publishing.preset
        followed = next((body for body in bodies if self._publishing.body in ("", body.name)), None)
        if followed is not None:
            self._publish_followed(head, time, followed)
        for body in bodies:
            if self._was_valid.get(body.name) != body.valid:
                self._log_tracking(body)
            if body.valid:
                pose = self._of_body(preset.pose, body.name, PoseStamped)
                if pose.subscribers():
                    pose.publish(stamped.pose_stamped(head, body.pose))
                if preset.ground_pose:
                    self._of_body(preset.ground_pose, body.name, Pose2D).publish(messages.ground_pose(body))

    def _publish_followed(self, head: Any, time: float, followed: TrackedBody) -> None:
        if not followed.valid:
            return
        if self._point.subscribers():
            self._point.publish(stamped.point_message(followed.pose.position))
        if self._stamped.subscribers():
            self._stamped.publish(messages.point_stamped(head, followed))
        if self._trail is not None:
            self._trail.add(head, time, followed.pose.position)

    def _publish_tf(self, tf: Publisher, head: Any, bodies: list[TrackedBody], bones: list[tuple[str, Pose]]) -> None:
        child = self._publishing.preset.child
        transforms = [
            stamped.transform_stamped(head, child.format(ros_name(body.name)), body.pose)
            for body in bodies
            if body.valid
        ]
        transforms += [
            stamped.transform_stamped(head, "/".join(map(ros_name, name.split("/"))), pose) for name, pose in bones
        ]
        if transforms:
            tf.publish(TFMessage(transforms))

    def _of_body(self, pattern: str, body: str, kind: type) -> Publisher:
        """Return the publisher of a body's topic; `{}` in the pattern is replaced by the body's name."""
        if (pattern, body) not in self._publishers:
            self._publishers[pattern, body] = self._advertise(pattern.format(ros_name(body)), kind)
        return self._publishers[pattern, body]

    def _advertise(self, topic: str, kind: type, queue_size: int = 100) -> Publisher:
        return self._node.advertise(self._node.beside(topic), kind, queue_size=queue_size)

    def _log_tracking(self, body: TrackedBody) -> None:
        """Log that tracking of a body was lost or found again."""
        if body.valid:
            self._node.log_info(f"{body.name}: tracked")
        elif body.name in self._was_valid:
            self._node.log_warn(f"{body.name}: tracking lost")
        self._was_valid[body.name] = body.valid


def static_transform(publishing: Publishing, stamp: Any) -> Any:
    """Return tf2_msgs/TFMessage with the pose of the stream's frame in the base or parent frame; None without one."""
    base = publishing.base_frame or publishing.parent_frame
    if not base:
        return None
    axes = Pose((0.0, 0.0, 0.0), from_rotation_vector((math.pi / 2, 0.0, 0.0))) if publishing.up_axis == "y" else Pose()
    pose = compose(publishing.base_from_mocap, axes)
    return TFMessage([stamped.transform_stamped(stamped.header(stamp, base), publishing.preset.frame, pose)])


def _next(due: float, time: float, rate: float) -> float:
    """Return the time at which the next message is due [s], on a grid, so that the mean rate is exact."""
    following = due + 1 / rate
    return following if following > time else time + 1 / rate
