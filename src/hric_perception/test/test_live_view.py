"""Live view: nearness to limits, markers, mean values, and the node that publishes them."""

import io
import math
import os
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from geometry_msgs.msg import WrenchStamped
from real_master import ros, roscore  # noqa: F401
from sensor_msgs.msg import JointState
from sensor_nodes import Nodes, nodes  # noqa: F401
from visualization_msgs.msg import Marker, MarkerArray

from franka_msgs.msg import FrankaState
from hric_control.limits import JointLimits
from hric_core.robot_time import stamps
from hric_core.urdf import read
from hric_human.body import Subject, describe
from hric_human.muscles import BUILT_IN, load
from hric_human.muscles.lines import colour, muscle_lines
from hric_msgs.msg import (
    HumanGrip,
    MarkerTrackingState,
    MuscleActivation,
    RegionContact,
    RegionContacts,
    SampleChunk,
)
from hric_perception.chunk import Chunk, Layout, chunk_message
from hric_perception.view import limit_markers
from hric_perception.view.curves import WINDOW, SampleHistory
from hric_perception.view.decimation import MeanChunk, NewestJoints, ReactionWrench
from hric_perception.view.human_markers import CONTACT, HumanMarkers
from hric_perception.view.limit_markers import Level, of_joint, walls
from hric_perception.view.muscle_markers import MuscleMarkers
from hric_perception.view.skin_marker import SkinMarker
from hric_skin import fitted

pytestmark = pytest.mark.alone

LIMITS = JointLimits("arm_joint1", lower=-1.0, upper=2.0, velocity=2.0, effort=10.0)
URDF = """<robot name="arm"><link name="base"/><link name="one"/><link name="two"/>
<joint name="arm_joint1" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 0.3" rpy="1.5707963 0 0"/><axis xyz="0 0 -1"/>
<limit lower="-1" upper="2" velocity="2" effort="10"/></joint>
<joint name="arm_finger" type="prismatic"><parent link="one"/><child link="two"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.04" velocity="1" effort="1"/></joint>
</robot>"""  # noqa: E501


def held(force: float, closed: bool = True) -> Any:
    """hric_msgs/HumanGrip at (0.4, 0, 0.5) in the world, with a force upwards [N]."""
    message = HumanGrip(name="guide", closed=closed)
    message.header.frame_id, message.wrench.force.z = "world", force
    message.point.x, message.point.z = 0.4, 0.5
    return message


def touch(force: float, link: str = "r_elbow", peak: float = math.nan) -> Any:
    """hric_msgs/RegionContact at (0.3, 0, 0.5) of the forearm, which is pushed along -y [N]."""
    message = RegionContact(regions=["lower arm, wrist"], link=link, force=force, peak=peak)
    message.point.x, message.point.z, message.normal.y = 0.3, 0.5, -1.0
    return message


def touching(*contacts: Any, ended: tuple[Any, ...] = ()) -> Any:
    """hric_msgs/RegionContacts."""
    message = RegionContacts(touching=contacts, ended=ended)
    message.header.frame_id = "world"
    return message


@pytest.mark.parametrize(
    ("q", "dq", "tau", "level", "text"),
    [
        (0.5, 0.0, 0.0, Level.FAR, ""),
        (1.9, 0.0, 0.0, Level.NEAR, "0.10 rad from its upper end"),
        (-1.02, 0.0, 0.0, Level.AT, "0.02 rad beyond its lower end"),
        (0.5, -1.7, 0.0, Level.NEAR, "85 % of its velocity"),
        (1.9, 0.0, 9.8, Level.AT, "0.10 rad from its upper end, 98 % of its effort"),
        (0.5, math.nan, math.nan, Level.FAR, ""),
    ],
)
def test_a_joint_names_the_limits_it_is_near_to(q: float, dq: float, tau: float, level: Level, text: str) -> None:
    found = of_joint(LIMITS, q, dq, tau)
    assert (found.level, found.text) == (level, text)


def test_the_sides_of_a_workspace_show_only_near_the_end_effector() -> None:
    box = (-1.0, -1.0, 0.0), (1.0, 1.0, 1.0)
    assert walls(*box, (0.0, 0.0, 0.5)) == []
    found = walls(*box, (0.95, 0.0, 0.01))
    assert [(wall.axis, wall.side, wall.level) for wall in found] == [(0, 1, Level.NEAR), (2, 0, Level.AT)]


def test_the_hand_of_a_ring_points_where_the_joint_has_turned_to() -> None:
    (place,) = limit_markers.rings(URDF, {"arm_joint1": LIMITS}).values()
    straight, turned = (limit_markers.hand(place, 0, q, of_joint(LIMITS, q, 0.0, 0.0))[0] for q in (0.0, math.pi / 2))
    first, second = ([marker.points[1].x, marker.points[1].y, marker.points[1].z] for marker in (straight, turned))
    # The axis is -z of an origin that is turned about x by 90 degrees: +y of the parent.
    axis = np.cross(place.R.apply(first), place.R.apply(second))
    assert np.allclose(axis / np.linalg.norm(axis), [0.0, 1.0, 0.0], atol=1e-6)
    assert (straight.header.frame_id, straight.pose.position.z) == ("base", 0.3)


