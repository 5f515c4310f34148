"""ROS messages of tracked data; those of each frame are made without genpy's slow constructors."""

import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import PointStamped, Pose2D, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from hric_core.geometry import Pose
from hric_core.geometry.stamped import point_message, pose_message
from hric_msgs.msg import MocapData, RigidBodyState
from mocap_natnet.tracking.tracking import TrackedBody, TrackedMarker

MARKER_COLOUR = (0.9, 0.9, 0.95, 1.0)
"""Colour of marker balls: grey-white, as reflective markers are; red, green, blue, alpha."""


_new: Any = object.__new__


def mocap_data(
    head: Any, number: int, bodies: Sequence[TrackedBody], markers: Sequence[TrackedMarker], latency: float
) -> Any:
    """Return hric_msgs/MocapData.

    Args:
        head: header with stamp and tf frame.
        number: number of the frame; a negative one, which no real server sends, counts as 0.
        bodies: rigid bodies, tracked or not.
        markers: labelled markers.
        latency: time from exposure to arrival [s].
    """
    data = _new(MocapData)
    data.header, data.frame_number, data.latency = head, max(0, number), latency
    data.rigid_bodies = [_body_state(body) for body in bodies]
    data.tracking_valid = any([body.valid for body in bodies])
    data.labelled_marker_names = [marker.name for marker in markers]
    data.labelled_marker_ids = [marker.id for marker in markers]
    data.labelled_markers = [point_message(marker.position) for marker in markers]
    data.marker_sizes = [marker.size for marker in markers]
    return data


def _body_state(body: TrackedBody) -> Any:
    state = _new(RigidBodyState)
    state.name, state.id, state.tracking_valid, state.mean_error = body.name, body.id, body.valid, body.mean_error
    state.pose = pose_message(body.pose)
    return state


def point_stamped(head: Any, body: TrackedBody) -> Any:
    """Return geometry_msgs/PointStamped of a body's position."""
    stamped = _new(PointStamped)
    stamped.header, stamped.point = head, point_message(body.pose.position)
    return stamped


def ground_pose(body: TrackedBody) -> Any:
    """Return geometry_msgs/Pose2D of a body in z-up axes: position on the ground, and yaw of its x axis [rad]."""
    x, y, z, w = body.pose.orientation
    return Pose2D(
        body.pose.position[0], body.pose.position[1], math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    )


_BALL = Marker(ns="mocap", type=Marker.SPHERE, action=Marker.ADD, color=ColorRGBA(*MARKER_COLOUR))


def marker_array(head: Any, markers: Sequence[TrackedMarker]) -> Any:
    """Return visualization_msgs/MarkerArray: one ball per labelled marker; balls of the last message are deleted."""
    message = MarkerArray([Marker(header=head, ns="mocap", action=Marker.DELETEALL)])
    for index, marker in enumerate(markers):
        ball = _new(Marker)
        for field in Marker.__slots__:
            setattr(ball, field, getattr(_BALL, field))
        ball.header, ball.id, ball.pose = head, index, pose_message(Pose(marker.position))
        ball.scale = Vector3(marker.size, marker.size, marker.size)
        message.markers.append(ball)
    return message
