"""Publishes frames: the same from a wire, on rospy, and headless on a LocalNode."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Point, PointStamped, Pose2D, PoseStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from hric_control import stamps
from hric_control.node import Node, Publisher
from hric_msgs.msg import MocapData
from mocap_natnet import messages
from mocap_natnet.client import Received
from mocap_natnet.codec.descriptions import Model
from mocap_natnet.parameters import Publishing
from mocap_natnet.plausibility import Plausibility
from mocap_natnet.poses import Pose, compose, from_rotation_vector
from mocap_natnet.tracking import TrackedBody, Tracker
from mocap_natnet.trail import Trail

NS = 1e-9
BACK = 0.1
"""A stamp that would go back by less than this is held; by more, the run began anew [s] (our choice)."""
LEAST_STEP = 2e-9
"""Between two stamps, which have whole nanoseconds, or what a float can tell apart [s]: small, since a real Motive goes on while the run stands."""


def ros_name(body: str) -> str:
    """A name that ROS takes for a topic and a frame."""
    clean = re.sub(r"\W", "_", body, flags=re.ASCII)
    return clean if re.match(r"[A-Za-z]", clean) else f"body_{clean}"


class MocapPublisher:
    """Turns frames into messages. One thread calls it.

    Args:
        node: where to advertise.
        publishing: what, and how.
        run_time: maps the monotonic clock [ns] to the time of the run [s]; None while that is not known: nothing is published then.

    Attributes:
        tracker: names and judges the bodies.
        untimed: frames that came before the time of the run was known.
        held: frames whose stamp would have been that of the one before, since the run stood, or would have gone back a little.
    """

    def __init__(self, node: Node, publishing: Publishing, run_time: Callable[[int], float | None]) -> None:
        self._node, self._publishing, self._run_time = node, publishing, run_time
        base = publishing.base_from_mocap if publishing.base_frame else None
        self.tracker = Tracker(publishing.up_axis, base, Plausibility(publishing.limits))
        self.untimed = self.held = 0
        self._last = (0, float("-inf"))
        self._data = node.advertise("/hric/perception/mocap", MocapData, queue_size=100)
        self._point = node.advertise("/mocap/marker", Point, queue_size=100)
        self._stamped = node.advertise("/mocap/marker_stamped", PointStamped, queue_size=100)
        self._tf = node.advertise("/tf", TFMessage, queue_size=100) if publishing.tf_rate else None
        self._balls = node.advertise("/mocap/markers", MarkerArray, queue_size=10) if publishing.markers_rate else None
        self._trail = Trail(node, publishing.trail_length) if publishing.trail_length else None
        self._poses: dict[str, Publisher] = {}
        self._grounds: dict[str, Publisher] = {}
        self._next_tf = self._next_balls = float("-inf")
        self._told: dict[str, bool] = {}

    def describe(self, model: Model) -> None:
        """Take a description."""
        self.tracker.describe(model)

    def restart(self) -> None:
        """Another stream."""
        self.tracker.restart()
        self._next_tf = self._next_balls = float("-inf")

    def publish(self, received: Received) -> None:
        """Publish a frame."""
        time = self._time(received.exposed)
        if time is None:
            self.untimed += 1
            return
        head = messages.header(stamps.to_time(time), self._publishing.frame)
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
        """Time of the run at an exposure [s]; of frames in order it rises, also where the run stands."""
        time = self._run_time(exposed)
        if time is None or time < 0:
            return None
        before, last = self._last
        step = max(LEAST_STEP, math.ulp(time))
        if exposed > before and last - BACK < time < last + step:
            self.held += 1
            time = last + step
        if exposed > before:
            self._last = (exposed, time)
        return time

    def _publish_bodies(self, head: Any, time: float, bodies: list[TrackedBody]) -> None:
        wanted = self._publishing.body
        for body in bodies:
            if wanted in ("", body.name):
                self._publish_followed(head, time, body)
                break
        for body in bodies:
            if self._told.get(body.name) != body.valid:
                self._tell(body)
            if body.valid:
                pose = self._pose(body.name)
                if pose.subscribers():
                    pose.publish(messages.pose_stamped(head, body.pose))
                if self._publishing.preset.ground_pose:
                    self._ground(body.name).publish(messages.ground_pose(body))

    def _publish_followed(self, head: Any, time: float, followed: TrackedBody) -> None:
        if not followed.valid:
            return
        if self._point.subscribers():
            self._point.publish(messages.point_message(followed.pose.position))
        if self._stamped.subscribers():
            self._stamped.publish(messages.point_stamped(head, followed))
        if self._trail is not None:
            self._trail.add(head, time, followed.pose.position)

    def _publish_tf(self, tf: Publisher, head: Any, bodies: list[TrackedBody], bones: list[tuple[str, Pose]]) -> None:
        child = self._publishing.preset.child
        transforms = [messages.transform_stamped(head, child.format(ros_name(body.name)), body.pose) for body in bodies if body.valid]
        transforms += [messages.transform_stamped(head, "/".join(map(ros_name, name.split("/"))), pose) for name, pose in bones]
        if transforms:
            tf.publish(TFMessage(transforms))

    def _pose(self, body: str) -> Publisher:
        found = self._poses.get(body)
        if found is None:
            found = self._node.advertise(self._publishing.preset.pose.format(ros_name(body)), PoseStamped, queue_size=100)
            self._poses[body] = found
        return found

    def _ground(self, body: str) -> Publisher:
        if body not in self._grounds:
            self._grounds[body] = self._node.advertise(self._publishing.preset.ground_pose.format(ros_name(body)), Pose2D, queue_size=100)
        return self._grounds[body]

    def _tell(self, body: TrackedBody) -> None:
        """Log that tracking was lost or found."""
        if body.valid:
            self._node.log_info(f"{body.name}: tracked")
        elif body.name in self._told:
            self._node.log_warn(f"{body.name}: tracking lost")
        self._told[body.name] = body.valid


def static_transform(publishing: Publishing, stamp: Any) -> Any:
    """tf2_msgs/TFMessage: the pose of the stream's frame in the base, axes of the stream included; None where no base is named."""
    base = publishing.base_frame or publishing.parent_frame
    if not base:
        return None
    axes = Pose((0.0, 0.0, 0.0), from_rotation_vector((math.pi / 2, 0.0, 0.0))) if publishing.up_axis == "y" else Pose()
    pose = compose(publishing.base_from_mocap, axes)
    return TFMessage([messages.transform_stamped(messages.header(stamp, base), publishing.preset.frame, pose)])


def _next(due: float, time: float, rate: float) -> float:
    """When the next one is due, on a grid, so that a rate is kept on average [s]."""
    following = due + 1 / rate
    return following if following > time else time + 1 / rate
