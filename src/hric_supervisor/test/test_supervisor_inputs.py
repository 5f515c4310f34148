"""Person sources of the supervisor: a tracked person by the messages of the tracking node."""

from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from hric_core.geometry import Pose
from hric_core.local.node import LocalNode
from hric_core.robot_time import stamps
from hric_motion.tracking import BRIDGED, LOST, MEASURED, PersonEstimate
from hric_msgs.msg import MocapData, PersonTracking, RigidBodyState
from hric_perception.person.frames import BodyMessages
from hric_perception.person.settings import PersonSettings
from hric_supervisor.inputs import (
    FRAMES,
    HUMAN_JOINTS,
    HUMAN_ROOT,
    PERSON_JOINTS,
    PERSON_TRACKING,
    ArmInput,
    HumanInput,
    MarkerInput,
    Pairs,
    TrackedInput,
)
from hric_supervisor.person import BodyShape

FRAME, ROOT = "panda_link0", Pose((1.2, 0.3, 0.9), (0.0, 0.0, 1.0, 0.0))
BODY, _ = PersonSettings().known()
RNG = np.random.default_rng(3)


class Tracking:
    """Messages that the node `person` publishes, and the supervisor's input that receives them."""

    def __init__(self):
        self.node, self.came = node, _ = LocalNode({}), 0
        self.input = TrackedInput(node, "", None, "person", FRAME, 0.05)
        self.input.came = self._on_came
        self.joints = node.advertise(PERSON_JOINTS, JointState)
        self.tracking = node.advertise(PERSON_TRACKING, PersonTracking)
        self.messages = BodyMessages(BODY, True)

    def _on_came(self):
        self.came += 1

    def publish(self, time, q, lost=(), root_state=MEASURED, turned=False, residual=0.001):
        states = [LOST if name in lost else MEASURED for name in BODY.joints]
        one = PersonEstimate(time, ROOT, q.tolist(), [0.0] * len(q), root_state, states, residual, ())
        head = Header(stamp=stamps.to_time(time), frame_id=FRAME)
        pairs = [
            (self.joints, self.messages.joint_states(head, one)),
            (self.tracking, self.messages.tracking(head, one, 0)),
        ]
        for publisher, message in reversed(pairs) if turned else pairs:
            publisher.publish(message)


@pytest.mark.parametrize("turned", [False, True])
def test_a_tracked_person_is_where_their_joints_and_their_root_have_them(turned):
    tracking, q = Tracking(), RNG.uniform(0.0, 0.5, len(BODY.joints))
    assert tracking.input.take() is None
    tracking.publish(0.5, q, turned=turned)
    seen = tracking.input.take()
    expected = BodyShape(BODY, ROOT).seen(0.5, FRAME, dict(zip(BODY.joints, q.tolist(), strict=True)))
    assert (seen.stamp, seen.frame, seen.links, tracking.came) == (0.5, tracking.input.frame, expected.links, 1)
    np.testing.assert_allclose(seen.ends, expected.ends, atol=1e-12)


@pytest.mark.parametrize("lost", [{"lost": ("right_el_flex",)}, {"root_state": LOST}])
def test_who_is_lost_in_part_is_not_known_and_so_becomes_stale(lost):
    tracking, q = Tracking(), np.zeros(len(BODY.joints))
    tracking.publish(0.5, q)
    tracking.publish(0.6, q, **lost)
    assert tracking.input.take().stamp == 0.5 and tracking.came == 1
    tracking.publish(0.7, q)
    assert tracking.input.take().stamp == 0.7


@pytest.mark.parametrize(
    ("residual", "state", "fault"),
    [
        (0.05, MEASURED, ""),
        (0.06, MEASURED, "has markers 0.060 m away from those of the body; valid: up to person_uncertainty, 0.05 m"),
        (np.nan, MEASURED, "has markers nan m away"),
        (np.nan, BRIDGED, ""),
    ],
)
def test_a_body_that_does_not_fit_the_markers_is_a_fault(residual, state, fault):
    tracking = Tracking()
    tracking.publish(0.5, np.zeros(len(BODY.joints)), residual=residual, root_state=state)
    found = tracking.input.take().fault
    assert found.startswith(fault) and bool(found) == bool(fault)


def test_messages_are_paired_by_their_stamps_however_late_one_topic_is():
    taken = []
    pairs = Pairs(lambda a, b: taken.append((a.name, b.name)))
    for k in range(5):
        pairs.add(0, one("joints", k))
    assert not taken
    for k in (0, 2, 4):
        pairs.add(1, one("root", k))
    assert taken == [("joints0", "root0"), ("joints2", "root2"), ("joints4", "root4")]
    for k in range(10, 200):
        pairs.add(0, one("joints", k))
    pairs.add(1, one("root", 10))  # too late
    pairs.add(1, one("root", 199))
    assert taken[3:] == [("joints199", "root199")]


def one(name, stamp):
    return SimpleNamespace(header=Header(stamp=stamps.to_time(0.01 * stamp)), name=f"{name}{stamp}")


