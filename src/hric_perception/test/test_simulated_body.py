"""The simulated human as measured by cameras and a force plate, from messages alone, without a simulation."""

import math
from typing import Any

import numpy as np
import pinocchio
import pytest
from geometry_msgs.msg import PoseStamped
from moving_body import BODY, JOINTS, PERIOD, PERSON, RANGES, Oracle, joint_state, motion
from numpy.testing import assert_allclose
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from hric_core.errors import HricError, ParameterError
from hric_core.geometry import Pose, from_rotation_vector
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_core.local.node import LocalNode
from hric_core.robot_time import stamps
from hric_human.participant.settings import HumanSettings
from hric_msgs.msg import HumanEvent, HumanGrip, MocapData
from hric_perception.human import see
from hric_perception.human.truth import Truth
from hric_perception.plate.loads import FloorLoad
from hric_perception.simulated import JointTrack, KnownTime, follow_events, follow_grips, follow_joints
from mocap_natnet.headless import HeadlessMocap, robot_time
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.node.publisher import MocapPublisher

WORLD_FROM_BASE = {"xyz": [0.3, -0.2, 0.5], "xyzw": list(from_rotation_vector((0.0, 0.0, 0.7)))}
BASE_FROM_MOCAP = {"xyz": [1.0, -2.0, 0.3], "xyzw": list(from_rotation_vector((0.0, 0.0, 0.4)))}


def event(time: float, kind: str) -> Any:
    message = HumanEvent(kind=kind)
    message.header.stamp = stamps.to_time(time)
    return message


def test_between_two_messages_joints_are_on_the_cubic_through_positions_and_velocities() -> None:
    track = JointTrack(JOINTS)
    assert track.at(0.0) is None and track.known == -math.inf
    for k in range(200):
        q, dq, _ = motion(k * PERIOD)
        track.add(k * PERIOD, JOINTS, q.tolist(), dq.tolist())
    assert track.known == pytest.approx(0.995)
    fourth = max(0.15 * (high - low) for low, high in RANGES) * (2.0 * np.pi * (0.3 + 0.05 * len(JOINTS))) ** 4
    bound = PERIOD**4 / 384.0 * fourth  # of cubic Hermite interpolation
    for time in np.random.default_rng(1).uniform(0.0, 0.995, 100):
        assert_allclose(track.at(time), motion(time)[0], atol=bound + 1e-12)
    assert track.at(2.0) == pytest.approx(motion(0.995)[0].tolist()), "nothing is guessed beyond what is known"


def test_messages_that_begin_again_replace_those_before_and_those_of_another_body_are_refused() -> None:
    track = JointTrack(["a"])
    for time, q in ((1.0, 1.0), (2.0, 2.0), (0.5, 5.0)):
        track.add(time, ["a"], [q], [0.0])
    assert track.known == 0.5 and track.at(1.5) == [5.0]
    with pytest.raises(
        HricError, match="the joint states of the human name b; valid: the joints of the section human, a"
    ):
        track.add(3.0, ["b"], [0.0], [0.0])


def test_a_clock_that_waits_for_what_is_measured_goes_no_further() -> None:
    class Told:
        time: float | None = 5.0

        def now(self) -> float | None:
            return self.time

        def monotonic(self, run: float) -> int | None:
            return round(run * 1e9)

    known = [-math.inf]
    clock, told = KnownTime(Told(), lambda: known[0], 0.25), Told
    assert clock.now() is None
    known[0] = 4.0
    assert clock.now() == 4.25 and clock.monotonic(1.5) == 1_500_000_000
    known[0] = 6.0
    assert clock.now() == 5.0
    told.time = None
    assert clock.now() is None


