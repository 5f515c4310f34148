"""Topics of a simulated human: messages are built and sent outside the control loop, from copies of its state."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from geometry_msgs.msg import Point, PoseStamped, Vector3, Wrench
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from hric_control.plant import BushingLoad
from hric_core import realtime
from hric_core.geometry import Pose, stamped
from hric_core.node import Node
from hric_core.robot_time import stamps
from hric_human.contact import RegionContact
from hric_human.control import HumanControl, Person
from hric_human.participant.grip import Grip
from hric_msgs.msg import HumanEvent, HumanGrip, JointTorque, RegionContacts
from hric_msgs.msg import RegionContact as RegionContactMessage

WORLD = "world"
NOWHERE = (math.nan, math.nan, math.nan)
"""Position of a contact whose position is unknown."""

SILENCE = 0.05
"""Maximum time between two contact messages while nothing touches the person [s] (project default)."""


class Topics:
    """Topics of one human.

    Args:
        node: node of the robot; the topics are in the namespace `hric/NAME` next to it.
        name: name of the human, and prefix of the frames: NAME/LINK.
        person: joints of the person.
        root: pose of the root link `human_base` in the world.
        walks: True if the root moves; its pose is then published repeatedly.
    """

    def __init__(self, node: Node, name: str, person: Person, root: Pose, walks: bool = False) -> None:
        where = node.beside(f"hric/{name}")
        self._person = person
        self._states = realtime.publisher(node, f"{where}/joint_states", JointState, lossless=True)
        self._torques = realtime.publisher(node, f"{where}/joint_torque", JointTorque, lossless=True)
        self._grips = realtime.publisher(node, f"{where}/grip", HumanGrip, lossless=True)
        self._contacts = realtime.publisher(node, f"{where}/contacts", RegionContacts, lossless=True)
        self._touching, self._reported = True, -math.inf
        self._events = realtime.publisher(node, f"{where}/events", HumanEvent, lossless=True)
        self._frame = f"{name}/human_base"
        self._root: realtime.RealtimePublisher | None = None
        if walks:
            self._root = realtime.publisher(node, f"{where}/root", PoseStamped, lossless=True)
            self._tf = realtime.publisher(node, "/tf", TFMessage)
            self._placed: list[Any] = [self._root, self._tf]
        else:
            self._static = node.advertise("/tf_static", TFMessage, latch=True)
            placed = stamped.transform_stamped(stamped.header(node.now(), WORLD), self._frame, root)
            self._static.publish(TFMessage([placed]))
            self._placed = [self._static]

    def close(self) -> None:
        """Stop publishing."""
        for publisher in (self._states, self._torques, self._grips, self._contacts, self._events, *self._placed):
            publisher.unregister()

    def publish_root(self, time: float, root: Pose) -> None:
        """Publish the pose of a walking human's root link; time: time of the stamp [s]."""
        assert self._root is not None, "only a walking human publishes its root"
        self._root.publish(_root, time, root)
        self._tf.publish(_placed, time, self._frame, root)

    def publish(
        self,
        time: float,
        q: Sequence[float],
        dq: Sequence[float],
        tau: Sequence[float],
        control: HumanControl,
        grips: Sequence[Grip],
    ) -> None:
        """Publish joint states, torques and grips of a cycle.

        Args:
            time: time of the stamp [s].
            q: joint positions, n floats [rad]; the caller must not change this and the following lists later.
            dq: joint velocities, n floats [rad/s].
            tau: joint torques, n floats [N m].
            control: control of the person, for the saturated joints.
            grips: grips of the person.
        """
        if self._states.subscribers():
            self._states.publish(_joint_state, time, self._person.joints, q, dq, tau)
        if self._torques.subscribers():
            clipped = list(control.clipped.values())
            self._torques.publish(_joint_torque, time, self._person, tau, control.at_strength, clipped)
        if self._grips.subscribers():
            for grip in grips:
                self._grips.publish(_grip, time, grip.name, grip.settings.held, grip.holder, grip.closed, grip.load)

    def publish_contacts(
        self, time: float, epoch: float, present: Iterable[RegionContact], ended: Iterable[RegionContact]
    ) -> None:
        """Publish the contacts of a cycle and those that ended since the last message.

        While nothing touches the person, an empty message is sent every SILENCE seconds: it distinguishes "nothing
        touched" from "not recorded".

        Args:
            time: time of the stamp [s].
            epoch: stamp of the robot time 0 [s].
            present: contacts of this cycle, with robot times.
            ended: contacts that ended, with robot times.
        """
        touching, over = ([_contact(contact, epoch) for contact in contacts] for contacts in (present, ended))
        if touching or over or self._touching or not 0.0 <= time - self._reported < SILENCE - 1e-9:
            self._touching, self._reported = bool(touching), time
            self._contacts.publish(_contacts, time, touching, over)

    def event(self, time: float, kind: str, name: str, value: float, text: str) -> None:
        """Publish an event; time: time of the stamp [s]."""
        self._events.publish(_event, time, kind, name, value, text)


