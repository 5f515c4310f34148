"""Parts of the window keep the newest message of a topic, in the axes of the arm, and forget what is old."""

import math
import time

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, TransformStamped, WrenchStamped
from tf2_msgs.msg import TFMessage

from franka_msgs.msg import FrankaState
from hric_assessment.contact.limits import Limits
from hric_msgs.msg import MocapData, MuscleActivation, RegionContact, RegionContacts, RigidBodyState
from hric_view.parts import LOST, LiveHand, LiveMocap, LiveMuscles, LivePlates, LiveStatics, LiveTouches

FOREARM = "right lower arm, wrist"


def turned(parent: str, child: str, x: float) -> TFMessage:
    """Static transform: at x, turned by 90 deg about z."""
    item = TransformStamped(child_frame_id=child)
    item.header.frame_id, item.transform.translation.x = parent, x
    item.transform.rotation.z = item.transform.rotation.w = math.sqrt(0.5)
    return TFMessage([item])


def frame_of(frame_id: str) -> MocapData:
    hand = RigidBodyState(name="hand", tracking_valid=True, pose=Pose(position=Point(1.0, 0.0, 0.0)))
    hand.pose.orientation.w = 1.0
    message = MocapData(rigid_bodies=[hand, RigidBodyState(name="lost")])
    message.header.frame_id = frame_id
    message.labelled_marker_names, message.labelled_marker_ids = ["hand/1", ""], [1, 7]
    message.labelled_markers = [Point(0.0, 1.0, 0.5), Point(math.nan, 0.0, 0.0)]
    return message


def test_motion_capture_is_given_in_the_axes_of_the_arm() -> None:
    statics = LiveStatics(["base"], lambda plate: None)
    statics.push(turned("base", "mocap", 2.0))
    mocap = LiveMocap(statics)
    mocap.push(frame_of("mocap"))
    assert mocap.frame()["mocap"] == {
        "parent": "base",
        "values": {
            "hand/1": pytest.approx([1.0, 0.0, 0.5]),
            "body hand": pytest.approx([2.0, 1.0, 0.0, 0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)], abs=1e-5),
        },
    }


def test_an_old_message_no_longer_counts() -> None:
    mocap = LiveMocap(LiveStatics(["base"], lambda plate: None))
    mocap.push(frame_of("base"))
    assert "mocap" in mocap.frame()
    time.sleep(1.2 * LOST)
    assert mocap.frame() == {}


def test_the_force_on_the_arm_is_opposite_to_that_of_the_arm() -> None:
    state = FrankaState()
    T_base_ee, T_ee_k = np.eye(4), np.eye(4)
    T_base_ee[:3, 3], T_ee_k[:3, 3] = (0.3, 0.0, 0.5), (0.0, 0.0, 0.1)
    state.O_T_EE, state.EE_T_K = T_base_ee.T.ravel().tolist(), T_ee_k.T.ravel().tolist()
    state.O_F_ext_hat_K = [5.0, 0.0, -2.0, 0.0, 0.0, 0.0]
    hand = LiveHand("base")
    hand.push(state)
    shown = hand.frame()["hand"]
    assert shown["force"] == [-5.0, 0.0, 2.0] and shown["point"] == [0.3, 0.0, 0.6]  # type: ignore[index]


def test_a_state_without_a_pose_is_not_drawn() -> None:
    hand = LiveHand("base")
    hand.push(FrankaState())
    assert hand.frame() == {}


def test_a_plate_appears_with_its_place() -> None:
    new: list[str] = []
    statics = LiveStatics(["base"], new.append)
    plates = LivePlates(statics)
    statics.push(turned("base", "force_plate_2", 1.0))
    push = plates.add(*new)
    message = WrenchStamped()
    message.wrench.force.z = -700.0
    push(message)
    (plate,) = plates.frame()["plates"]  # type: ignore[misc]
    assert plate["xyz"] == [1.0, 0.0, 0.0] and plate["force"] == [0.0, 0.0, -700.0]  # type: ignore[index]
    message.wrench.force.z = math.nan
    push(message)
    (plate,) = plates.frame()["plates"]  # type: ignore[misc]
    assert plate["force"] is None  # type: ignore[index]


def test_a_muscle_without_activation_is_unknown() -> None:
    muscles = LiveMuscles({"bic": [["one", 0, 0, 0], ["one", 0, 0, 1]], "tri": [["one", 0, 0, 0], ["one", 1, 0, 0]]})
    assert muscles.frame() == {}
    muscles.push(MuscleActivation(name=["tri"], activation=[0.256]))
    assert muscles.frame() == {"muscles": [None, 0.26]}


@pytest.mark.parametrize(
    ("changes", "share"),
    [
        ({"force": 32.0, "duration": 0.1}, 0.1),  # transient limit 320 N
        ({"force": 32.0, "duration": 0.9}, 0.2),  # quasi-static limit 160 N
        ({"force": 32.0, "area": math.nan}, None),  # the pressure may be above its limit
        ({"force": 640.0, "area": math.nan}, 2.0),
        ({"force": math.nan}, None),
        ({"force": 1.0, "regions": []}, None),
        ({"force": 1.0, "regions": ["face"]}, 1.0),
    ],
)
def test_the_share_is_that_of_the_limit(changes: dict[str, object], share: float | None) -> None:
    contact = RegionContact(link="r_elbow", regions=["lower arm, wrist"], area=1e-2)
    for name, value in changes.items():
        setattr(contact, name, value)
    assert LiveTouches(Limits.named()).share(contact, contact.force) == share


def test_the_largest_share_between_frames_is_shown() -> None:
    touches = LiveTouches(Limits.named())
    for force in (32.0, 64.0, 16.0):
        touches.push(RegionContacts(touching=[touching(force)]))
    assert touches.frame() == {"touched": {FOREARM: 0.2}}
    assert touches.frame() == {"touched": {}}


@pytest.mark.parametrize(
    ("forces", "share"), [((math.nan, 32.0), None), ((32.0, math.nan), None), ((math.nan, 640.0), 2.0)]
)
def test_an_unknown_share_hides_those_within_the_limit(forces: tuple[float, ...], share: float | None) -> None:
    touches = LiveTouches(Limits.named())
    touches.push(RegionContacts(touching=[touching(force) for force in forces]))
    assert touches.frame() == {"touched": {FOREARM: share}}


def touching(force: float) -> RegionContact:
    """Return a contact of the forearm with a known area."""
    return RegionContact(link="r_elbow", regions=["lower arm, wrist"], area=1e-2, force=force)
