"""Impossible data of a person near a supervised arm, without a master: the arm is stopped in time."""

import math

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from hric_control.speed_scale import stopping_time
from hric_core.robot_time import stamps
from hric_msgs.msg import MocapData, RigidBodyState, SafetyEvent, SafetyState, SpeedScale, SpeedScaleState
from hric_run.definition import experiment
from hric_run.definition.parameters import SUPERVISOR
from hric_run.simulation import Simulation
from hric_supervisor.app import HeadlessSupervisor
from hric_supervisor.arm import ArmShape, ArmState
from hric_supervisor.separation import STANDING
from hric_supervisor.settings import SupervisorSettings

NAME, OWN = "shared_workspace", SupervisorSettings()
PROTECTIVE_TIME = OWN.reaction_time + stopping_time(1.0) + OWN.settling_time
BEGIN = 2.6
"""Time at which the person's data changes, while the arm is moving [s]."""


class Cameras:
    """Frames of motion capture with a hand, 100 a second."""

    def __init__(self, node):
        self._publisher = node.advertise("hric/perception/mocap", MocapData)
        self._rng = np.random.default_rng(0)

    def show(self, time, x, noise=1e-4):
        body = RigidBodyState(name="hand", tracking_valid=True)
        p = body.pose.position
        p.x, p.y, p.z = np.array([x, 0.0, 0.5]) + self._rng.normal(0.0, noise, 3)
        message = MocapData(rigid_bodies=[body])
        message.header.stamp, message.header.frame_id = stamps.to_time(time), "panda_link0"
        self._publisher.publish(message)


def jumps(cameras, second, time):
    cameras.show(time, 6.0 if time > BEGIN else 4.0)


def freezes(cameras, second, time):
    cameras.show(time, 4.0, 1e-4 if time < BEGIN else 0.0)


def repeats_its_stamp(cameras, second, time):
    cameras.show(min(time, BEGIN), 4.0)


def doubles(cameras, second, time):
    cameras.show(time, 4.0)
    if time > BEGIN:
        second.show(time, 4.0)


def interleaves(cameras, second, time):
    if time > BEGIN:
        cameras.show(time - 0.005, 5.0)
    cameras.show(time, 4.0)


def vanishes(cameras, second, time):
    if time < BEGIN:
        cameras.show(time, 4.0)


PERSONS = {
    jumps: "jumped",
    freezes: "is frozen",
    repeats_its_stamp: "stale",
    doubles: "is doubled: / and /#1 both publish /hric/perception/mocap",
    interleaves: "jumped",
    vanishes: "stale",
}


class Watched:
    """Experiment `shared_workspace` with a hand tracked by cameras instead of the human; the arm moves all the time."""

    def __init__(self):
        raw = experiment.read(NAME)
        del raw["human"], raw["supervisor"]
        raw["robot"]["plant_type"] = "mujoco_ros_control/MujocoPlant"
        self.simulation = Simulation(experiment.parse(NAME, raw))
        node, self.events = self.simulation.node, []
        node.set_param(SUPERVISOR, {"source": "marker"})
        node.subscribe("hric/safety/events", SafetyEvent, self.events.append)
        self.supervisor = HeadlessSupervisor(node.child(SUPERVISOR), lambda name, _, request: node.call(name, request))

    def run(self, person, end):
        """Run with a person in view of the cameras until a time [s]."""
        cameras, second = Cameras(self.simulation.node), Cameras(self.simulation.node)
        for k in range(1, round(100 * end)):
            person(cameras, second, 0.01 * k)
            self.simulation.run(0.01)
            self.supervisor.advance(0.01 * k)


def last_motion(simulation):
    """Last time at which the arm's fastest point was above the speed of standstill [s], and its largest speed [m/s]."""
    log = simulation.signals
    arm = ArmShape(simulation.node.param("robot_description"), log.joint_names)
    rows = slice(None, None, 5)
    fastest = [
        np.linalg.norm(arm.at(ArmState(t, q, dq)).velocities, axis=2).max()
        for t, q, dq in zip(log.time[rows], log.position[rows], log.velocity[rows], strict=True)
    ]
    moving = np.array(fastest) > STANDING
    return log.time[rows][np.flatnonzero(moving)[-1]], max(fastest)


