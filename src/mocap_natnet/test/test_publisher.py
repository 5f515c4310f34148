"""Topics from frames, headless on a LocalNode through the real encoder and decoder."""

import io
import math

import numpy as np
import pytest
from busy_run import OVER, BusyDriver, BusyRun
from geometry_msgs.msg import Point, PointStamped, Pose2D, PoseStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from hric_core.errors import HricError
from hric_core.geometry import Pose, compose, from_rotation_vector
from hric_core.geometry.quaternions import difference, rotated
from hric_core.local.node import LocalNode
from hric_msgs.msg import MocapData
from mocap_natnet.client import ClientSettings as ClientSettings
from mocap_natnet.client import Received
from mocap_natnet.codec.descriptions import RigidBodyDescription, ServerModel, SkeletonDescription
from mocap_natnet.codec.types import Frame, RigidBody, Skeleton
from mocap_natnet.headless import HeadlessMocap, robot_time
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.node.publisher import MocapPublisher, ros_name, static_transform
from mocap_natnet.server import CameraFaults, Motive, MotiveSettings, SceneBody, ServedScene, SinusoidSource

TURNING = SinusoidSource((0.4, 0.1, 1.0), (0.1, 0.05, 0.02), 0.25, 0.0, (0.5, -0.4, 0.3))
TOPICS = {
    "/hric/perception/mocap": MocapData,
    "/mocap/marker": Point,
    "/mocap/marker_stamped": PointStamped,
    "/mocap/hand/pose": PoseStamped,
    "/mocap/tool_2/pose": PoseStamped,
    "/tf": TFMessage,
    "/mocap/markers": MarkerArray,
}
BASE = {
    "base_frame": "panda_link0",
    "base_from_mocap": {"xyz": [0.5, -0.2, 0.1], "xyzw": [0.0, 0.0, math.sin(0.5), math.cos(0.5)]},
}


def run(params: dict, faults: CameraFaults | None = None, up: str = "y", seconds: float = 1.0) -> dict[str, list]:
    node = LocalNode({"mocap": params}, "/mocap")
    seen: dict[str, list] = {topic: [] for topic in TOPICS}
    for topic, kind in TOPICS.items():
        node.subscribe(topic, kind, seen[topic].append)
    publisher = MocapPublisher(node, Publishing.read(node), robot_time)
    scene = ServedScene((SceneBody("hand", TURNING), SceneBody("tool 2", TURNING, 2)), (), faults or CameraFaults(), up)
    headless = HeadlessMocap(Motive(MotiveSettings(), scene), publisher)
    for millisecond in range(round(1000 * seconds) + 1):
        headless.advance(millisecond / 1000)
    return seen


def test_every_frame_is_published_with_the_time_of_its_exposure() -> None:
    seen = run({})
    data = seen["/hric/perception/mocap"]
    assert len(data) == math.floor((1.0 - 0.0055) * 240) + 1
    for number, message in enumerate(data):
        assert message.frame_number == number
        assert message.header.stamp.to_sec() == pytest.approx(number / 240, abs=1e-9)
        assert message.header.frame_id == "mocap"
        assert message.latency == pytest.approx(0.0055, abs=1e-9)
        assert message.tracking_valid and [body.name for body in message.rigid_bodies] == ["hand", "tool 2"]
        x, y, z = TURNING(number / 240).position
        place = message.rigid_bodies[0].pose.position
        assert (place.x, place.y, place.z) == pytest.approx((x, z, -y), abs=1e-6)  # as streamed: y up
        assert message.labelled_marker_names[:3] == ["hand/Marker1", "hand/Marker2", "hand/Marker3"]
        assert len(message.labelled_markers) == len(message.marker_sizes) == len(message.labelled_marker_ids) == 6
    assert len(seen["/mocap/marker"]) == len(seen["/mocap/hand/pose"]) == len(data)
    assert seen["/mocap/marker_stamped"][7].point == seen["/mocap/marker"][7] == data[7].rigid_bodies[0].pose.position


def test_a_message_without_subscribers_is_not_made(monkeypatch: pytest.MonkeyPatch) -> None:
    def made(*_: object) -> None:
        raise AssertionError("made for nobody")

    for name in (
        "messages.mocap_data",
        "stamped.point_message",
        "messages.point_stamped",
        "stamped.pose_stamped",
        "messages.marker_array",
    ):
        monkeypatch.setattr(f"mocap_natnet.node.publisher.{name}", made)
    node = LocalNode({"mocap": {}}, "/mocap")
    publisher = MocapPublisher(node, Publishing.read(node), robot_time)
    headless = HeadlessMocap(Motive(MotiveSettings(), ServedScene((SceneBody("hand", TURNING),))), publisher)
    headless.advance(0.1)
    seen: list[MocapData] = []
    node.subscribe("/hric/perception/mocap", MocapData, seen.append)
    with pytest.raises(AssertionError, match="made for nobody"):
        headless.advance(0.2)


