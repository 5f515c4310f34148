"""Bodies that follow a topic, a link or a recording."""

import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rosbag
from geometry_msgs.msg import PoseStamped, TransformStamped
from real_master import free_port, ros, roscore
from tf2_msgs.msg import TFMessage

from hric_core.errors import HricError
from hric_core.geometry import Pose
from hric_core.robot_time import stamps
from hric_msgs.msg import MocapData, RigidBodyState
from mocap_natnet.server.bag_source import from_bag
from mocap_natnet.server.scene import CameraFaults
from mocap_natnet.server.scene_file import load
from mocap_natnet.server.sources import AHEAD, MAX_AGE, PoseHistory

sys.path.insert(0, str(Path(__file__).parent))

__all__ = ["ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
NODES = Path(__file__).parents[1] / "nodes"
LIMIT = 30.0


def at(x: float) -> Pose:
    return Pose((x, 0.0, 1.0))


def test_a_body_is_at_its_poses_between_them_and_shortly_after_and_then_not_seen() -> None:
    history = PoseHistory()
    assert history(0.0) is None
    for step in range(11):
        history.add(step * 0.01, at(step * 0.02))
    for time_, x in ((0.045, 0.09), (0.11, 0.22), (0.1 + AHEAD, 0.3), (0.1 + MAX_AGE, 0.3)):
        pose = history(time_)
        assert pose is not None and pose.position[0] == pytest.approx(x)
    assert history(0.1 + MAX_AGE + 0.01) is None


def test_a_run_that_restarts_is_followed_again() -> None:
    history = PoseHistory()
    for time_ in (50.0, 50.1, 0.0, 0.1):
        history.add(time_, at(time_))
    assert history(50.05) is None
    pose = history(0.05)
    assert pose is not None and pose.position[0] == pytest.approx(0.05)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Write a bag of a hand on a sinusoid, 2 s at 100 Hz: MocapData with y up and an occlusion, and its pose, z up."""
    path = tmp_path / "run.bag"
    with rosbag.Bag(str(path), "w") as written:
        for step in range(200):
            stamp, x = stamps.to_time(7.0 + 0.01 * step), math.sin(0.01 * step)
            frame = MocapData(
                rigid_bodies=[
                    RigidBodyState(name="table"),
                    RigidBodyState(name="hand", tracking_valid=not 50 < step < 60),
                ]
            )
            frame.header.stamp = frame.header.stamp = stamp
            hand = frame.rigid_bodies[1].pose if frame.rigid_bodies[1].tracking_valid else PoseStamped().pose
            hand.position.x, hand.position.y, hand.orientation.w = x, 1.2, 1.0
            pose = PoseStamped()
            pose.header.stamp = stamp
            pose.pose.position.x, pose.pose.position.z, pose.pose.orientation.w = x, 1.2, 1.0
            frame.rigid_bodies[0].pose.orientation.w = 1.0
            written.write("/frames", frame, stamp)
            written.write("/pose", pose, stamp)
    return path


def test_a_recording_is_played_from_its_first_pose_on(bag: Path) -> None:
    for track in (from_bag(bag, "/frames", "hand", "y"), from_bag(bag, "/pose")):
        for time_ in (0.0, 0.333, 0.55, 1.5, 5.0):
            x, y, z = track(time_).position
            assert (x, y, z) == pytest.approx((math.sin(min(time_, 1.99)), 0.0, 1.2), abs=1e-3)


@pytest.mark.parametrize("compression", ["none", "lz4"])
def test_a_damaged_recording_is_one_error_that_names_health(bag: Path, tmp_path: Path, compression: str) -> None:
    damaged = tmp_path / "damaged.bag"
    with rosbag.Bag(str(bag)) as whole, rosbag.Bag(str(damaged), "w", compression=compression) as copy:
        for topic, message, stamp in whole.read_messages():
            copy.write(topic, message, stamp)
    content, refused = damaged.read_bytes(), 0
    for place in range(100, len(content), len(content) // 60):
        damaged.write_bytes(content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :])
        try:
            from_bag(damaged, "/pose")
        except HricError as error:
            refused += "cannot be read" in str(error) and "health --salvage" in str(error)
            assert "\n" not in str(error)
    assert refused > 0


@pytest.mark.parametrize(
    ("motion", "text"),
    [
        ("{type: bag, path: none.bag, topic: /pose}", "there is no bag"),
        ("{type: bag, path: run.bag, topic: /poses}", "/frames, /pose"),
        ("{type: bag, path: run.bag, topic: /frames, body: wrist}", "hand, table"),
        ("{type: bag, path: scene.yaml, topic: /pose}", "cannot be read"),
        ("{type: bag, path: run.bag, topic: /pose, up: x}", "y, z"),
        ("{type: topic, topic: /pose}", "there is no ROS master"),
        ("{type: link, link: panda_hand}", "there is no ROS master"),
        ("{type: walk}", "link, minimum_jerk, sinusoid, still, topic"),
    ],
)
def test_a_motion_that_cannot_be_is_an_error_with_what_is_valid(bag: Path, motion: str, text: str) -> None:
    scene = bag.parent / "scene.yaml"
    scene.write_text(f"bodies: [{{name: hand, motion: {motion}}}]\n")
    with pytest.raises(HricError, match=text):
        load(scene, CameraFaults(), "z")


class Moving:
    """Publisher of a pose and a transform on a sinusoid along x, in wall time."""

    def __init__(self) -> None:
        import rospy

        self._poses = rospy.Publisher("/wand/pose", PoseStamped, queue_size=10)
        self._transforms = rospy.Publisher("/tf", TFMessage, queue_size=10)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while not self._stop.wait(0.01):
            stamp = stamps.to_time(time.time())
            pose, transform = PoseStamped(), TransformStamped()
            pose.header.stamp = transform.header.stamp = stamp
            pose.pose.position.x = transform.transform.translation.x = place(stamp.to_sec())
            pose.pose.orientation.w = transform.transform.rotation.w = 1.0
            transform.header.frame_id, transform.child_frame_id = "world", "wrist"
            self._poses.publish(pose)
            self._transforms.publish(TFMessage([transform]))

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._poses.unregister()
        self._transforms.unregister()


def place(stamp: float) -> float:
    return 0.1 * math.sin(math.pi * stamp)


@pytest.fixture
def moving(ros: str) -> Iterator[Moving]:
    made = Moving()
    yield made
    made.close()


def test_what_moves_in_the_running_system_is_seen_where_it_was_at_the_exposure(moving: Moving, tmp_path: Path) -> None:
    import rospy

    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "bodies:\n- {name: wand, motion: {type: topic, topic: /wand/pose}}\n- {name: wrist, motion: {type: "
        "link, link: wrist}}\n"
    )
    command, data = str(free_port()), str(free_port())
    stream = [
        "--transport",
        "unicast",
        "--command-port",
        command,
        "--data-port",
        data,
        "--up",
        "z",
        "--scene",
        str(scene),
    ]
    parameters = [f"_command_port:={command}", f"_data_port:={data}", "_up_axis:=z"]
    processes = [
        subprocess.Popen([sys.executable, str(NODES / name), *words])
        for name, words in (("emulated_motive", stream), ("natnet_client", parameters))
    ]
    frames: list = []
    subscriber = rospy.Subscriber("/hric/perception/mocap", MocapData, frames.append, queue_size=None)
    try:
        _wait(lambda: sum(all(body.tracking_valid for body in frame.rigid_bodies) for frame in list(frames)) > 400)
    finally:
        subscriber.unregister()
        for process in processes:
            process.terminate()
            process.wait(LIMIT)
    seen = [frame for frame in frames if all(body.tracking_valid for body in frame.rigid_bodies)][100:]
    for index in range(2):
        errors = [abs(frame.rigid_bodies[index].pose.position.x - place(frame.header.stamp.to_sec())) for frame in seen]
        assert sorted(errors)[len(errors) // 2] < 1e-3  # a millisecond of wrong time would be 0.3 mm


def _wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)
