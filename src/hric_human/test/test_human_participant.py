"""The human in a robot's plant: a Panda that is held, and a person who takes its hand."""

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sensor_msgs.msg import JointState
from std_srvs.srv import TriggerRequest

import panda_description
from hric_control.plant import Contact
from hric_control.robot_app import RobotApp
from hric_core import plugins
from hric_core.errors import HricError, ParameterError
from hric_core.geometry import homogeneous
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_core.local.node import LocalNode
from hric_human.body import Subject, describe
from hric_human.control import HumanControl
from hric_human.control.whole_body import WholeBody
from hric_human.muscles.anatomy import BUILT_IN, load
from hric_human.muscles.joint_contact import Pulls
from hric_human.participant.settings import HumanSettings
from hric_msgs.msg import (
    HumanEvent,
    HumanGrip,
    JointReactions,
    JointTorque,
    MuscleActivation,
    MuscleForce,
    RegionContacts,
)

PLANTS = list(plugins.names(plugins.PLANT))
READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
HAND = [0.42, 0.0, 0.55]
"""Position in front of the robot's hand at READY, where a handle would be, in the world [m]."""
ASIDE = [0.5, 0.2, 0.6]
"""Position of the hand away from the handle [m]."""
BALL = """<robot name="ball"><link name="ball"><inertial><mass value="0.2"/>
  <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="0.03"/></geometry></collision></link></robot>"""
TAKEN: dict[str, Any] = {"held": "panda_hand", "handle": [0.113, 0.0, 0.04], "close": {"distance": 0.01}}


def moves(*points: list[float]) -> dict[str, Any]:
    """A mapping `control` by which the person's hand goes from point to point: [s, m]."""
    return {"parameters": {"reference": {"program": "minimum_jerk", "points": list(points)}}}


class Lab:
    """A robot whose brakes are on, and a human."""

    def __init__(self, human: dict[str, Any], plant_type: str, **plant: Any) -> None:
        beside = {"type": "hric_human/Human", "position": [0.85, -0.2], **human}
        robot = {
            "robot_hw": "hric_control/RobotHWSim",
            "plant_type": plant_type,
            "real_time_factor": 0.0,
            "q_start": READY,
            "plant": {"rotor_inertia": 0.1, **plant},
            "participants": {"human": beside},
        }
        self.node = LocalNode({"robot_description": panda_description.load(), "robot": robot})
        self.heard: dict[str, list[Any]] = {}
        for topic, kind in (
            ("joint_states", JointState),
            ("joint_torque", JointTorque),
            ("grip", HumanGrip),
            ("events", HumanEvent),
        ):
            messages = self.heard[topic] = []
            self.node.subscribe(f"hric/human/{topic}", kind, messages.append)
        self.app = RobotApp(self.node, self.node.child("robot"))

    def call(self, service: str) -> Any:
        return self.node.call(f"hric/human/{service}", TriggerRequest())

    def events(self, kind: str) -> list[Any]:
        return [event for event in self.heard["events"] if event.kind == kind]


