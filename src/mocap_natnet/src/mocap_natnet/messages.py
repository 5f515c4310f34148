"""Messages from what was tracked.

Those of each frame are made without genpy's constructors, whose checks and defaults cost several times what setting the fields does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Point, PointStamped, Pose2D, PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from hric_msgs.msg import MocapData, RigidBodyState
from mocap_natnet.codec.types import Vector
from mocap_natnet.poses import Pose
from mocap_natnet.tracking import TrackedBody, TrackedMarker

MARKER_COLOUR = (0.9, 0.9, 0.95, 1.0)
"""Grey-white, as reflective markers are; red, green, blue, alpha."""


_new: Any = object.__new__


def point_message(position: Vector) -> Any:
    """geometry_msgs/Point."""
    point = _new(Point)
    point.x, point.y, point.z = position
    return point


def pose_message(pose: Pose) -> Any:
    """geometry_msgs/Pose."""
    message, turn = _new(PoseMessage), _new(Quaternion)
    turn.x, turn.y, turn.z, turn.w = pose.orientation
    message.position, message.orientation = point_message(pose.position), turn
    return message


def header(stamp: Any, frame: str) -> Any:
    """std_msgs/Header."""
    head = _new(Header)
    head.seq, head.stamp, head.frame_id = 0, stamp, frame
    return head


def mocap_data(head: Any, number: int, bodies: Sequence[TrackedBody], markers: Sequence[TrackedMarker], latency: float) -> Any:
    """hric_msgs/MocapData.

    Args:
        head: stamp and frame.
        number: of the frame; a negative one is not there on the wire of a real server and counts as 0.
        bodies: tracked or not.
        markers: labelled ones.
        latency: from the exposure to the arrival [s].
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
    """geometry_msgs/PointStamped of a body's position."""
    stamped = _new(PointStamped)
    stamped.header, stamped.point = head, point_message(body.pose.position)
    return stamped


def pose_stamped(head: Any, pose: Pose) -> Any:
    """geometry_msgs/PoseStamped."""
    stamped = _new(PoseStamped)
    stamped.header, stamped.pose = head, pose_message(pose)
    return stamped


def ground_pose(body: TrackedBody) -> Any:
    """geometry_msgs/Pose2D: place on the ground, and the angle of the body's x axis in it; for axes with z up."""
    x, y, z, w = body.pose.orientation
    return Pose2D(body.pose.position[0], body.pose.position[1], math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def transform_stamped(head: Any, child: str, pose: Pose) -> Any:
    """geometry_msgs/TransformStamped."""
    message, transform = _new(TransformStamped), _new(Transform)
    move, turn = _new(Vector3), _new(Quaternion)
    move.x, move.y, move.z = pose.position
    turn.x, turn.y, turn.z, turn.w = pose.orientation
    transform.translation, transform.rotation = move, turn
    message.header, message.child_frame_id, message.transform = head, child, transform
    return message


_BALL = Marker(ns="mocap", type=Marker.SPHERE, action=Marker.ADD, color=ColorRGBA(*MARKER_COLOUR))


def marker_array(head: Any, markers: Sequence[TrackedMarker]) -> Any:
    """visualization_msgs/MarkerArray: a ball per labelled marker; those of the message before are taken away."""
    found = MarkerArray([Marker(header=head, ns="mocap", action=Marker.DELETEALL)])
    for index, marker in enumerate(markers):
        ball = _new(Marker)
        for field in Marker.__slots__:
            setattr(ball, field, getattr(_BALL, field))
        ball.header, ball.id, ball.pose = head, index, pose_message(Pose(marker.position))
        ball.scale = Vector3(marker.size, marker.size, marker.size)
        found.markers.append(ball)
    return found
