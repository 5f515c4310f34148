"""Motion of a body from a recorded bag. Needs no ROS."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader

from hric_core.errors import HricError, ParameterError, UnknownNameError
from hric_core.geometry.messages import pose_of
from hric_core.geometry.poses import Pose, Track, pose_z_up

FRAMES, POSES = "hric_msgs/msg/MocapData", "geometry_msgs/msg/PoseStamped"
"""Message types of topics with poses of a body."""


def from_bag(path: Path, topic: str, body: str = "", up: str = "z") -> Track:
    """Return a track that begins at the bag's first pose of the body and is constant before and after.

    Args:
        path: path of the bag.
        topic: topic of hric_msgs/MocapData or geometry_msgs/PoseStamped.
        body: name of the body in MocapData; "": the first one.
        up: axis that points up in the recording, y or z.

    Raises:
        ParameterError, UnknownNameError: the bag, the topic or the body does not exist; the message lists valid ones.
    """
    if not path.is_file():
        raise ParameterError(f"there is no bag {path}")
    try:
        with AnyReader([path]) as reader:
            poses = [(stamp, pose) for stamp, pose in _poses(reader, path, topic, body) if pose is not None]
    except HricError:
        raise
    except Exception as error:  # a damaged file may raise anything
        reason = " ".join(str(error).split()) or type(error).__name__
        hint = f"try: hric health --salvage {path}"
        raise ParameterError(f"bag {path} cannot be read: {reason}; {hint}") from error
    if not poses:
        raise ParameterError(f"{topic} of bag {path} has no pose of {body or 'a body'}")
    rising = poses[:1] + [after for before, after in pairwise(poses) if after[0] > before[0]]
    return Track([stamp - poses[0][0] for stamp, _ in rising], [pose_z_up(up, pose) for _, pose in rising])


def _poses(reader: Any, path: Path, topic: str, body: str) -> Iterator[tuple[float, Pose | None]]:
    usable = {
        connection.topic: connection for connection in reader.connections if connection.msgtype in (FRAMES, POSES)
    }
    if topic not in usable:
        raise UnknownNameError("topic of poses", topic, sorted(usable), f"bag {path}")
    for connection, _, raw in reader.messages([usable[topic]]):
        message = reader.deserialize(raw, connection.msgtype)
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        yield stamp, pose_of(message.pose) if connection.msgtype == POSES else _body(message, body, path)


def _body(message: Any, body: str, path: Path) -> Pose | None:
    """Return the pose of a body in a frame; None if it was not tracked."""
    matching = [candidate for candidate in message.rigid_bodies if body in ("", candidate.name)]
    if not matching:
        raise UnknownNameError("body", body, [candidate.name for candidate in message.rigid_bodies], f"bag {path}")
    return pose_of(matching[0].pose) if matching[0].tracking_valid else None
