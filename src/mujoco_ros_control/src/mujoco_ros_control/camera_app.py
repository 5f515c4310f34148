"""ROS node `camera`: publishes simulated camera and depth images of the robot and the world, at a wall-time rate."""

import threading
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped, Quaternion, TransformStamped, Vector3
from sensor_msgs.msg import CameraInfo, Image, JointState

from gazebo_msgs.msg import ModelStates
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, messages, quaternion_from_rotation
from hric_core.parameters import flag, number, text
from hric_core.ros import RosNode, run
from hric_core.ros.process import NodeApp
from hric_human.participant.settings import HUMAN, HumanSettings
from mujoco_ros_control.pictures import Camera, CameraSettings, camera_matrix, optical_frame

OPTICAL = "camera_optical_frame"


@dataclass(frozen=True)
class CameraNodeSettings(CameraSettings):
    """Parameters of the camera node."""

    rate: float = number(10.0, above=0.0, maximum=60.0, unit="Hz of wall time", text="of the pictures")
    depth: bool = flag(True, text="also publish depth images")
    robot_description: str = text(
        "robot_description", empty=False, text="parameter with the URDF, in the node's namespace"
    )


class CameraNode(NodeApp):
    """ROS node with a simulated camera; it publishes images from its construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: RosNode) -> None:
        self._settings, root = CameraNodeSettings.read(node), RosNode()
        self._description = str(root.param(self._settings.robot_description))
        self._world = str(root.param("robot/plant/world", ""))
        self._person = HumanSettings.beside_robot(root)
        self._positions: dict[str, float] = {}
        self._person_positions: dict[str, float] = {}
        self._poses: dict[str, FloatArray] = {}
        self._person_pose: dict[str, FloatArray] = {}
        self._stamp = rospy.Time()
        self._picture = root.advertise("camera/image_raw", Image)
        self._depth = root.advertise("camera/depth/image_raw", Image)
        self._infos = [root.advertise(f"camera/{part}camera_info", CameraInfo) for part in ("", "depth/")]
        self._send_frame()
        root.subscribe("joint_states", JointState, self._on_joints)
        root.subscribe("sim/model_states", ModelStates, self._on_models)
        root.subscribe(f"hric/{HUMAN}/joint_states", JointState, self._on_person)
        root.subscribe(f"hric/{HUMAN}/root", PoseStamped, self._on_person_root)
        self._stop = threading.Event()
        self._failure: HricError | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def tick(self) -> None:
        """Raise the error that ended the camera thread, if any."""
        if self._failure is not None:
            raise self._failure

    def close(self) -> None:
        """Stop the camera thread."""
        self._stop.set()
        self._thread.join(2.0)

    def _send_frame(self) -> None:
        settings = self._settings
        T = optical_frame(settings.T_parent_camera)
        frame = TransformStamped(child_frame_id=OPTICAL)
        frame.header.frame_id = settings.parent.rpartition("::")[2]
        frame.transform.translation = Vector3(*T[:3, 3].tolist())
        frame.transform.rotation = Quaternion(*quaternion_from_rotation(T[:3, :3]))
        self._frames = tf2_ros.StaticTransformBroadcaster()
        self._frames.sendTransform(frame)

    def _on_joints(self, message: Any) -> None:
        self._stamp = message.header.stamp
        self._positions.update(zip(message.name, message.position, strict=False))

    def _on_person(self, message: Any) -> None:
        self._person_positions = dict(zip(message.name, message.position, strict=True))

    def _on_person_root(self, message: Any) -> None:
        self._person_pose = {HUMAN: messages.matrix(message.pose)}

    def _on_models(self, message: Any) -> None:
        self._poses = {name: messages.matrix(pose) for name, pose in zip(message.name, message.pose, strict=True)}

    def _run(self) -> None:
        """Draw and publish images, in a separate thread that owns the OpenGL context."""
        try:
            camera = Camera(self._description, self._world, self._settings, self._person)
        except HricError as error:
            self._failure = error
            return
        due = time.monotonic()
        while not self._stop.wait(max(due - time.monotonic(), 0.0)):
            due = max(due + 1.0 / self._settings.rate, time.monotonic())
            self._send(camera)
        camera.close()

    def _send(self, camera: Camera) -> None:
        stamp = self._stamp
        poses = self._poses | self._person_pose
        picture, distances = camera.take(
            self._positions.copy(), poses, self._person_positions, depth=self._settings.depth
        )
        self._picture.publish(_image(stamp, picture, "rgb8"))
        self._infos[0].publish(self._info(stamp))
        if distances is not None:
            self._depth.publish(_image(stamp, distances, "32FC1"))
            self._infos[1].publish(self._info(stamp))

    def _info(self, stamp: Any) -> Any:
        K = camera_matrix(self._settings)
        info = CameraInfo(height=self._settings.height, width=self._settings.width, distortion_model="plumb_bob")
        info.header.stamp, info.header.frame_id = stamp, OPTICAL
        info.D, info.K, info.R = [0.0] * 5, list(K), np.eye(3).ravel().tolist()
        info.P = [*K[:3], 0.0, *K[3:6], 0.0, *K[6:], 0.0]
        return info


def _image(stamp: Any, values: Any, encoding: str) -> Any:
    height, width = values.shape[:2]
    image = Image(height=height, width=width, encoding=encoding, step=values.strides[0], data=values.tobytes())
    image.header.stamp, image.header.frame_id = stamp, OPTICAL
    return image


def main(text_of_help: str) -> int:
    """Run the camera node and return its exit code; text_of_help: text for --help."""
    return run("camera", text_of_help, CameraNode, CameraNodeSettings)
