"""Who sees the person: a tracked one by the messages of his node."""

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from hric_assessment.supervisor.inputs import PERSON_JOINTS, PERSON_TRACKING, TrackedInput
from hric_assessment.supervisor.person import BodyShape
from hric_control.geometry import Pose
from hric_control.local.node import LocalNode
from hric_control.robot_time import stamps
from hric_human.tracking import LOST, MEASURED, Estimate
from hric_msgs.msg import PersonTracking
from hric_perception.person.frames import Messages
from hric_perception.person.settings import PersonSettings

FRAME, ROOT = "panda_link0", Pose((1.2, 0.3, 0.9), (0.0, 0.0, 1.0, 0.0))
BODY, _ = PersonSettings().known()
RNG = np.random.default_rng(3)


class Tracking:
    """What the node of a person publishes, and the input that takes it."""

    def __init__(self):
        node, self.came = LocalNode({}), 0
        self.input = TrackedInput(node, "", None, "person", FRAME)
        self.input.came = self._on_came
        self.joints = node.advertise(PERSON_JOINTS, JointState)
        self.tracking = node.advertise(PERSON_TRACKING, PersonTracking)
        self.messages = Messages(BODY, True)

    def _on_came(self):
        self.came += 1

    def publish(self, time, q, lost=(), root_state=MEASURED, turned=False):
        states = [LOST if name in lost else MEASURED for name in BODY.joints]
        one = Estimate(time, ROOT, q.tolist(), [0.0] * len(q), root_state, states, 0.001, ())
        head = Header(stamp=stamps.to_time(time), frame_id=FRAME)
        pairs = [
            (self.joints, self.messages.joint_states(head, one)),
            (self.tracking, self.messages.tracking(head, one, 0)),
        ]
        for publisher, message in reversed(pairs) if turned else pairs:
            publisher.publish(message)


@pytest.mark.parametrize("turned", [False, True])
def test_a_tracked_person_is_where_his_joints_and_his_root_have_him(turned):
    tracking, q = Tracking(), RNG.uniform(0.0, 0.5, len(BODY.joints))
    assert tracking.input.newest is None
    tracking.publish(0.5, q, turned=turned)
    seen = tracking.input.newest
    expected = BodyShape(BODY, ROOT).seen(0.5, FRAME, dict(zip(BODY.joints, q.tolist(), strict=True)))
    assert (seen.stamp, seen.frame, seen.links, tracking.came) == (0.5, tracking.input.frame, expected.links, 1)
    np.testing.assert_allclose(seen.ends, expected.ends, atol=1e-12)


@pytest.mark.parametrize("lost", [{"lost": ("right_el_flex",)}, {"root_state": LOST}])
def test_who_is_lost_in_part_is_not_known_and_so_becomes_stale(lost):
    tracking, q = Tracking(), np.zeros(len(BODY.joints))
    tracking.publish(0.5, q)
    tracking.publish(0.6, q, **lost)
    assert tracking.input.newest.stamp == 0.5 and tracking.came == 1
    tracking.publish(0.7, q)
    assert tracking.input.newest.stamp == 0.7