@pytest.mark.parametrize("up", ["y", "z"])
def test_in_the_base_positions_and_orientations_turn_together(up: str) -> None:
    seen = run({**BASE, "up_axis": up, "body": "tool 2"}, up=up)
    base = Pose((0.5, -0.2, 0.1), from_rotation_vector((0.0, 0.0, 1.0)))
    for message in seen["/mocap/tool_2/pose"]:
        truth = compose(base, TURNING(message.header.stamp.to_sec()))
        p, q = message.pose.position, message.pose.orientation
        assert message.header.frame_id == "panda_link0"
        assert (p.x, p.y, p.z) == pytest.approx(truth.position, abs=1e-6)
        assert math.hypot(*difference((q.x, q.y, q.z, q.w), truth.orientation)) < 1e-6
    assert seen["/mocap/marker"][9] == seen["/mocap/tool_2/pose"][9].pose.position


def test_without_tracking_there_is_data_and_nothing_else() -> None:
    seen = run({}, CameraFaults(occlusions=((0.25, 0.5, ""),)))
    data = seen["/hric/perception/mocap"]
    hidden = [message for message in data if 0.25 <= message.header.stamp.to_sec() < 0.75]
    assert len(hidden) == 120 and not any(message.tracking_valid for message in hidden)
    assert all(body.pose == hidden[0].rigid_bodies[0].pose for message in hidden for body in message.rigid_bodies[:1])
    assert not any(message.labelled_markers for message in hidden)
    for topic in ("/mocap/marker_stamped", "/mocap/hand/pose", "/tf"):
        messages = seen[topic]
        stamps = [(message.transforms[0] if topic == "/tf" else message).header.stamp.to_sec() for message in messages]
        assert messages and not [stamp for stamp in stamps if 0.25 <= stamp < 0.75], topic


def test_transforms_and_balls_keep_their_rates() -> None:
    seen = run({"tf_rate": 50.0, "markers_rate": 10.0}, seconds=2.0)
    assert len(seen["/tf"]) == pytest.approx(100, abs=2)
    assert len(seen["/mocap/markers"]) == pytest.approx(20, abs=1)
    assert [transform.child_frame_id for transform in seen["/tf"][0].transforms] == ["hand", "tool_2"]
    assert len(seen["/mocap/markers"][0].markers) == 7  # the first one clears
    none = run({"tf_rate": 0, "markers_rate": 0})
    assert none["/tf"] == none["/mocap/markers"] == []


def test_the_same_seed_gives_the_same_messages() -> None:
    def content(seed: int) -> bytes:
        buffer = io.BytesIO()
        for messages in run({}, CameraFaults(noise=1e-4, marker_noise=1e-4, occlusion_rate=1.0, seed=seed)).values():
            for message in messages:
                message.serialize(buffer)
        return buffer.getvalue()

    assert content(1) == content(1)
    assert content(1) != content(2)


@pytest.mark.parametrize(
    ("preset", "topic", "frame", "child"),
    [
        ("mocap_optitrack", "/hand/pose", "world", "hand/base_link"),
        ("natnet_ros", "/natnet_ros/rigid_bodies/hand/pose", "mocap", "hand"),
    ],
)
def test_the_names_of_other_drivers_are_found(preset: str, topic: str, frame: str, child: str) -> None:
    node, poses, transforms, ground = LocalNode({"topics": preset, "up_axis": "z"}), [], [], []
    node.subscribe(topic, PoseStamped, poses.append)
    node.subscribe("/tf", TFMessage, transforms.append)
    node.subscribe("/hand/ground_pose", Pose2D, ground.append)
    publisher = MocapPublisher(node, Publishing.read(node), robot_time)
    turned = SinusoidSource(frequency=0.25, rotation=(0.0, 0.0, 0.8))
    HeadlessMocap(Motive(MotiveSettings(), ServedScene((SceneBody("hand", turned),), up="z")), publisher).advance(
        1.0055
    )
    assert poses[-1].header.frame_id == transforms[-1].transforms[0].header.frame_id == frame
    assert transforms[-1].transforms[0].child_frame_id == child
    if preset == "mocap_optitrack":
        assert (ground[240].x, ground[240].y, ground[240].theta) == pytest.approx((0.1, 0.0, 0.8), abs=1e-6)
    else:
        assert ground == []