def seen(stream: dict[str, Any], seed: int = 0) -> tuple[list[Any], list[Any], list[str]]:
    """(frames, true poses of the hand, phases) of a second, the person's messages 12 ms late."""
    node = LocalNode({"client": {"up_axis": "y", "base_from_mocap": BASE_FROM_MOCAP, "base_frame": "panda_link0"}})
    built = see(
        {"program": "body", "still": {"table": [0.5, 0.3, 0.1]}},
        stream,
        BASE_FROM_MOCAP,
        seed,
        person=PERSON,
        world_from_base=WORLD_FROM_BASE,
    )
    assert built.body is not None
    mocap = HeadlessMocap(built.motive, MocapPublisher(node, Publishing.read(node.child("client")), robot_time))
    truth = Truth(node, built.hand, "panda_link0")
    follow_joints(node, built.body.states.add)
    follow_events(node, built.body.happened)
    frames, poses, phases = list[Any](), list[Any](), list[Any]()
    node.subscribe("/hric/perception/mocap", MocapData, frames.append)
    node.subscribe("/hric/human/hand", PoseStamped, poses.append)
    node.subscribe("/hric/human/phase", String, phases.append)
    told, events = (node.advertise(f"hric/human/{name}", kind) for name, kind in TOPICS)
    for k in range(1012):
        now = 1e-3 * (k - 12)
        if now >= 0.0 and (k - 12) % 5 == 0:
            told.publish(joint_state(now))
        if k - 12 in MARKS:
            events.publish(event(now, MARKS[k - 12]))
        mocap.advance(1e-3 * k, built.body.states.known)
        if built.body.states.known >= 0.0:
            truth.advance(built.body.states.known)
    return frames, poses, [message.data for message in phases]


TOPICS = (("joint_states", JointState), ("events", HumanEvent))
TORQUE = np.array([0.5, -0.25, 1.0])
"""Torque of the grip about its point [N m]."""
MARKS = {100: "closed", 300: "started", 800: "ended"}
"""Events of the person, by milliseconds."""


def in_base(p_world: np.ndarray) -> list[float]:
    R, p = rotation_from_quaternion(WORLD_FROM_BASE["xyzw"]), np.array(WORLD_FROM_BASE["xyz"])
    return list(R.T @ (p_world - p))


def test_hand_and_markers_arrive_in_the_base_where_an_independent_library_has_them() -> None:
    frames, poses, phases = seen({"rate": 120.0})
    oracle, hand = Oracle(), BODY.segments["right_hand"]
    assert [message.frame_number for message in frames] == list(range(120))
    for message in frames[::10]:
        time = message.header.stamp.to_sec()
        assert time == pytest.approx(message.frame_number / 120.0, abs=1e-8), "late messages change no stamp"
        assert [body.name for body in message.rigid_bodies] == ["hand", "table"]
        p = message.rigid_bodies[0].pose.position
        assert [p.x, p.y, p.z] == pytest.approx(in_base(oracle.point(time, hand.link, hand.mass.com)), abs=1e-6)
        named = dict(zip(message.labelled_marker_names, message.labelled_markers, strict=True))
        for name, marker in BODY.markers.items():
            p = named[f"body/{name}"]
            expected = in_base(oracle.point(time, marker.link, marker.p_link_marker))
            assert [p.x, p.y, p.z] == pytest.approx(expected, abs=1e-6)
    for message in poses[::10]:
        p = message.pose.position
        expected = in_base(oracle.point(message.header.stamp.to_sec(), hand.link, hand.mass.com))
        assert [p.x, p.y, p.z] == pytest.approx(expected, abs=1e-8)
    assert phases == ["rest", "moving", "done"]


def test_a_frame_waits_for_the_state_that_it_shows_and_for_its_latency() -> None:
    frames, _, _ = seen({"rate": 100.0, "latency": 0.002})
    # A state of 5 ms multiples is known 12 ms later.
    assert {round(message.latency, 4) for message in frames} == {0.012}
    frames, _, _ = seen({"rate": 100.0, "latency": 0.02})
    assert {round(message.latency, 4) for message in frames} == {0.02}


def test_what_is_seen_repeats_with_the_seed() -> None:
    stream = {"noise": 1e-4, "marker_noise": 1e-4, "loss": 0.05}
    first, again, other = ([str(message) for message in seen(stream, seed)[0]] for seed in (1, 1, 2))
    assert first == again and first != other