def test_a_grip_force_begins_where_it_acts_and_goes_with_the_grip() -> None:
    markers = HumanMarkers()
    markers.push_grip(held(3.0))
    markers.push_grip(held(5.0))
    arrow, words = markers.take().markers
    tail, tip = arrow.points
    assert (arrow.header.frame_id, arrow.type, words.text) == ("world", Marker.ARROW, "guide: 5.0 N")
    assert np.allclose([tail.x, tail.y, tail.z, tip.x, tip.y, tip.z], [0.4, 0.0, 0.5, 0.4, 0.0, 0.6])
    markers.push_grip(held(0.0, closed=False))
    assert markers.take() is None


def test_the_arrow_of_a_contact_ends_where_it_acts_along_its_normal_and_is_longer_the_larger_the_force() -> None:
    markers = HumanMarkers()
    markers.push_contacts(touching(touch(100.0)))
    arrow, words = markers.take().markers
    tail, tip = arrow.points
    assert (arrow.header.frame_id, words.text, words.color) == ("world", "lower arm, wrist: 100 N", CONTACT)
    assert np.allclose([tip.x, tip.y, tip.z, tail.x, tail.y, tail.z], [0.3, 0.0, 0.5, 0.3, 0.2, 0.5])
    assert markers.take() is None, "each is shown once"


def test_of_several_looks_the_largest_force_of_a_link_is_shown_and_a_rigid_contact_has_none() -> None:
    markers, nowhere = HumanMarkers(), touch(7.0, link="shoe")
    nowhere.point.x = math.nan
    markers.push_contacts(touching(touch(math.nan), touch(40.0), nowhere))
    markers.push_contacts(touching(ended=(touch(0.0, peak=153.0),)))
    markers.push_contacts(touching(touch(math.nan)))
    assert [marker.text for marker in markers.take().markers] == ["", "lower arm, wrist: 153 N"]
    markers.push_contacts(touching(touch(math.nan)))
    assert [(marker.type, marker.text) for marker in markers.take().markers] == [
        (Marker.TEXT_VIEW_FACING, "lower arm, wrist: rigid")
    ]


def test_muscles_are_lines_on_the_links_in_the_colours_of_their_activation() -> None:
    body, anatomy = describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male")), load(BUILT_IN)
    lines = muscle_lines(body, anatomy)
    markers = MuscleMarkers(body.urdf, {name: [[link, *p] for link, p in of] for name, of in lines.items()}, "human")
    model = pinocchio.buildModelFromXML(body.urdf)
    state, q = model.createData(), np.linspace(0.2, 0.8, model.nq)
    pinocchio.framesForwardKinematics(model, state, q)
    names = [*reversed(model.names[1:])]
    angles = [q[model.joints[model.getJointId(name)].idx_q] for name in names]
    activation = MuscleActivation(name=["right_wr_flex+", "right_bic_b"], activation=[0.9, 0.25])
    markers.push_activation(activation)
    assert markers.take() is None, "nobody knows where the person is"
    markers.push_joints(JointState(name=names, position=angles))
    assert markers.take() is None, "what was shown is old"
    markers.push_activation(activation)
    (marker,) = markers.take().markers
    assert (marker.type, marker.header.frame_id) == (Marker.LINE_LIST, "human/human_base")
    pieces = {name: len(points) - 1 for name, points in lines.items()}
    first = 2 * sum(count for name, count in list(pieces.items())[: list(pieces).index("right_bic_b")])
    assert len(marker.points) == len(marker.colors) == 2 * sum(pieces.values())
    for k, (link, place) in enumerate(lines["right_bic_b"][:-1]):
        expected = state.oMf[model.getFrameId(link)].act(np.array(place))
        at = marker.points[first + 2 * k]
        assert [at.x, at.y, at.z] == pytest.approx(expected.tolist(), abs=1e-9)
        own = marker.colors[first + 2 * k]
        assert [own.r, own.g, own.b] == pytest.approx(colour([0.25])[0].tolist())


