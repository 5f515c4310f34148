"""Topics of a simulated robot in the namespace `sim`: contacts, motor efforts, model poses, and joint loads."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Vector3, Wrench
from sensor_msgs.msg import JointState

from gazebo_msgs.msg import ContactsState, ContactState, ModelStates
from hric_control.plant import Contact, FloatArray, JointReaction, ReactingPlant
from hric_control.sim import contact_info
from hric_control.sim.simulated_robot import SimulatedRobot
from hric_core import realtime
from hric_core.errors import HricError
from hric_core.geometry import pose_of_transform, stamped
from hric_core.node import Node
from hric_core.robot_time import stamps
from hric_core.urdf import read
from hric_msgs.msg import JointReactions

CONTACTS_PERIOD = 0.01
"""Period of the topic `sim/contacts` [s of robot time]."""
MODELS_PERIOD = 0.1
"""Period of the topic `sim/model_states` [s of robot time]."""
REACTIONS_PERIOD = 0.01
"""Period of the topic `sim/joint_reactions` [s of robot time]."""
MOTORS_PERIOD = 0.01
"""Period of the topic `sim/motor_efforts` [s of robot time]."""


class SimTopics:
    """Publisher of a simulated robot's topics; it reads the plant in the loop and builds messages in another thread.

    Args:
        hw: the simulated robot.
        node: node of the topics' namespace.
        robot: name of the robot's model.
    """

    def __init__(self, hw: SimulatedRobot, node: Node, robot: str) -> None:
        self._loop, self._plant, self._node, self._robot = hw.loop, hw.plant, node, robot
        self._root = read(hw.description).root
        self._contacts = realtime.publisher(node, "contacts", ContactsState)
        self._models = realtime.publisher(node, "model_states", ModelStates)
        self._motors = realtime.publisher(node, "motor_efforts", JointState)
        self._reactions: tuple[ReactingPlant, realtime.RealtimePublisher] | None = None
        if isinstance(hw.plant, ReactingPlant):
            self._reactions = hw.plant, realtime.publisher(node, "joint_reactions", JointReactions)
        periods = (CONTACTS_PERIOD, MODELS_PERIOD, MOTORS_PERIOD, REACTIONS_PERIOD)
        self._cycles = [max(1, round(period / self._loop.time_step)) for period in periods]
        self._common = math.gcd(*self._cycles)
        self._warning_logged = False
        self._touching = True  # so that the first message is sent without a contact, too
        self._loop.after_cycle.append(self._publish)

    def _publish(self, time: float) -> None:
        cycle = self._loop.cycles
        if cycle % self._common:
            return
        contacts, models, motors, reactions = self._cycles
        if cycle % contacts == 0:
            self._publish_contacts(time)
        if cycle % motors == 0 and self._motors.subscribers():
            self._motors.publish(motors_message, self._plant.joint_names, self._plant.motor_effort(), time)
        if cycle % models == 0 and self._models.subscribers():
            names = [self._robot, *self._plant.model_names()]
            self._models.publish(models_message, names, [self._state(name) for name in names])
        if cycle % reactions == 0 and self._reactions is not None:
            plant, publisher = self._reactions
            if publisher.subscribers():
                publisher.publish(reactions_message, plant.joint_reactions(), time)

    def _publish_contacts(self, time: float) -> None:
        contacts, peaks = self._plant.contacts(), self._plant.take_contact_peaks()
        if contacts or peaks or self._touching:
            self._touching = bool(contacts or peaks)
            self._contacts.publish(contacts_message, contacts, time, peaks)

    def _state(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Return (T_world_base, twist) of a model; the world's origin, with one warning, if the plant reports none."""
        try:
            body = self._root if name == self._robot else f"{name}::{self._plant.base_link(name)}"
            return self._plant.link_state(body)
        except HricError as error:
            if not self._warning_logged:
                self._warning_logged = True
                text = f"model_states: {error}"
                realtime.defer(self._node, lambda: self._node.log_warn(text))
            return np.eye(4), np.zeros(6)


def contacts_message(contacts: list[Contact], time: float, peaks: Mapping[tuple[str, str], float] | None = None) -> Any:
    """Return gazebo_msgs/ContactsState in the world frame, one state per pair of bodies; forces act on collision1.

    Args:
        contacts: contacts in one cycle.
        time: robot time of the cycle's state [s].
        peaks: peak penalty contact forces since the last message by pair of bodies [N]; a pair that is not in contact
            now gets a state without contact points.
    """
    message = ContactsState()
    message.header.stamp, message.header.frame_id = stamps.to_time(time), "world"
    states: dict[tuple[str, str], Any] = {}
    for pair, peak in (peaks or {}).items():
        states[pair] = _state_of(message, pair, contact_info.text(*pair, "penalty", peak))
    for contact in contacts:
        pair = (contact.body_a, contact.body_b)
        if pair not in states:
            states[pair] = _state_of(message, pair, contact_info.text(*pair, contact.kind))
        state, force = states[pair], [contact.force * part for part in contact.normal]
        state.wrenches.append(Wrench(force=Vector3(*force)))
        state.contact_positions.append(Vector3(*contact.position))
        state.contact_normals.append(Vector3(*contact.normal))
        state.depths.append(contact.depth)
        total = state.total_wrench.force
        total.x, total.y, total.z = total.x + force[0], total.y + force[1], total.z + force[2]
    return message


def _state_of(message: Any, pair: tuple[str, str], info: str) -> Any:
    state = ContactState(info=info, collision1_name=pair[0], collision2_name=pair[1])
    message.states.append(state)
    return state


def motors_message(joint_names: Sequence[str], efforts: list[float], time: float) -> Any:
    """Return sensor_msgs/JointState with the efforts of the motors in one cycle.

    Args:
        joint_names: names of the joints.
        efforts: motor efforts in this cycle [N m or N].
        time: robot time of the cycle's state [s].
    """
    message: JointState = object.__new__(JointState)  # the constructor takes three times as long
    message.header, message.name, message.effort = stamped.header(stamps.to_time(time), ""), list(joint_names), efforts
    message.position, message.velocity = [], []
    return message


def models_message(names: list[str], states: list[tuple[FloatArray, FloatArray]]) -> Any:
    """Return gazebo_msgs/ModelStates in the world frame, from (pose, shape (4, 4); twist, shape (6,)) of each model."""
    message = ModelStates(name=names)
    message.pose = [stamped.pose_message(pose_of_transform(T)) for T, _ in states]
    message.twist = [stamped.twist_message(twist.tolist()) for _, twist in states]
    return message


def reactions_message(reactions: list[JointReaction], time: float) -> Any:
    """Return the joint loads in one cycle as hric_msgs/JointReactions.

    Args:
        reactions: joint loads in this cycle.
        time: robot time of the cycle's state [s].
    """
    message: JointReactions = object.__new__(JointReactions)
    message.header = stamped.header(stamps.to_time(time), "world")
    message.joint_names = [reaction.joint for reaction in reactions]
    message.link_names = [reaction.link for reaction in reactions]
    message.positions = [stamped.point_message(reaction.position) for reaction in reactions]
    message.wrenches = [stamped.wrench_of(reaction.force, reaction.torque) for reaction in reactions]
    return message
