"""The node `camera`: pictures, distances and camera matrices at the rate that was asked."""

import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rospy
import tf2_ros
from real_master import ros, roscore  # noqa: F401
from sensor_msgs.msg import CameraInfo, Image, JointState

pytestmark = pytest.mark.alone
NODE = Path(__file__).resolve().parents[1] / "nodes" / "camera"
STAMP = rospy.Time(12, 345_000_000)


@pytest.fixture(scope="module")
def heard(ros: str, panda_urdf: str) -> Iterator[dict[str, list[Any]]]:  # noqa: F811
    """Return the messages that the node sends within some seconds, for a robot that does not move."""
    rospy.set_param("/robot_description", panda_urdf)
    found: dict[str, list[Any]] = {}
    topics = {
        "/camera/image_raw": Image,
        "/camera/depth/image_raw": Image,
        "/camera/camera_info": CameraInfo,
        "/camera/depth/camera_info": CameraInfo,
    }
    for topic, kind in topics.items():
        rospy.Subscriber(topic, kind, found.setdefault(topic, []).append)
    joints = rospy.Publisher("/joint_states", JointState, latch=True, queue_size=1)
    message = JointState(name=["panda_joint2"], position=[0.3])
    message.header.stamp = STAMP
    joints.publish(message)
    node = subprocess.Popen([str(NODE), "_rate:=5"], env=os.environ)
    deadline = time.monotonic() + 180.0
    while not all(len(messages) >= 8 for messages in found.values()):
        assert time.monotonic() < deadline and node.poll() is None
        time.sleep(0.05)
    yield found
    node.terminate()
    assert node.wait(60.0) == 0


def test_pictures_and_distances_come_with_the_stamp_of_the_joints_and_their_size(heard: dict[str, list[Any]]) -> None:
    picture, distances = heard["/camera/image_raw"][-1], heard["/camera/depth/image_raw"][-1]
    assert (picture.width, picture.height, picture.encoding, picture.step) == (160, 120, "rgb8", 480)
    assert (distances.width, distances.height, distances.encoding, distances.step) == (160, 120, "32FC1", 640)
    assert len(picture.data) == 160 * 120 * 3 and picture.header.stamp == distances.header.stamp == STAMP
    metres = np.frombuffer(distances.data, np.float32)
    assert 0.3 < metres.min() < 2.0  # the arm


def test_the_camera_matrix_belongs_to_the_pictures(heard: dict[str, list[Any]]) -> None:
    info = heard["/camera/camera_info"][-1]
    focal = 60.0 / np.tan(0.4)
    assert pytest.approx((focal, 0.0, 79.5, 0.0, focal, 59.5, 0.0, 0.0, 1.0)) == info.K
    assert info.header.frame_id == heard["/camera/image_raw"][-1].header.frame_id == "camera_optical_frame"


def test_the_optical_frame_is_told(heard: dict[str, list[Any]]) -> None:
    frames = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(frames)
    T = frames.lookup_transform("world", "camera_optical_frame", rospy.Time(), rospy.Duration(10.0))
    assert T.transform.translation.x == pytest.approx(1.8)
    listener.unregister()


def test_a_parameter_that_is_not_valid_ends_the_node_with_one_line(heard: dict[str, list[Any]]) -> None:
    done = subprocess.run(
        [str(NODE), "_rate:=0", "__name:=other"],
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
    )
    assert done.returncode == 2 and "rate is 0" in done.stderr and "Traceback" not in done.stderr
