"""Messages of points and poses with stamp and frame.

They are created without genpy's constructors, whose checks and defaults take several times as long as setting the
fields.
"""

from typing import Any

from geometry_msgs.msg import Point, PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from std_msgs.msg import Header

from hric_core.geometry.poses import Pose
from hric_core.geometry.quaternions import Vector

_new: Any = object.__new__


def point_message(position: Vector) -> Any:
    """Return a geometry_msgs/Point."""
    point = _new(Point)
    point.x, point.y, point.z = position
    return point


def pose_message(pose: Pose) -> Any:
    """Return a geometry_msgs/Pose."""
    message, orientation = _new(PoseMessage), _new(Quaternion)
    orientation.x, orientation.y, orientation.z, orientation.w = pose.orientation
    message.position, message.orientation = point_message(pose.position), orientation
    return message


def header(stamp: Any, frame: str) -> Any:
    """Return a std_msgs/Header."""
    head = _new(Header)
    head.seq, head.stamp, head.frame_id = 0, stamp, frame
    return head


def pose_stamped(head: Any, pose: Pose) -> Any:
    """Return a geometry_msgs/PoseStamped."""
    stamped = _new(PoseStamped)
    stamped.header, stamped.pose = head, pose_message(pose)
    return stamped


def transform_stamped(head: Any, child: str, pose: Pose) -> Any:
    """Return a geometry_msgs/TransformStamped."""
    message, transform = _new(TransformStamped), _new(Transform)
    translation, rotation = _new(Vector3), _new(Quaternion)
    translation.x, translation.y, translation.z = pose.position
    rotation.x, rotation.y, rotation.z, rotation.w = pose.orientation
    transform.translation, transform.rotation = translation, rotation
    message.header, message.child_frame_id, message.transform = head, child, transform
    return message
