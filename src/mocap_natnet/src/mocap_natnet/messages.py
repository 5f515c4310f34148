"""Messages from what was tracked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Point, PointStamped, Pose2D, PoseStamped, Quaternion, TransformStamped, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from hric_msgs.msg import MocapData, RigidBodyState
from mocap_natnet.poses import Pose
from mocap_natnet.tracking import TrackedBody, TrackedMarker

MARKER_COLOUR = (0.9, 0.9, 0.95, 1.0)
"""Grey-white, as reflective markers are; red, green, blue, alpha."""


def pose_message(pose: Pose) -> Any:
    """geometry_msgs/Pose."""
    return PoseMessage(Point(*pose.position), Quaternion(*pose.orientation))


def header(stamp: Any, frame: str) -> Any:
    """std_msgs/Header."""
    return Header(stamp=stamp, frame_id=frame)


def mocap_data(head: Any, number: int, bodies: Sequence[TrackedBody], markers: Sequence[TrackedMarker], latency: float) -> Any:
    """hric_msgs/MocapData.

    Args:
        head: stamp and frame.
        number: of the frame; a negative one is not there on the wire of a real server and counts as 0.
        bodies: tracked or not.
        markers: labelled ones.
        latency: from the exposure to the arrival [s].
    """
    return MocapData(
        header=head,
        frame_number=max(0, number),
        tracking_valid=any(body.valid for body in bodies),
        rigid_bodies=[RigidBodyState(body.name, body.id, pose_message(body.pose), body.valid, body.mean_error) for body in bodies],
        labelled_marker_names=[marker.name for marker in markers],
        labelled_marker_ids=[marker.id for marker in markers],
        labelled_markers=[Point(*marker.position) for marker in markers],
        marker_sizes=[marker.size for marker in markers],
        latency=latency,
    )


def point_stamped(head: Any, body: TrackedBody) -> Any:
    """geometry_msgs/PointStamped of a body's position."""
    return PointStamped(head, Point(*body.pose.position))


def pose_stamped(head: Any, body: TrackedBody) -> Any:
    """geometry_msgs/PoseStamped of a body."""
    return PoseStamped(head, pose_message(body.pose))


def ground_pose(body: TrackedBody) -> Any:
    """geometry_msgs/Pose2D: place on the ground, and the angle of the body's x axis in it; for axes with z up."""
    x, y, z, w = body.pose.orientation
    return Pose2D(body.pose.position[0], body.pose.position[1], math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def transform_stamped(head: Any, child: str, pose: Pose) -> Any:
    """geometry_msgs/TransformStamped."""
    message = TransformStamped(header=head, child_frame_id=child)
    message.transform.translation, message.transform.rotation = Vector3(*pose.position), Quaternion(*pose.orientation)
    return message


def marker_array(head: Any, markers: Sequence[TrackedMarker]) -> Any:
    """visualization_msgs/MarkerArray: a ball per labelled marker; those of the message before are taken away."""
    found = MarkerArray([Marker(header=head, ns="mocap", action=Marker.DELETEALL)])
    for index, marker in enumerate(markers):
        ball = Marker(header=head, ns="mocap", id=index, type=Marker.SPHERE, action=Marker.ADD)
        ball.pose = PoseMessage(Point(*marker.position), Quaternion(w=1.0))
        ball.scale = Vector3(marker.size, marker.size, marker.size)
        ball.color.r, ball.color.g, ball.color.b, ball.color.a = MARKER_COLOUR
        found.markers.append(ball)
    return found
