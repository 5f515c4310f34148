"""Muscles of a simulated human: the joint torques that they produce, and their topics."""

from collections.abc import Sequence
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import Point, Vector3, Wrench

from hric_control.plant import Contact
from hric_core import realtime
from hric_core.geometry import Pose, Vector
from hric_core.node import Node
from hric_human.control import Person
from hric_human.control.whole_body import ExternalLoad, WholeBody
from hric_human.muscles.choose import find
from hric_human.muscles.drive import MuscleDrive
from hric_human.muscles.joint_contact import JointContact
from hric_human.muscles.lines import Points, muscle_lines
from hric_human.muscles.muscle_set import MuscleSet, MuscleState
from hric_human.participant.grip import Grip, Happened
from hric_human.participant.settings import HumanSettings, MuscleSettings
from hric_human.participant.topics import WORLD, stamped_message
from hric_msgs.msg import JointReactions, MuscleActivation, MuscleForce


class Snapshot(NamedTuple):
    """State of one cycle, stored until the next cycle provides the acceleration for its joint reactions.

    Attributes:
        time: time of the stamp [s].
        q, dq: joint positions and velocities, n floats [rad], [rad/s].
        force: forces of muscles [N] and torques of actuators [N m], shape (k,).
        loads: loads of grips and contacts on the person.
    """

    time: float
    q: list[float]
    dq: list[float]
    force: Any
    loads: list[ExternalLoad]


def muscle_paths(settings: HumanSettings, where: str) -> dict[str, Points]:
    """Return the paths of a person's muscles by name; where: prefix of the settings' names. Raises ParameterError."""
    return muscle_lines(settings.body(), find(settings.muscles.anatomy, f"{where}anatomy"))