def test_the_skin_is_a_triangle_list_that_rviz_can_read() -> None:
    body = describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male", parts="upper_body"))
    marker, angles = SkinMarker(body, ("right",), "human"), {"right_sh_flex": 1.2, "trunk_bend": 0.2}
    assert marker.take() is None, "nobody knows the posture"
    marker.push(JointState(name=list(angles), position=list(angles.values())))
    written, message = io.BytesIO(), Marker()
    marker.take().serialize(written)
    message.deserialize(written.getvalue())
    skin = fitted(body, ("right",))
    corners, colours = (
        values[skin.triangles.ravel()] for values in (skin.posed(read(body.urdf).poses(angles)), skin.colours)
    )
    assert (message.type, message.header.frame_id, message.ns) == (
        Marker.TRIANGLE_LIST,
        "human/human_base",
        "human/skin",
    )
    assert np.array([[p.x, p.y, p.z] for p in message.points]) == pytest.approx(corners)
    assert np.array([[c.r, c.g, c.b, c.a] for c in message.colors]) == pytest.approx(np.insert(colours, 3, 1.0, axis=1))
    assert marker.take() is None, "each posture is shown once"


def test_a_mean_of_chunks_is_one_sample_with_the_channels_and_units_of_the_source() -> None:
    layout = Layout("made up", ("a", "b"), ("V", "s"), 100.0)
    mean = MeanChunk(30.0)
    assert mean.take() is None
    mean.push(chunk_message(Chunk(layout, 1.0, 5, np.array([[1.0, 2.0], [3.0, math.nan]]))))
    mean.push(chunk_message(Chunk(layout, 1.02, 7, np.array([[5.0, math.nan]]))))
    found = mean.take()
    assert (list(found.channels), found.unit, list(found.data), found.first_sample, found.rate) == (
        ["a", "b"],
        "V s",
        [3.0, 2.0],
        5,
        30.0,
    )
    assert found.header.stamp.to_sec() == pytest.approx(1.01) and mean.take() is None


def test_the_states_of_arm_and_hand_which_come_apart_are_one() -> None:
    joints = NewestJoints(["a", "b"])
    joints.push(JointState(name=["b", "finger"], position=[2.0, 9.0]))
    joints.push(JointState(name=["a"], position=[1.0], velocity=[0.5], effort=[0.1]))
    found = joints.take()
    assert (found.name, found.position, found.velocity[0]) == (["a", "b"], [1.0, 2.0], 0.5) and math.isnan(
        found.velocity[1]
    )
    assert joints.take() is None


def test_the_force_shown_is_the_one_that_acts_on_the_arm() -> None:
    told, reaction = WrenchStamped(), ReactionWrench()
    told.header.frame_id, told.wrench.force.x, told.wrench.torque.z = "K", 3.0, -1.0
    reaction.push(told)
    found = reaction.take()
    assert (found.header.frame_id, found.wrench.force.x, found.wrench.torque.z) == ("K", -3.0, 1.0)


def test_a_history_keeps_the_window_and_restarts_where_time_goes_back() -> None:
    history = SampleHistory()
    for k in range(200):
        history.store(0.25 * k, (("a",), (float(k),), "N"))
    names, unit, times, values = history.read()
    assert (names, unit, values.shape[1]) == (("a",), "N", 1) and times[-1] - times[0] == pytest.approx(WINDOW)
    history.store(1.0, (("a",), (0.0,), "N"))
    assert len(history.read()[2]) == 1


class Feed:
    """Publisher of the topics of a robot and its sensors, until it is closed."""

    def __init__(self) -> None:
        import rospy

        kinds = {
            "joint_states": JointState,
            "franka_state_controller/F_ext": WrenchStamped,
            "franka_state_controller/franka_states": FrankaState,
            "cartesian_pose_controller/state": MarkerTrackingState,
            "hric/perception/emg/envelope": SampleChunk,
            "hric/perception/force_plate/left/wrench": WrenchStamped,
            "hric/human/grip": HumanGrip,
            "hric/human/contacts": RegionContacts,
            "hric/human/joint_states": JointState,
            "hric/human/activation": MuscleActivation,
        }
        self._publishers = {topic: rospy.Publisher(f"/{topic}", kind, queue_size=10) for topic, kind in kinds.items()}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        count = 0
        layout = Layout("made up", ("biceps",), ("MVC",), 200.0)
        while not self._stop.wait(0.01):
            stamp = stamps.to_time(1.0 + 0.01 * count)
            messages: dict[str, Any] = {topic: publisher.data_class() for topic, publisher in self._publishers.items()}
            joints = messages["joint_states"]
            joints.name, joints.position, joints.velocity, joints.effort = ["arm_joint1"], [1.97], [0.0], [0.0]
            messages["franka_state_controller/F_ext"].wrench.force.x = 5.0
            messages["franka_state_controller/franka_states"].O_T_EE[12:15] = [0.5, 0.0, 0.01]
            messages["hric/human/joint_states"].name = ["arm_joint1"]
            messages["hric/human/joint_states"].position = [0.0]
            messages["hric/human/activation"].name, messages["hric/human/activation"].activation = ["muscle"], [0.5]
            messages["hric/human/grip"] = held(5.0)
            messages["hric/human/contacts"].touching = [touch(40.0)]
            messages["hric/perception/emg/envelope"] = chunk_message(
                Chunk(layout, stamp.to_sec(), 2 * count, np.full((2, 1), 0.25))
            )
            for topic, message in messages.items():
                message.header.stamp = stamp
                self._publishers[topic].publish(message)
            count += 1

    def close(self) -> None:
        """Stop publishing."""
        self._stop.set()
        self._thread.join()
        for publisher in self._publishers.values():
            publisher.unregister()


