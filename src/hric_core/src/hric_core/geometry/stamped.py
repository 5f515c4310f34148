"""Fast construction of ROS messages for points, poses, twists and wrenches, also with stamp and frame.

The constructors of genpy are not used, as their checks and defaults take several times as long as setting the fields.
"""

from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import (
    Point,
    PoseStamped,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
    Wrench,
    WrenchStamped,
)
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import Quaternion as QuaternionMessage
from std_msgs.msg import Header

from hric_core.geometry.poses import Pose
from hric_core.geometry.quaternions import Quaternion, Vector

_new: Any = object.__new__


def point_message(position: Vector) -> Any:
    """Return a position [m] as geometry_msgs/Point."""
    point = _new(Point)
    point.x, point.y, point.z = position
    return point


def vector_message(vector: Sequence[float]) -> Any:
    """Return a vector of 3 floats as geometry_msgs/Vector3."""
    message = _new(Vector3)
    message.x, message.y, message.z = vector
    return message


def _quaternion_message(quaternion: Quaternion) -> Any:
    message = _new(QuaternionMessage)
    message.x, message.y, message.z, message.w = quaternion
    return message


def pose_message(pose: Pose) -> Any:
    """Return a pose as geometry_msgs/Pose."""
    message = _new(PoseMessage)
    message.position, message.orientation = point_message(pose.position), _quaternion_message(pose.orientation)
    return message


def twist_message(twist: Sequence[float]) -> Any:
    """Return a twist (linear, then angular velocity, 6 floats [m/s], [rad/s]) as geometry_msgs/Twist."""
    message = _new(Twist)
    message.linear, message.angular = vector_message(twist[:3]), vector_message(twist[3:])
    return message


def wrench_message(wrench: Sequence[float]) -> Any:
    """Return a wrench (force, then torque, 6 floats [N], [N m]) as geometry_msgs/Wrench."""
    return wrench_of(wrench[:3], wrench[3:])


def wrench_of(force: Sequence[float], torque: Sequence[float]) -> Any:
    """Return force [N] and torque [N m], 3 floats each, as geometry_msgs/Wrench."""
    message = _new(Wrench)
    message.force, message.torque = vector_message(force), vector_message(torque)
    return message


def header(stamp: Any, frame: str) -> Any:
    """Return a std_msgs/Header with this stamp and frame id."""
    head = _new(Header)
    head.seq, head.stamp, head.frame_id = 0, stamp, frame
    return head


def pose_stamped(head: Any, pose: Pose) -> Any:
    """Return a pose as geometry_msgs/PoseStamped with this header."""
    stamped = _new(PoseStamped)
    stamped.header, stamped.pose = head, pose_message(pose)
    return stamped


def wrench_stamped(head: Any, wrench: Sequence[float]) -> Any:
    """Return a wrench (force, then torque, 6 floats [N], [N m]) as geometry_msgs/WrenchStamped with this header."""
    stamped = _new(WrenchStamped)
    stamped.header, stamped.wrench = head, wrench_message(wrench)
    return stamped


def transform_stamped(head: Any, child: str, pose: Pose) -> Any:
    """Return the pose of the frame `child` in the header's frame as geometry_msgs/TransformStamped."""
    message, transform = _new(TransformStamped), _new(Transform)
    transform.translation, transform.rotation = vector_message(pose.position), _quaternion_message(pose.orientation)
    message.header, message.child_frame_id, message.transform = head, child, transform
    return message
