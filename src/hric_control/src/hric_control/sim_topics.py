"""Topics of a simulated robot under `sim/`: contacts, motor efforts, the poses of the models, and joint loads where the plant can tell them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Twist, Vector3, Wrench
from sensor_msgs.msg import JointState

from gazebo_msgs.msg import ContactsState, ContactState, ModelStates
from hric_control import contact_info, poses, realtime, stamps, urdf
from hric_control.errors import HricError
from hric_control.node import Node
from hric_control.plant import Contact, FloatArray
from hric_control.plants.reactions import JointReaction, ReactingPlant
from hric_msgs.msg import JointReactions

if TYPE_CHECKING:
    from hric_control.sim_services import SimulatedRobot

CONTACTS_EVERY = 0.01
"""[s of run time]"""
MODELS_EVERY = 0.1
"""[s of run time]"""
REACTIONS_EVERY = 0.01
"""[s of run time]"""
MOTORS_EVERY = 0.01
"""[s of run time]"""


class SimTopics:
    """Publishes from the loop: reads the engine there, builds the messages elsewhere.

    Args:
        hw: the simulated robot.
        node: namespace of the topics.
        robot: name of the robot's model.
    """

    def __init__(self, hw: SimulatedRobot, node: Node, robot: str) -> None:
        self._loop, self._plant, self._node, self._robot = hw.loop, hw.plant, node, robot
        self._root = urdf.root_link(urdf.parse(hw.description))
        self._contacts = realtime.publisher(node, "contacts", ContactsState)
        self._models = realtime.publisher(node, "model_states", ModelStates)
        self._motors = realtime.publisher(node, "motor_efforts", JointState)
        self._motor_cycles = max(1, round(MOTORS_EVERY / self._loop.time_step))
        self._reactions = realtime.publisher(node, "joint_reactions", JointReactions) if isinstance(hw.plant, ReactingPlant) else None
        self._reaction_cycles = max(1, round(REACTIONS_EVERY / self._loop.time_step))
        self._contact_cycles = max(1, round(CONTACTS_EVERY / self._loop.time_step))
        self._model_cycles = max(1, round(MODELS_EVERY / self._loop.time_step))
        self._told = False
        self._touching = True  # the first message says that there is none
        self._loop.after_cycle.append(self._publish)

    def unregister(self) -> None:
        """Stop publishing."""
        self._loop.after_cycle.remove(self._publish)
        self._contacts.unregister()
        self._models.unregister()
        self._motors.unregister()
        if self._reactions is not None:
            self._reactions.unregister()

    def _publish(self, time: float) -> None:
        cycle = self._loop.cycles
        if cycle % self._contact_cycles == 0:
            contacts, peaks = self._plant.contacts(), self._plant.take_contact_peaks()
            if contacts or peaks or self._touching:
                self._touching = bool(contacts or peaks)
                self._contacts.publish(contacts_message, contacts, time, peaks)
        if cycle % self._motor_cycles == 0 and self._motors.subscribers():
            self._motors.publish(motors_message, self._plant.joint_names, self._plant.motor_effort(), time)
        if cycle % self._model_cycles == 0 and self._models.subscribers():
            names = [self._robot, *self._plant.model_names()]
            states = [self._state(name) for name in names]
            self._models.publish(models_message, names, states)
        if self._reactions is not None and cycle % self._reaction_cycles == 0 and self._reactions.subscribers():
            assert isinstance(self._plant, ReactingPlant)
            self._reactions.publish(reactions_message, self._plant.joint_reactions(), time)

    def _state(self, name: str) -> tuple[FloatArray, FloatArray]:
        """(T_world_base, twist) of a model; the origin if the plant cannot tell, said once."""
        try:
            body = self._root if name == self._robot else f"{name}::{self._plant.base_link(name)}"
            return self._plant.link_state(body)
        except HricError as error:
            if not self._told:
                self._told = True
                text = f"model_states: {error}"
                realtime.defer(self._node, lambda: self._node.log_warn(text))
            return np.eye(4), np.zeros(6)


def contacts_message(contacts: list[Contact], time: float, peaks: Mapping[tuple[str, str], float] | None = None) -> Any:
    """gazebo_msgs/ContactsState in the world frame: one state per pair of bodies, with all its points; forces act on collision1.

    Args:
        contacts: of one cycle.
        time: run time at which that cycle measured [s].
        peaks: of pairs that met by a spring since the message before [N]; one that has parted again has a state without points.
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
    """sensor_msgs/JointState with the efforts of the motors in one cycle.

    Args:
        joint_names, efforts: of that cycle [N m or N].
        time: run time at which it measured [s].
    """
    message = JointState(name=list(joint_names), effort=efforts)
    message.header.stamp = stamps.to_time(time)
    return message


def models_message(names: list[str], states: list[tuple[FloatArray, FloatArray]]) -> Any:
    """gazebo_msgs/ModelStates in the world frame."""
    message = ModelStates(name=names)
    for T, twist in states:
        pose, velocity = Pose(), Twist()
        poses.fill(pose, T)
        poses.fill_twist(velocity, twist)
        message.pose.append(pose)
        message.twist.append(velocity)
    return message


def reactions_message(reactions: list[JointReaction], time: float) -> Any:
    """hric_msgs/JointReactions of one cycle.

    Args:
        reactions: of that cycle.
        time: run time at which it measured [s].
    """
    message = JointReactions()
    message.header.stamp, message.header.frame_id = stamps.to_time(time), "world"
    for reaction in reactions:
        message.joint_names.append(reaction.joint)
        message.link_names.append(reaction.link)
        message.positions.append(Point(*reaction.position))
        message.wrenches.append(Wrench(force=Vector3(*reaction.force), torque=Vector3(*reaction.torque)))
    return message