def test_a_human_who_walks_has_no_speed_of_late_messages():
    """Joints and root of the person come on two topics; while one is late, the other misleads."""
    node = LocalNode({})
    human = HumanInput(
        node, "", {"parts": "upper_body", "walk": {"points": [[1.0, 0.0, 0.0], [2.0, 1.0, 0.0]]}}, "human"
    )
    joints, root = node.advertise(HUMAN_JOINTS, JointState), node.advertise(HUMAN_ROOT, PoseStamped)
    for k in range(4):
        message = PoseStamped(header=Header(stamp=stamps.to_time(0.01 * k), frame_id="world"))
        message.pose.position.x, message.pose.orientation.w = 0.016 * k, 1.0
        root.publish(message)
    where = []
    for k in range(4):
        names = list(human._shape._names)
        joints.publish(JointState(Header(stamp=stamps.to_time(0.01 * k)), names, [0.0] * len(names), [], []))
        where.append(human.take().ends[0, 0, 0])
    np.testing.assert_allclose(np.diff(where), 0.016, atol=1e-9)


def test_two_nodes_that_publish_one_person_are_a_fault_that_names_both():
    tracking, q = Tracking(), np.zeros(len(BODY.joints))
    tracking.publish(0.5, q)
    assert not tracking.input.take().fault
    second = tracking.node.child("second")
    tracking.joints, tracking.tracking = (
        second.advertise(f"/{PERSON_JOINTS}", JointState),
        second.advertise(f"/{PERSON_TRACKING}", PersonTracking),
    )
    tracking.publish(0.51, q)
    fault = tracking.input.take().fault
    assert fault.startswith("is doubled: / and /second both publish hric/person/")
    tracking.publish(0.52, q)
    assert not tracking.input.take().fault  # the other one is gone


def test_each_pose_between_two_decisions_is_handed_on():
    tracking = Tracking()
    for k in range(4):
        tracking.publish(0.5 + 0.01 * k, np.full(len(BODY.joints), 0.1 * k))
    newest = tracking.input.take()
    assert [round(seen.stamp, 2) for seen in (*newest.earlier, newest)] == [0.5, 0.51, 0.52, 0.53]
    assert tracking.input.take() is newest


@pytest.mark.parametrize(
    ("names", "positions", "said"),
    [
        (lambda names: names[:-1], lambda q: q[:-1], "other joints"),
        (lambda names: [*names, "tail"], lambda q: [*q, 0.0], "other joints"),
        (lambda names: names, lambda q: q[:-1], "cannot be placed"),
    ],
)
def test_joints_that_are_others_than_before_or_without_angles_are_a_fault(names, positions, said):
    node = LocalNode({})
    person = HumanInput(node, "", {"parts": "upper_body"}, "human")
    joints = node.advertise(HUMAN_JOINTS, JointState)
    own = list(person._shape._names)
    joints.publish(JointState(Header(stamp=stamps.to_time(0.1)), own, [0.0] * len(own), [], []))
    assert not person.take().fault
    joints.publish(JointState(Header(stamp=stamps.to_time(0.2)), names(own), positions([0.0] * len(own)), [], []))
    assert said in person.take().fault


def test_two_rigid_bodies_of_one_name_in_a_frame_are_a_fault():
    node = LocalNode({})
    hand, frames = MarkerInput(node, "", 0.15, "hand", FRAME), node.advertise(FRAMES, MocapData)
    for count in (1, 2):
        head = Header(stamp=stamps.to_time(count), frame_id=FRAME)
        bodies = [RigidBodyState(name="hand", tracking_valid=True) for _ in range(count)]
        frames.publish(MocapData(header=head, rigid_bodies=bodies))
        fault = hand.take().fault
        assert fault == ("" if count == 1 else "is doubled: 2 rigid bodies hand in one frame")


def test_of_an_arm_without_speeds_nothing_is_known():
    node = LocalNode({})
    arm, joints = ArmInput(node, "", ["a"]), node.advertise("joint_states", JointState)
    joints.publish(JointState(name=["a"], position=[0.0], velocity=[]))
    assert arm.take() is None
    joints.publish(JointState(name=["a"], position=[0.0], velocity=[0.1]))
    assert arm.take() is not None


def test_two_nodes_that_publish_one_arm_are_a_fault_that_names_both():
    node = LocalNode({})
    arm, own = ArmInput(node, "", ["a"]), node.advertise("joint_states", JointState)
    gripper = node.child("gripper").advertise("/joint_states", JointState)
    second = node.child("second").advertise("/joint_states", JointState)
    own.publish(JointState(name=["a"], position=[0.0], velocity=[0.1]))
    gripper.publish(JointState(name=["finger"], position=[0.0], velocity=[0.1]))
    own.publish(JointState(name=["a", "finger"], position=[0.0, 0.0], velocity=[0.1, 0.0]))
    assert not arm.take().fault
    second.publish(JointState(name=["a"], position=[0.0], velocity=[0.0]))
    fault = arm.take().fault
    assert fault == "is doubled: / and /second both publish joint_states"
    assert not arm.take().fault
    own.publish(JointState(name=["a"], position=[0.0], velocity=[0.1]))
    assert arm.take().fault == "is doubled: /second and / both publish joint_states"


def test_an_arm_with_a_joint_twice_is_not_known():
    node = LocalNode({})
    arm, joints = ArmInput(node, "", ["a"]), node.advertise("joint_states", JointState)
    joints.publish(JointState(name=["a", "a"], position=[0.0, 1.0], velocity=[0.1, 0.0]))
    assert arm.take() is None
