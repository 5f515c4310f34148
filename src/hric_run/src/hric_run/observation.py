"""State of a simulation at one instant as NumPy arrays: arm, person, contacts and distance, without ROS messages."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hric_control.plant import Articulated, Contact
from hric_control.sim.simulated_robot import SimulatedRobot
from hric_core.geometry import FloatArray, pose_of_transform
from hric_core.node import Node
from hric_human.body.segments import ROOT
from hric_human.control.human_control import hand_side
from hric_human.control.kinematics import HandChain
from hric_human.participant.settings import HUMAN, MUSCLE, HumanSettings
from hric_msgs.msg import JointTorque, MuscleActivation
from hric_supervisor.arm import ArmShape, ArmState, PlacedCapsules
from hric_supervisor.person import BodyShape, Observation
from hric_supervisor.separation import nearest_capsules


@dataclass(frozen=True)
class ArmObservation:
    """State of the robot at the time of the last measurement.

    Attributes:
        q, dq, tau: joint positions, velocities and measured torques, shape (n,) each [rad], [rad/s], [N m].
        T_base_ee: pose of the end effector in the base frame (O_T_EE), shape (4, 4); None: not a Franka arm.
        wrench_base: external force and moment that the control box estimates at the stiffness frame, in the axes of the
            base (O_F_ext_hat_K), shape (6,) [N], [N m]; None: not a Franka arm.
        shape, time: capsules around the links, and robot time [s], for `capsules`.
    """

    q: FloatArray
    dq: FloatArray
    tau: FloatArray
    T_base_ee: FloatArray | None
    wrench_base: FloatArray | None
    shape: ArmShape
    time: float

    @cached_property
    def capsules(self) -> PlacedCapsules:
        """Capsules of the links in the world, with their velocities; placed when they are first read."""
        return self.shape.at(ArmState(self.time, self.q, self.dq))


class PersonObservation(NamedTuple):
    """State of the simulated person after the last time step of the plant.

    Attributes:
        joints: names of the joints.
        q, dq: joint positions and velocities, shape (n,) each [rad], [rad/s].
        T_world_root: pose of the root link in the world, shape (4, 4).
        T_world_hand: pose in the world of the controlled hand, at the point that tracks the reference, shape (4, 4).
        tau, strength_share: joint torques [N m], and their share of the joints' strength [1], shape (n,) each, from the
            last message of the person (rate: `human.rate`); NaN before the first message.
        activations: activation of each muscle [1], shape (m,), from the last message, 0 before the first one; None:
            joint torques drive the person.
        capsules: capsules of the body in the world.
    """

    joints: tuple[str, ...]
    q: FloatArray
    dq: FloatArray
    T_world_root: FloatArray
    T_world_hand: FloatArray
    tau: FloatArray
    strength_share: FloatArray
    activations: FloatArray | None
    capsules: Observation


class SimulationState(NamedTuple):
    """State of a simulation at one instant.

    Attributes:
        time: robot time [s].
        arm: state of the robot.
        person: state of the person; None: the experiment has no person.
        contacts: contact points of the last time step.
        nearest: nearest capsule of the arm for each of the person's m, with the distance [m] in column 0, shape (m, 8),
            see `hric_dynamics.tree.nearest`; None: no person.
    """

    time: float
    arm: ArmObservation
    person: PersonObservation | None
    contacts: tuple[Contact, ...]
    nearest: FloatArray | None

    @property
    def separation(self) -> float | None:
        """Smallest distance of arm and person [m], negative if their capsules overlap; None: no person."""
        return None if self.nearest is None else float(self.nearest[:, 0].min())


class Observer:
    """Reader of the state of a simulated robot and of the person next to it.

    Args:
        node: node of the robot's namespace.
        hw: the simulated robot.

    Attributes:
        settings: section `human` of the experiment; None: there is no person.

    Raises:
        DescriptionError: a link of the robot has no capsule, as a mesh is its only collision shape.
    """

    def __init__(self, node: Node, hw: SimulatedRobot) -> None:
        self._hw, self._state = hw, getattr(hw, "robot_state", None)
        self._shape = ArmShape(hw.description, hw.states.names)
        self.settings = HumanSettings.beside_robot(node)
        if self.settings is None:
            return
        assert isinstance(hw.plant, Articulated), "a person is refused by other plants"
        self._plant: Articulated = hw.plant
        body = self.settings.body()
        self._joints = tuple(body.joints)
        root = self.settings.root(body)
        self._body_shape, self._T_world_root = BodyShape(body, root), root.transform()
        self._T_world_root.setflags(write=False)  # all observations share it
        self._hand = HandChain(body, hand_side(body, (self.settings.control or {}).get("side", "dominant"), ""))
        count = len(self._joints)
        walked = 0 if self.settings.walk is None else 2
        self._q, self._dq = [0.0] * (count + walked), [0.0] * (count + walked)
        self._relaxed: FloatArray | None = None
        if self.settings.drive == MUSCLE:
            from hric_human.muscles.choose import find
            from hric_human.muscles.muscle_set import MuscleSet  # imported only for a body with muscles

            muscles = self.settings.muscles
            found = MuscleSet(body, find(muscles.anatomy, "human.muscles.anatomy"), muscles.strength)
            self._relaxed = np.zeros(len(found.names))
        self.restart()
        node.subscribe(f"hric/{HUMAN}/joint_torque", JointTorque, self._on_torque)
        if self.settings.drive == MUSCLE:
            node.subscribe(f"hric/{HUMAN}/activation", MuscleActivation, self._on_activation)

    def restart(self) -> None:
        """Delete torques and activations that the person published before a reset."""
        if self.settings is not None:
            self._tau = self._share = np.full(len(self._joints), np.nan)
            self._activations = self._relaxed

    def _on_torque(self, message: Any) -> None:
        self._tau, self._share = np.array(message.torque), np.array(message.strength_share)

    def _on_activation(self, message: Any) -> None:
        self._activations = np.array(message.activation)

    def observe(self) -> SimulationState:
        """Return the present state of arm, person, contacts and distance."""
        hw, state, joints = self._hw, self._state, self._hw.states
        arm = ArmObservation(
            np.array(joints.position),
            np.array(joints.velocity),
            np.array(joints.effort),
            None if state is None else np.array(state.O_T_EE).reshape(4, 4).T,
            None if state is None else np.array(state.O_F_ext_hat_K),
            self._shape,
            hw.loop.time,
        )
        contacts = tuple(hw.plant.contacts())
        person = None if self.settings is None else self._person()
        nearest = None if person is None else nearest_capsules(arm.capsules, person.capsules)
        return SimulationState(hw.loop.time, arm, person, contacts, nearest)

    def _person(self) -> PersonObservation:
        plant, count = self._plant, len(self._joints)
        plant.read_joints(HUMAN, self._q, self._dq)
        q, dq = self._q[-count:], self._dq[-count:]
        root, moved = self._T_world_root, None
        if len(self._q) > count:  # the person walks; the model's base link stays at the start
            root, _ = self._hw.plant.link_state(f"{HUMAN}::{ROOT}")
            moved = pose_of_transform(root)
        hand = self._hand.placed(q, root)
        placed = self._body_shape.placed(self._hw.loop.time, "world", q, moved)
        return PersonObservation(
            self._joints, np.array(q), np.array(dq), root, hand, self._tau, self._share, self._activations, placed
        )