class HumanMuscles:
    """Muscles that produce the joint torques of one human.

    Args:
        node: node of the robot; the topics are in the namespace `hric/NAME` next to it.
        name: name of the human.
        person: joints of the person.
        root: pose of the root link in the world, at rest.
        gravity: gravity vector in axes of the world [m/s^2].
        settings: settings of the muscles.
        where: prefix of the settings' names, for error messages.
        happened: callback for each event.

    Raises:
        ParameterError: the anatomy cannot be loaded, or the rate does not fit the cycle.
    """

    def __init__(
        self,
        node: Node,
        name: str,
        person: Person,
        root: Pose,
        gravity: Vector,
        settings: MuscleSettings,
        where: str,
        happened: Happened,
    ) -> None:
        self._prefix, self._cycle, self._root, self._gravity = f"{name}::", person.cycle, root, gravity
        self._happened = happened
        anatomy = find(settings.anatomy, f"{where}anatomy")
        muscles = MuscleSet(person.body, anatomy, settings.strength)
        self._drive = drive = MuscleDrive(muscles, person.cycle, settings.rate, settings.co_contraction, where)
        self._dynamics = WholeBody(person.body)
        self._contact = JointContact(self._dynamics, anatomy, muscles.names)
        namespace = node.beside(f"hric/{name}")
        self._activation = realtime.publisher(node, f"{namespace}/activation", MuscleActivation, lossless=True)
        self._force = realtime.publisher(node, f"{namespace}/muscle_force", MuscleForce, lossless=True)
        self._reactions = realtime.publisher(node, f"{namespace}/joint_reactions", JointReactions, lossless=True)
        self._exhausted = drive.at_limit
        self._pending: Snapshot | None = None

    def close(self) -> None:
        """Stop publishing."""
        for publisher in (self._activation, self._force, self._reactions):
            publisher.unregister()

    def restart(self) -> None:
        """Reset the muscles to their state before the first cycle."""
        self._drive.restart()
        self._exhausted, self._pending = self._drive.at_limit, None

    def torque(self, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> list[float]:
        """Return the joint torque that the muscles produce, n floats [N m]; tau: desired torque, n floats [N m].

        q, dq: current joint positions [rad] and velocities [rad/s].
        """
        if self._pending is not None:
            self._reactions.publish(self._joint_reactions, self._pending, dq[:])
            self._pending = None
        produced = self._drive.update(q, dq, tau)
        if self._drive.at_limit is not self._exhausted:
            self._note_limits()
        return produced

    def publish(
        self, time: float, q: list[float], dq: list[float], grips: Sequence[Grip], contacts: Sequence[Contact]
    ) -> None:
        """Publish the activations, muscle forces and joint reactions of this cycle.

        Args:
            time: time of the stamp [s].
            q: joint positions, n floats, not changed later [rad].
            dq: joint velocities, n floats, not changed later [rad/s].
            grips: grips of the last step.
            contacts: contacts of the last step.
        """
        drive, state = self._drive, self._drive.state
        assert state is not None, "the drive has been updated in this cycle"
        if self._activation.subscribers():
            self._activation.publish(
                _muscle_activation,
                time,
                drive.muscles.names,
                drive.excitation,
                drive.activation,
                drive.at_limit,
                drive.limited,
            )
        if self._force.subscribers():
            self._force.publish(_muscle_force, time, drive.muscles, drive.force, state)
        if self._reactions.subscribers():
            loads = _held(grips, self._prefix) + _touched(contacts, self._prefix)
            self._pending = Snapshot(time, q, dq, drive.force, loads)

    def _note_limits(self) -> None:
        drive = self._drive
        for name, count, was, there in zip(
            drive.muscles.names, drive.limited, self._exhausted, drive.at_limit, strict=True
        ):
            if there and not was:
                self._happened("muscle", name, float(count), f"{name} reaches full activation ({count} times so far)")
        self._exhausted = drive.at_limit

    def _joint_reactions(self, before: Snapshot, dq: Sequence[float]) -> Any:
        """Return the message of a cycle's joint reactions; dq: velocities in the next cycle. Runs outside the loop."""
        ddq = [(after - at) / self._cycle for after, at in zip(dq, before.dq, strict=True)]
        angles, speeds, rates = (np.array([values]) for values in (before.q, before.dq, ddq))
        needed = self._dynamics.inverse_dynamics(angles, speeds, rates, self._root, before.loads, self._gravity)
        contact_forces = self._contact.over(angles, self._root, needed, before.force[None])
        links = list(self._contact.links.values())
        return stamped_message(
            JointReactions,
            before.time,
            WORLD,
            joint_names=list(contact_forces),
            link_names=links,
            positions=[Point(*needed.position[0, self._dynamics.index[link]]) for link in links],
            wrenches=[Wrench(Vector3(*force), Vector3()) for (force,) in contact_forces.values()],
        )


def _held(grips: Sequence[Grip], prefix: str) -> list[ExternalLoad]:
    """Return the loads of closed grips on the person's links, whether the person holds or is held."""
    loads = []
    for grip in grips:
        for body, sign in ((grip.holder, 1.0), (grip.settings.held, -1.0)):
            if grip.closed and body.startswith(prefix):
                force, torque, point = np.array(grip.load[:3])[:, None]
                loads.append(ExternalLoad(body.removeprefix(prefix), sign * force, sign * torque, point))
    return loads


def _touched(contacts: Sequence[Contact], prefix: str) -> list[ExternalLoad]:
    """Return the loads of elastic contacts on the person, along their normals; rigid contacts have no force."""
    loads = []
    for contact in contacts:
        for body, sign in ((contact.body_a, 1.0), (contact.body_b, -1.0)):
            if contact.kind == "penalty" and body.startswith(prefix):
                force = sign * contact.force * np.array([contact.normal])
                loads.append(
                    ExternalLoad(body.removeprefix(prefix), force, np.zeros((1, 3)), np.array([contact.position]))
                )
    return loads


def _muscle_activation(
    time: float, names: Sequence[str], excitation: Any, activation: Any, at_limit: list[bool], limited: list[int]
) -> Any:
    values = {"excitation": excitation.tolist(), "activation": activation.tolist()}
    return stamped_message(MuscleActivation, time, "", name=names, at_limit=at_limit, limited=limited, **values)


def _muscle_force(time: float, muscles: MuscleSet, force: Any, state: MuscleState) -> Any:
    values = {"name": muscles.names, "force": force, "length": state.length, "velocity": state.velocity}
    of_muscles = {key: list(compress(np.asarray(of).tolist(), muscles.is_muscle)) for key, of in values.items()}
    return stamped_message(MuscleForce, time, "", outside=state.outside, **of_muscles)