def stamped_message(kind: type, time: float, frame: str, /, **fields: Any) -> Any:
    """Return a message with a header and all other fields as given; `time`: time of the stamp [s]."""
    message = object.__new__(kind)  # the constructor takes three times as long
    message.header = stamped.header(stamps.to_time(time), frame)  # type: ignore[attr-defined]
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def _root(time: float, root: Pose) -> Any:
    return stamped.pose_stamped(stamped.header(stamps.to_time(time), WORLD), root)


def _placed(time: float, frame: str, root: Pose) -> Any:
    return TFMessage([stamped.transform_stamped(stamped.header(stamps.to_time(time), WORLD), frame, root)])


def _joint_state(
    time: float, names: Sequence[str], q: Sequence[float], dq: Sequence[float], tau: Sequence[float]
) -> Any:
    return stamped_message(JointState, time, "", name=names, position=q, velocity=dq, effort=tau)


def _joint_torque(
    time: float, person: Person, tau: Sequence[float], at_strength: list[bool], clipped: list[int]
) -> Any:
    limits = zip(tau, person.weakest, person.strongest, strict=True)
    share = [value / (high if value > 0.0 else low) for value, low, high in limits]
    fields = {"torque": tau, "strength_share": share, "at_strength": at_strength, "clipped": clipped}
    return stamped_message(JointTorque, time, "", name=person.joints, **fields)


def _grip(time: float, name: str, held: str, holder: str, closed: bool, load: BushingLoad) -> Any:
    wrench, at = Wrench(Vector3(*load.force), Vector3(*load.torque)), Point(*load.point)
    deflection = {"stretch": load.stretch, "slipped": load.slipped, "turned": load.turned}
    fields = {"name": name, "held": held, "holder": holder, "closed": closed, "wrench": wrench, "point": at}
    return stamped_message(HumanGrip, time, WORLD, **fields, **deflection)


def _event(time: float, kind: str, name: str, value: float, text: str) -> Any:
    return stamped_message(HumanEvent, time, "", kind=kind, name=name, value=value, text=text)


def _contact(contact: RegionContact, epoch: float) -> Any:
    """Copy a contact, which changes later, into a message; epoch: stamp of robot time 0 [s]."""
    message = RegionContactMessage()
    message.regions, message.dominant = list(contact.regions), bool(contact.dominant)
    message.link, message.other, message.kind = contact.link, contact.other, contact.kind
    message.begin, message.duration = epoch + contact.begin, contact.duration
    message.peak_time = math.nan if contact.peak_time is None else epoch + contact.peak_time
    for name in ("force", "peak", "impulse", "energy", "area", "begin_speed"):
        value = getattr(contact, name)
        setattr(message, name, math.nan if value is None else value)
    for name in ("point", "normal", "begin_point", "begin_normal"):
        vector = getattr(message, name)
        vector.x, vector.y, vector.z = getattr(contact, name) or NOWHERE
    return message


def _contacts(time: float, touching: list[Any], ended: list[Any]) -> Any:
    return stamped_message(RegionContacts, time, WORLD, touching=touching, ended=ended)