@pytest.mark.parametrize("person", PERSONS, ids=lambda person: person.__name__)
def test_the_arm_stands_within_the_protective_time_and_the_fault_is_named(person):
    watched = Watched()
    with watched.simulation:
        watched.run(person, 3.8)
        stopped, fastest = last_motion(watched.simulation)
    assert fastest > 0.2
    (fault,) = [event for event in watched.events if event.kind == "fault" and event.header.stamp.to_sec() > 0.5]
    assert PERSONS[person] in fault.text
    assert stopped - BEGIN <= PROTECTIVE_TIME + 2.0 / OWN.rate


def test_a_second_human_in_the_plants_namespace_stops_the_arm():
    events = []
    with Simulation(NAME, simulator="mujoco") as simulation:
        simulation.node.subscribe("hric/safety/events", SafetyEvent, events.append)
        messages = []
        simulation.node.subscribe("hric/human/joint_states", JointState, messages.append)
        simulation.run(BEGIN)
        ghost = simulation.node.advertise("hric/human/joint_states", JointState)
        for _ in range(10):
            ghost.publish(messages[0])
            simulation.run(0.01)
    (fault,) = [event for event in events if event.kind == "fault"]
    assert "the person is doubled" in fault.text and "hric/human/joint_states" in fault.text


@pytest.mark.parametrize("valid_for", [0.0, 0.005])
def test_a_second_publisher_of_the_speed_scale_never_speeds_the_arm_up_and_is_named_where_it_holds(valid_for):
    events, states = [], []
    with Simulation(NAME, simulator="mujoco") as simulation:
        simulation.node.subscribe("hric/safety/events", SafetyEvent, events.append)
        simulation.node.subscribe("hric/safety/speed_scale_state", SpeedScaleState, states.append)
        rogue = simulation.node.advertise("hric/safety/speed_scale", SpeedScale)
        while not any(event.kind == "stopped" for event in events):
            rogue.publish(SpeedScale(scale=1.0, stiffness=math.inf, force=math.inf, valid_for=valid_for))
            simulation.run(0.001)
        begin = simulation.signals.time[-1]
        for _ in range(800):
            rogue.publish(SpeedScale(scale=1.0, stiffness=math.inf, force=math.inf, valid_for=valid_for))
            simulation.run(0.001)
        log = simulation.signals
        standing = np.abs(log.velocity[log.time > begin + stopping_time(1.0) + OWN.settling_time])
        assert len(standing) > 100 and standing.max() < 0.01
        assert not any(event.kind in ("held", "holder_lost") for event in events)
        simulation.run(0.1)  # the rogue falls silent
    lost = [event.text for event in events if event.kind == "holder_lost"]
    assert len(lost) == (1 if valid_for else 0) and all(
        text.startswith("/ requested no speed scale in time") for text in lost
    )


@pytest.mark.parametrize(("x", "link"), [(1.2, "hand/hand"), (6.0, "human/")])
def test_of_the_human_in_the_plant_and_a_hand_before_cameras_the_nearer_decides(x, link):
    raw = experiment.read(NAME)
    raw["mocap"] = {
        "stream": {"noise": 1e-4},
        "human": {"program": "sinusoid", "begin": 0.1, "centre": [x, 0.0, 0.5], "amplitude": [0.05, 0.0, 0.0]},
        "base_from_mocap": {"xyz": [0, 0, 0], "xyzw": [0, 0, 0, 1]},
    }
    raw["supervisor"]["source"] = ["human", "marker"]
    raw["robot"]["plant_type"] = "mujoco_ros_control/MujocoPlant"
    states = []
    with Simulation(experiment.parse(NAME, raw)) as simulation:
        simulation.node.subscribe("hric/safety/state", SafetyState, states.append)
        simulation.run(1.0)
    known = [state for state in states if not state.fault]
    assert len(known) > 80 and all(state.person_link.startswith(link) for state in known)