@pytest.mark.rostest
def test_the_node_sends_what_viewers_take_and_marks_what_is_near_and_a_picture_of_it_is_saved(
    ros: str,  # noqa: F811
    nodes: Nodes,  # noqa: F811
    tmp_path: Path,
) -> None:
    import rospy

    rospy.set_param("/robot_description", URDF)
    rospy.set_param("/hric/human/robot_description", URDF)
    rospy.set_param("/robot/participants/human", {"type": "hric_human/Human", "subject": "P50_male"})
    rospy.set_param("/hric/human/muscle_lines", {"muscle": [["base", 0.1, 0.0, 0.0], ["one", 0.0, 0.0, 0.2]]})
    rospy.set_param(
        "/cartesian_pose_controller",
        {"workspace": {"lower": [-0.8, -0.8, 0.0], "upper": [0.8, 0.8, 1.2]}, "arm_id": "arm"},
    )
    rospy.set_param("/live_view/plates", ["left"])
    heard: dict[str, list[Any]] = {}
    kinds = {
        "joints": JointState,
        "arm_wrench": WrenchStamped,
        "emg": SampleChunk,
        "force_plate/left/wrench": WrenchStamped,
        "limits": MarkerArray,
        "human": MarkerArray,
        "human/skin": rospy.AnyMsg,  # its content is tested above
    }
    subscribers = [
        rospy.Subscriber(
            f"/hric/view/{name}", kind, lambda message, name=name: heard.setdefault(name, []).append(message)
        )
        for name, kind in kinds.items()
    ]
    feed = Feed()
    try:
        nodes.start("live_view")
        begin = time.monotonic()
        while (
            len(heard) < len(kinds)
            or len(heard["joints"]) < 30
            or not (_marked(heard["limits"], "limits/workspace") and _marked(heard["human"], "human/muscles"))
        ):
            assert time.monotonic() - begin < 40.0, {name: len(found) for name, found in heard.items()}
            time.sleep(0.05)
        picture = tmp_path / "picture.png"
        environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
        plot = [str(Path(__file__).parents[1] / "nodes" / "live_plot")]
        told = subprocess.run(
            [*plot, "positions", "emg", "--screenshot", str(picture), "--after", "1"],
            env=environment,
            capture_output=True,
            timeout=60,
        )
        assert told.returncode == 0 and picture.stat().st_size > 10_000, told.stderr
        for given, words in ((["nothing"], "no panel 'nothing'; valid: efforts"), ([], "--screenshot FILE")):
            refused = subprocess.run([*plot, *given], env=environment, capture_output=True, text=True, timeout=60)
            assert refused.returncode == 2 and words in refused.stderr and refused.stderr.count("\n") == 1
    finally:
        feed.close()
        for subscriber in subscribers:
            subscriber.unregister()
    gaps = np.diff([message.header.stamp.to_sec() for message in heard["joints"]])
    assert np.all(gaps > 0.0) and np.median(gaps) >= 0.02, "fewer than come in"
    assert heard["arm_wrench"][0].wrench.force.x == -5.0 and list(heard["emg"][0].data) == [0.25]
    (words,) = {marker.text for marker in _marked(heard["limits"], "limits/words")}
    assert words == "arm_joint1: 0.03 rad from its upper end"
    assert {(marker.type, marker.header.frame_id) for marker in _marked(heard["limits"], "limits/ranges")} == {
        (Marker.LINE_LIST, "base")
    }
    texts = {marker.text for array in heard["human"] for marker in array.markers if marker.text}
    assert texts == {"guide: 5.0 N", "lower arm, wrist: 40 N"}
    (start, end), muscle = _marked(heard["human"], "human/muscles")[-1].points, _marked(heard["human"], "human/muscles")
    assert [start.x, start.y, start.z, end.x] == pytest.approx([0.1, 0.0, 0.0, 0.0]) and end.y == pytest.approx(-0.2)
    assert [muscle[-1].colors[0].r, end.z] == pytest.approx([colour([0.5])[0][0], 0.3])
    wall = _marked(heard["limits"], "limits/workspace")[0]
    assert (wall.header.frame_id, wall.pose.position.z) == ("arm_link0", 0.0)


def _marked(arrays: list[Any], namespace: str) -> list[Any]:
    return [marker for array in arrays for marker in array.markers if marker.ns == namespace]