def test_nobody_in_the_plant_is_refused_by_name() -> None:
    with pytest.raises(
        ParameterError, match=r"mocap\.person is not set, but \{program: body\} measures a simulated human"
    ):
        see({"program": "body"}, {}, None, 0, "mocap.")
    with pytest.raises(ParameterError, match=r"no subject 'nobody' in mocap\.person\.subject"):
        see({"program": "body"}, {}, None, 0, "mocap.", person={"subject": "nobody"})
    with pytest.raises(ParameterError, match=r"side is 'left'; valid: dominant or right"):
        see({"program": "body"}, {}, None, 0, "mocap.", person={"parts": "right_arm", "control": {"side": "left"}})


def grip(time: float, held: str, holder: str, force: list[float], point: list[float]) -> Any:
    message = HumanGrip(name="guide", held=held, holder=holder, closed=True)
    message.header.stamp = stamps.to_time(time)
    f, m, p = message.wrench.force, message.wrench.torque, message.point
    (f.x, f.y, f.z), (m.x, m.y, m.z), (p.x, p.y, p.z) = force, TORQUE, point
    return message


@pytest.mark.parametrize(
    ("held", "holder", "sign"),
    [("panda_hand", "human::r_wrist", 1.0), ("human::r_wrist", "panda_hand", -1.0), ("box::box", "panda_hand", 0.0)],
)
def test_the_plate_measures_what_inverse_dynamics_asks_and_what_the_grips_add(
    held: str, holder: str, sign: float
) -> None:
    T_world_plate = Pose((0.9, 0.15, -0.75), from_rotation_vector((0.0, 0.0, 0.6)))
    person = HumanSettings.of(PERSON | {"grips": {"guide": {"held": "panda_hand"}}}, "human")
    load, node, oracle = FloorLoad(person, T_world_plate), LocalNode(), Oracle()
    follow_joints(node, load.add)
    follow_grips(node, load.hold)
    told, grips = node.advertise("hric/human/joint_states", JointState), node.advertise("hric/human/grip", HumanGrip)
    force, point = np.array([10.0, -5.0, 20.0]), np.array([0.5, 0.1, 0.6])
    assert load.known == -math.inf
    for k in range(101):
        told.publish(joint_state(k * PERIOD))
        if k < 99:
            grips.publish(grip(k * PERIOD, held, holder, force.tolist(), point.tolist()))
    assert load.known == pytest.approx(98 * PERIOD), "of the 99th message the force of the grip is not known"
    R, p = rotation_from_quaternion(T_world_plate.orientation), np.array(T_world_plate.position)
    rest = (BODY.subject.mass - BODY.total_mass) * np.array([0.0, 0.0, -9.81])
    for k in range(2, 98, 7):
        found = load(np.array([k * PERIOD]))[0]
        body_force, body_torque = oracle.pressed(k * PERIOD)
        total = body_force + rest + sign * force
        torque = body_torque + np.cross(oracle.root.position, rest)
        torque += sign * (np.cross(point, force) + TORQUE)
        expected = np.concatenate([R.T @ total, R.T @ (torque - np.cross(p, total))])
        # By differences of velocities over 10 ms an acceleration of frequency w lacks (w h)^2 / 6 of it, here up to
        # 2e-4 of some 10 N.
        assert_allclose(found, expected, atol=2e-3)


def test_the_centre_of_pressure_of_who_stands_still_is_below_their_centre_of_mass() -> None:
    load, oracle = FloorLoad(HumanSettings.of(PERSON, "human"), Pose((0.9, 0.1, -0.75))), Oracle()
    q = motion(0.0)[0].tolist()
    for k in range(3):
        load.add(k * PERIOD, JOINTS, q, [0.0] * len(q))
    fx, fy, fz, mx, my, mz = load(np.array([PERIOD]))[0]
    assert (fx, fy) == pytest.approx((0.0, 0.0), abs=1e-9) and fz == pytest.approx(-9.81 * BODY.subject.mass)
    com = pinocchio.centerOfMass(oracle.model, oracle.data, oracle.state(0.0)[0])
    share = BODY.total_mass / BODY.subject.mass
    expected = share * (com[:2] - [0.9, 0.1])  # the rest of the person is below the middle between their shoulders
    assert (-my / fz, mx / fz) == pytest.approx(tuple(expected), abs=1e-9)
    assert mz == pytest.approx(0.0, abs=1e-9)