def test_bones_of_a_skeleton_become_transforms() -> None:
    node, transforms = LocalNode({"up_axis": "z"}), []
    node.subscribe("/tf", TFMessage, transforms.append)
    publisher = MocapPublisher(node, Publishing.read(node), robot_time)
    publisher.describe(
        ServerModel(
            (SkeletonDescription("Anna", 3, (RigidBodyDescription("Hip", 1), RigidBodyDescription("Left Arm", 2))),)
        )
    )
    q = (0.0, 0.0, 0.0, 1.0)
    lost = RigidBody(3 << 16 | 3, (0.0, 0.0, 1.0), q, 0.0, 0)
    broken = RigidBody(3 << 16 | 4, (math.nan, 0.0, 1.0), q)
    bones = (RigidBody(3 << 16 | 1, (0.0, 0.0, 1.0), q), RigidBody(3 << 16 | 2, (0.0, 0.2, 1.4), q), lost, broken)
    publisher.publish(Received(Frame(1, skeletons=(Skeleton(3, bones),)), 10_000_000, 5_000_000, "mid-exposure"))
    (message,) = transforms
    assert [(one.child_frame_id, one.transform.translation.z) for one in message.transforms] == [
        ("Anna/Hip", 1.0),
        ("Anna/Left_Arm", 1.4),
    ]


def test_nothing_is_published_before_the_time_of_the_run_is_known() -> None:
    node, seen = LocalNode(), []
    node.subscribe("/hric/perception/mocap", MocapData, seen.append)
    publisher = MocapPublisher(node, Publishing.read(node), lambda monotonic: None)
    HeadlessMocap(Motive(MotiveSettings(), ServedScene((SceneBody("hand", TURNING),))), publisher).advance(0.1)
    assert seen == [] and publisher.untimed == 23


@pytest.mark.parametrize(("jump", "rises"), [(-0.02, True), (-3.0, False)])
def test_stamps_rise_where_the_clocks_relation_is_found_again_and_go_back_with_the_run_alone(
    jump: float, rises: bool
) -> None:
    node, seen = LocalNode(), []
    node.subscribe("/hric/perception/mocap", MocapData, seen.append)
    publisher = MocapPublisher(
        node,
        Publishing.read(node),
        lambda monotonic: 10.0 + robot_time(monotonic) + (jump if robot_time(monotonic) > 0.5 else 0.0),
    )
    HeadlessMocap(Motive(MotiveSettings(), ServedScene((SceneBody("hand", TURNING),))), publisher).advance(1.0)
    times = [message.header.stamp.to_sec() for message in seen]
    assert len(times) > 200 and (times == sorted(set(times))) == rises
    assert publisher.held == (4 if rises else 0)  # frames in 20 ms at 240 Hz


def test_the_static_transform_takes_the_stream_to_the_base() -> None:
    node = LocalNode({"mocap": BASE}, "/mocap")
    (transform,) = static_transform(Publishing.read(node), None).transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("panda_link0", "mocap")
    q = transform.transform.rotation
    assert rotated((q.x, q.y, q.z, q.w), (0.0, 1.0, 0.0)) == pytest.approx((0.0, 0.0, 1.0))
    assert static_transform(Publishing.read(LocalNode()), None) is None


@pytest.mark.parametrize(
    ("name", "expected"), [("hand", "hand"), ("tool 2", "tool_2"), ("7", "body_7"), ("Ærø", "body__r_"), ("", "body_")]
)
def test_names_of_bodies_become_names_of_topics(name: str, expected: str) -> None:
    assert ros_name(name) == expected


@pytest.mark.parametrize(
    "wrong",
    [
        {"up_axis": "x"},
        {"body": [1]},
        {"topics": "vrpn"},
        {"tf_rate": -1},
        {"base_from_mocap": {"xyzw": [0, 0, 0, 2]}},
        {"base_from_mocap": {"xyz": [1, 2]}},
        {"volume": {"low": [1, 1, 1], "high": [0, 2, 2]}},
        {"max_speed": 0},
        {"server": "motive"},
        {"transport": "tcp"},
        {"group": "10.0.0.1"},
        {"command_port": 0},
        {"bitstream": "9.0"},
        {"nominal_latency": "soon"},
    ],
)
def test_a_wrong_parameter_is_refused(wrong: dict) -> None:
    node = LocalNode({"mocap": wrong}, "/mocap")
    with pytest.raises(HricError):
        ClientSettings.read(node)
        Publishing.read(node)


@pytest.mark.parametrize("seed", range(3))
def test_on_a_busy_machine_and_in_a_pause_each_stamp_is_later_than_the_one_before(seed: int) -> None:
    """Clock pairs come late, in bunches and twice, with stalls of up to 0.4 s; then the run pauses, but not Motive."""
    driver, node, seen = BusyDriver(BusyRun(seed, 1.0, load=1.0)), LocalNode(), []
    node.subscribe("/hric/perception/mocap", MocapData, seen.append)
    publisher = MocapPublisher(node, Publishing.read(node), lambda monotonic: driver.robot_time(monotonic / 1e9))
    HeadlessMocap(Motive(MotiveSettings(), ServedScene((SceneBody("hand", TURNING),))), publisher).advance(OVER)
    stamps = [message.header.stamp.to_nsec() for message in seen]
    assert len(stamps) > 7000 and min(np.diff(stamps)) > 0
    assert publisher.held > 400 and stamps[-1] - stamps[-400] < 1e4