@pytest.fixture(params=PLANTS, ids=lambda name: name.rpartition("/")[2])
def plant_type(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def lab(request: pytest.FixtureRequest) -> Iterator[Callable[..., Lab]]:
    """Return a function that builds a Lab: lab(plant_type=..., **keys of the human)."""
    made: list[Lab] = []

    def make(
        plant_type: str = "mujoco_ros_control/MujocoPlant", plant: dict[str, Any] | None = None, **human: Any
    ) -> Lab:
        made.append(Lab(human, plant_type, **plant or {}))
        return made[-1]

    yield make
    for one in made:
        one.app.shutdown()


def test_the_person_stands_where_their_motion_begins_and_stays_there_until_it_does(lab: Any, plant_type: str) -> None:
    there = lab(plant_type, control=moves([0.0, *ASIDE], [1.0, 0.45, 0.3, 0.6]))
    there.app.run(0.5)
    first, last = there.heard["joint_states"][0], there.heard["joint_states"][-1]
    assert_allclose(last.position, first.position, atol=1e-9)
    body = describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male"))
    control = HumanControl(body, {}, 0)
    assert list(first.name) == list(control.person.joints)
    T, _ = there.app.hw.plant.link_state("human::r_wrist")
    assert_allclose((T @ [*control.person.hand.p_link_hand, 1.0])[:3], ASIDE, atol=1e-6)


def test_all_that_the_person_says_is_stamped_with_the_epoch_of_the_run_and_robot_time(lab: Any) -> None:
    there = lab(control=moves([0.0, *ASIDE], [0.5, 0.45, 0.3, 0.6]), grips={"guide": TAKEN})
    there.app.hw._participants.set_epoch(1000.0)
    there.app.run(0.1)
    assert there.call("start").success
    there.app.run(0.1)
    first = {topic: round(messages[0].header.stamp.to_sec(), 6) for topic, messages in there.heard.items()}
    assert first == {"joint_states": 1000.0, "joint_torque": 1000.0, "grip": 1000.0, "events": 1000.1}


def test_the_person_moves_from_the_start_on_and_says_when_the_person_is_done(lab: Any) -> None:
    there = lab(control=moves([0.0, *ASIDE], [0.5, 0.45, 0.3, 0.6]))
    there.app.run(0.2)
    assert there.call("start").success
    there.app.run(1.0)
    assert [(event.kind, round(event.header.stamp.to_sec(), 3)) for event in there.heard["events"]] == [
        ("started", 0.2),
        ("ended", 0.7),
    ]
    answer = there.call("start")
    assert not answer.success and "already started" in answer.message


def test_a_grip_closes_where_palm_and_handle_are_near_and_carries_what_the_motion_needs(
    lab: Any, plant_type: str
) -> None:
    there = lab(plant_type, control=moves([0.0, *HAND], [0.5, 0.42, 0.05, 0.55]), grips={"guide": TAKEN})
    there.app.run(0.1)
    assert [event.name for event in there.events("closed")] == ["guide"]
    there.call("start")
    there.app.run(1.0)
    last = there.heard["grip"][-1]
    # The robot's brakes hold its hand, so the person's goes nowhere, and feels a force against its way.
    assert last.closed and last.wrench.force.y < -2.0
    assert last.held == "panda_hand" and last.holder == "human::r_wrist"
    assert last.stretch < 5e-3


def test_a_grip_out_of_reach_waits_and_its_service_says_how_far_it_is(lab: Any) -> None:
    there = lab(control=moves([0.0, *ASIDE]), grips={"guide": TAKEN})
    there.app.run(0.1)
    answer = there.call("grips/guide/close")
    assert not answer.success
    assert re.search(r"human::r_wrist is 0\.\d+ m from the handle of panda_hand; valid: up to 0.01 m", answer.message)
    assert not there.heard["grip"][-1].closed


def test_a_grip_opens_at_its_time_and_by_the_service(lab: Any) -> None:
    grips = {"a": {**TAKEN, "release": {"time": 0.2}}, "b": TAKEN}
    there = lab(control=moves([0.0, *HAND]), grips=grips)
    there.call("start")
    there.app.run(0.5)
    assert [(event.name, round(event.header.stamp.to_sec(), 3)) for event in there.events("released")] == [("a", 0.2)]
    assert there.call("grips/b/open").success
    there.app.run(0.1)
    assert not there.heard["grip"][-1].closed
    assert "holds nothing" in there.call("grips/b/open").message


def test_a_grip_opens_so_long_after_its_load(lab: Any) -> None:
    grips = {"guide": {**TAKEN, "release": {"load": 3.0, "delay": 0.1}}}
    there = lab(control=moves([0.0, *HAND], [0.5, 0.42, 0.1, 0.55]), grips=grips, rate=1000.0)
    there.call("start")
    there.app.run(1.0)
    loads = [np.linalg.norm([f.x, f.y, f.z]) for f in (grip.wrench.force for grip in there.heard["grip"])]
    reached = next(k for k, load in enumerate(loads) if load >= 3.0)
    released = there.events("released")[0].header.stamp.to_sec()
    assert released == pytest.approx(there.heard["grip"][reached].header.stamp.to_sec() + 0.1, abs=1e-9)


def test_a_grip_that_slips_says_so_once_per_slip(lab: Any) -> None:
    grips = {"guide": {**TAKEN, "force_limit": 3.0}}
    there = lab(control=moves([0.0, *HAND], [0.5, 0.42, 0.1, 0.55]), grips=grips)
    there.call("start")
    there.app.run(1.0)
    assert len(there.events("slipped")) == 1
    assert there.events("slipped")[0].value == pytest.approx(3.0)
    assert there.heard["grip"][-1].slipped > 1e-3


def test_a_joint_at_its_strength_is_an_event_and_counted(lab: Any) -> None:
    stiff = {"parameters": {**moves([0.0, *HAND], [0.5, 0.42, 0.2, 0.55])["parameters"], "stiffness": 2000.0}}
    there = lab(control=stiff, grips={"guide": TAKEN})
    there.call("start")
    there.app.run(0.6)
    told = there.heard["joint_torque"][-1]
    names = {event.name for event in there.events("strength")}
    assert names == {name for name, count in zip(told.name, told.clipped, strict=True) if count}
    assert names and max(map(abs, told.strength_share)) <= 1.0 + 1e-12


def test_a_reset_puts_them_back_with_their_grip_and_the_person_waits_again(lab: Any, plant_type: str) -> None:
    there = lab(plant_type, control=moves([0.0, *HAND], [0.3, 0.42, 0.05, 0.55]), grips={"guide": TAKEN})
    there.app.run(0.05)
    start = there.heard["joint_states"][0].position
    there.call("start")
    there.app.run(0.4)
    there.app.hw.reset()
    there.app.run(0.05)
    assert_allclose(there.heard["joint_states"][-1].position, start, atol=2e-3)
    assert there.heard["grip"][-1].closed
    assert there.call("start").success


@pytest.mark.parametrize(
    ("human", "said"),
    [
        ({"subject": "nobody"}, "no subject 'nobody' .*valid: .*P50_male"),
        ({"parts": "tail"}, "parts is 'tail'; valid: right_arm, "),
        ({"control": {"type": "lab/None"}}, "no human controller 'lab/None'"),
        (
            {"control": moves([0.0, 5.0, 0.0, 0.0])},
            "human/control/parameters/reference: 0.00 s after the motion's start, .*reach",
        ),
        ({"grips": {"guide": {"held": "tail"}}}, "no link 'tail' in .*human/grips/guide; valid: .*panda_hand"),
        ({"grips": {"guide": {}}}, "grips.guide.held is not set"),
        ({"watches": "panda_elbow"}, "no link 'panda_elbow' in .*human/watches; valid: .*panda_hand"),
        ({"rate": 0}, "rate is 0; valid: .*above 0"),
    ],
)
def test_a_mistake_is_refused_before_anything_moves(lab: Any, human: dict[str, Any], said: str) -> None:
    with pytest.raises((ParameterError, HricError), match=said):
        lab(**human)


def test_what_touches_them_is_published_by_region_until_it_has_parted(lab: Any, plant_type: str) -> None:
    there = lab(plant_type, control=moves([0.0, *ASIDE]))
    plant, position = there.app.hw.plant, there.app.hw.plant.link_state("human::r_wrist")[0]
    above = homogeneous(np.eye(3), position[:3, 3] + [0.0, 0.0, 0.15])
    plant.spawn("ball", BALL, above)
    messages: list[Any] = []
    there.node.subscribe("hric/human/contacts", RegionContacts, messages.append)
    there.app.run(1.0)
    ended = [one for message in messages for one in message.ended]
    first = ended[0]
    assert first.regions == ["hand, fingers"]
    assert first.kind == "penalty" and first.other == "ball::ball" and first.dominant
    # A fall of 0.1 m at the most onto 75 N/mm, v sqrt(mu k), mu no more than the ball's mass.
    assert 10.0 < first.peak < math.sqrt(2.0 * 9.81 * 0.15 * 0.2 * 75e3)
    assert not messages[-1].touching
    seen = next(one for message in messages for one in message.touching)
    normal = seen.begin_normal
    assert (seen.link, normal.z) == ("r_elbow", pytest.approx(-1.0, abs=1e-6)), (
        "the ball falls on the forearm beside it"
    )
    assert seen.begin_speed == pytest.approx(9.81 * (seen.begin - 1e-3), rel=1e-3)
    p, now, n = seen.begin_point, seen.point, seen.normal
    assert [now.x, now.y, now.z] == pytest.approx([p.x, p.y, p.z], abs=5e-3) and n.z < -0.99


def swapped(contact: Contact) -> Contact:
    """Name the two bodies the other way round: the same force of the same contact."""
    x, y, z = contact.normal
    return replace(contact, body_a=contact.body_b, body_b=contact.body_a, normal=(-x, -y, -z))


@pytest.mark.parametrize("names", ["as the engine has them", "the other way round"])
def test_the_force_of_a_ball_from_above_is_felt_downwards_whichever_body_an_engine_names_first(
    lab: Any, monkeypatch: pytest.MonkeyPatch, names: str
) -> None:
    there, felt = lab(control=moves([0.0, *ASIDE])), list[Any]()
    plant, update = there.app.hw.plant, HumanControl.update
    if names == "the other way round":
        contacts = plant.contacts
        monkeypatch.setattr(plant, "contacts", lambda: [swapped(contact) for contact in contacts()])
    monkeypatch.setattr(HumanControl, "update", lambda *args: felt.append(args[4]) or update(*args))
    T_world_wrist = plant.link_state("human::r_wrist")[0]
    person = HumanControl(describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male")), {}, 0).person
    p_world_hand = (T_world_wrist @ [*person.hand.p_link_hand, 1.0])[:3]
    plant.spawn("ball", BALL, homogeneous(np.eye(3), np.add(p_world_hand, [0.0, 0.0, 0.12])))
    there.app.run(0.3)
    forces = np.array([force for force in felt if any(force)])
    assert len(forces) > 5
    assert forces[:, 2].max() < 0.0


def heard_of_muscles(there: Lab) -> dict[str, list[Any]]:
    kinds = {"activation": MuscleActivation, "muscle_force": MuscleForce, "joint_reactions": JointReactions}
    heard: dict[str, list[Any]] = {topic: [] for topic in kinds}
    for topic, kind in kinds.items():
        there.node.subscribe(f"hric/human/{topic}", kind, heard[topic].append)
    return heard


def test_muscles_hold_their_arm_where_their_joints_would(lab: Any, plant_type: str) -> None:
    found = []
    for drive in ("torque", "muscle"):
        there = lab(plant_type, control=moves([0.0, *ASIDE], [1.0, 0.45, 0.2, 0.6]), drive=drive)
        there.app.run(0.1)
        there.call("start")
        there.app.run(1.4)
        found.append([list(message.position) for message in there.heard["joint_states"]])
    assert len(found[0]) == len(found[1]) == 300
    assert_allclose(found[1], found[0], atol=5e-3)


def test_activation_force_and_joint_loads_have_the_stamps_of_their_joint_states(lab: Any) -> None:
    there = lab(drive="muscle", control=moves([0.0, *HAND], [0.5, 0.42, 0.05, 0.55]), grips={"guide": TAKEN})
    heard = heard_of_muscles(there)
    there.app.hw._participants.set_epoch(1000.0)
    there.app.run(0.1)
    stamps = [message.header.stamp for message in there.heard["joint_states"]]
    for topic, messages in heard.items():
        assert [message.header.stamp for message in messages] == stamps, topic
    activation, force, reactions = (messages[-1] for messages in heard.values())
    assert len(activation.name) == 38 and list(activation.name[:34]) == force.name
    assert "right_bic_l" in force.name and activation.name[-1] == "right_wr_dev-"
    assert reactions.joint_names == ["right_shoulder", "right_elbow"]
    assert set(reactions.link_names) <= set(
        WholeBody(describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male"))).index
    )
    size = np.linalg.norm([reactions.wrenches[0].force.x, reactions.wrenches[0].force.y, reactions.wrenches[0].force.z])
    assert 100.0 < size < 2000.0


def test_a_joint_load_counts_what_their_hand_holds(lab: Any) -> None:
    """At rest the reaction in a joint is the sum of the muscle forces across it and of weight and grip of all distal
    parts; without muscles across it, of weight and grip only."""
    there = lab(drive="muscle", control=moves([0.0, *HAND], [0.3, 0.42, 0.05, 0.55]), grips={"guide": TAKEN})
    heard = heard_of_muscles(there)
    there.app.run(0.1)
    there.call("start")
    there.app.run(1.5)
    grip, force, state = there.heard["grip"][-1], heard["muscle_force"][-1], there.heard["joint_states"][-1]
    person = HumanControl(describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male")), {}, 0).person
    root = HumanSettings.of({"position": [0.85, -0.2]}, "human").root(person.body)
    pulls = Pulls(load(BUILT_IN))
    angles = np.array([[state.position[state.name.index(f"right_{name}")] for name in load(BUILT_IN).joints]])
    own = [force.force[force.name.index(f"right_{name}")] for name in pulls.names["shoulder"]]
    pull = rotation_from_quaternion(root.orientation) @ (np.array(own) @ pulls.at(angles)["shoulder"][0])
    weight = 9.81 * sum(segment.mass.mass for segment in person.body.segments.values())
    f, load_of_grip = heard["joint_reactions"][-1].wrenches[0].force, grip.wrench.force
    held = np.array([load_of_grip.x, load_of_grip.y, load_of_grip.z])
    assert abs(held[1]) > 2.0
    assert_allclose(np.array([f.x, f.y, f.z]) + pull + held, [0.0, 0.0, weight], atol=0.3)


def test_a_muscle_that_gives_all_it_can_is_an_event_and_the_run_goes_on(lab: Any) -> None:
    there = lab(drive="muscle", muscles={"strength": 0.1}, control=moves([0.0, *ASIDE]))
    heard = heard_of_muscles(there)
    there.app.run(0.3)
    events, last = there.events("muscle"), heard["activation"][-1]
    assert events and "reaches full activation (1 times so far)" in events[0].text
    assert last.limited[last.name.index(events[0].name)] >= 1


def test_muscles_are_as_at_the_start_after_a_reset(lab: Any) -> None:
    there = lab(drive="muscle", control=moves([0.0, *ASIDE], [0.4, 0.45, 0.3, 0.6]))
    heard = heard_of_muscles(there)["activation"]
    there.app.run(0.1)
    there.call("start")
    there.app.run(0.2)
    first = [message.activation for message in heard]
    heard.clear()
    there.app.hw.reset()
    there.app.run(0.1)
    assert [message.activation for message in heard][:20] == first[:20]
