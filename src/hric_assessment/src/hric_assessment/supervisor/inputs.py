"""What the supervisor subscribes to: the arm's joints, and who sees the person."""

import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from hric_assessment.supervisor.arm import ArmState
from hric_assessment.supervisor.decision import WORLD
from hric_assessment.supervisor.person import BodyShape, Observation, hand_ball
from hric_assessment.supervisor.settings import MARKER, PERSON, SupervisorSettings
from hric_control.errors import ParameterError
from hric_control.geometry import Pose
from hric_control.geometry.messages import pose_of
from hric_control.node import Node, Registration
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings
from hric_human.tracking import LOST
from hric_msgs.msg import MocapData, PersonTracking
from hric_perception.person.settings import PersonSettings

WAITING = 50
"""Messages of a topic that wait for those of another one, at most; chosen here."""
JOINTS, FRAMES = "joint_states", "hric/perception/mocap"
PERSON_JOINTS, PERSON_TRACKING = "hric/person/joint_states", "hric/person/tracking"
HUMAN_JOINTS, HUMAN_ROOT = "hric/human/joint_states", "hric/human/root"


class ArmInput:
    """The newest state of the arm.

    Args:
        node: any.
        root: namespace of the robot, with a slash at its end.
        joints: names, in order.
    """

    def __init__(self, node: Node, root: str, joints: Sequence[str]) -> None:
        self._joints = tuple(joints)
        self.newest: ArmState | None = None
        self.registrations: list[Registration] = [node.subscribe(f"{root}{JOINTS}", JointState, self._on_joints)]

    def _on_joints(self, message: Any) -> None:
        index = {name: at for at, name in enumerate(message.name)}
        if any(name not in index for name in self._joints):
            return  # of a gripper, or another robot
        rows = [index[name] for name in self._joints]
        q, dq = (np.array([values[at] for at in rows]) for values in (message.position, message.velocity))
        self.newest = ArmState(message.header.stamp.to_sec(), q, dq)


class PersonInput(Protocol):
    """The newest pose of the person.

    Attributes:
        frame: in which he is seen.
        newest: None before the first.
        came: called when there is a newer one.
    """

    frame: str
    came: Callable[[], None]
    registrations: list[Registration]

    @property
    def newest(self) -> Observation | None:
        """See the attributes."""


class Pairs:
    """Messages of two topics that belong together, by their stamps: one topic may be behind the other.

    Args:
        take: called with both.
    """

    def __init__(self, take: Callable[[Any, Any], None]) -> None:
        self._take = take
        self._waiting: tuple[dict[int, Any], dict[int, Any]] = {}, {}
        self._lock = threading.Lock()

    def add(self, side: int, message: Any) -> None:
        """One of topic 0 or 1, from any thread."""
        stamp = message.header.stamp.to_nsec()
        with self._lock:
            other = self._waiting[1 - side].pop(stamp, None)
            own = self._waiting[side]
            if other is None:
                own[stamp] = message
                for old in list(own)[:-WAITING]:
                    del own[old]
                return
        self._take(*((message, other) if side == 0 else (other, message)))


class _BodyInput:
    """By the angles of joints, and the message that says where the root is.

    Args:
        shape: of the body.
        frame: in which he is seen.
    """

    def __init__(self, shape: BodyShape, frame: str) -> None:
        self._shape, self.frame, self.came = shape, frame, _nobody
        self._pair: tuple[Any, Any] | None = None
        self._made: tuple[Any, Observation] | None = None
        self.registrations: list[Registration] = []

    def _take(self, joints: Any, where: Any) -> None:
        """Both of one instant; where: None of who stays."""
        self._pair = joints, where
        self.came()

    @staticmethod
    def _root(where: Any) -> Pose:
        return pose_of(where.pose)

    @property
    def newest(self) -> Observation | None:
        """Made on access: more messages come than decisions are."""
        pair, made = self._pair, self._made
        if pair is None:
            return None
        if made is None or made[0] is not pair:
            joints, where = pair
            angles, stamp = dict(zip(joints.name, joints.position, strict=True)), joints.header.stamp.to_sec()
            frame, root = (self.frame, None) if where is None else (where.header.frame_id, self._root(where))
            made = self._made = pair, self._shape.seen(stamp, frame, angles, root)
        return made[1]


class HumanInput(_BodyInput):
    """The human in the robot's plant, by his joint states and, where he walks, his root.

    Args:
        node: any.
        root: namespace of the robot, with a slash at its end.
        person: the section `human` of the experiment.
        where: name of that parameter.
    """

    def __init__(self, node: Node, root: str, person: Mapping[str, Any] | None, where: str) -> None:
        if person is None:
            valid = "the section human of the experiment, or source: marker"
            raise ParameterError(
                f"{where} is not set, and the source is the human in the robot's plant; valid: {valid}"
            )
        settings = HumanSettings.of(person, where)
        body = describe(settings.person)
        super().__init__(BodyShape(body, settings.root(body)), WORLD)
        pairs = Pairs(self._take)
        if settings.walk is None:
            self.registrations = [
                node.subscribe(f"{root}{HUMAN_JOINTS}", JointState, lambda one: self._take(one, None))
            ]
        else:
            self.registrations = [
                node.subscribe(f"{root}{HUMAN_ROOT}", PoseStamped, lambda one: pairs.add(1, one)),
                node.subscribe(f"{root}{HUMAN_JOINTS}", JointState, lambda one: pairs.add(0, one)),
            ]


class MarkerInput:
    """A hand by its rigid body in the frames of motion capture. A frame in which it is not tracked says nothing of it.

    Args:
        node: any.
        root: namespace of the robot, with a slash at its end.
        settings: of the supervisor.
        frame: of the arm's base, in which the frames must be.
    """

    def __init__(self, node: Node, root: str, settings: SupervisorSettings, frame: str) -> None:
        self._settings, self.frame, self.came = settings, frame, _nobody
        self._newest: Observation | None = None
        self.registrations: list[Registration] = [node.subscribe(f"{root}{FRAMES}", MocapData, self._on_frame)]

    def _on_frame(self, message: Any) -> None:
        for body in message.rigid_bodies:
            if body.name == self._settings.body and body.tracking_valid:
                p, head = body.pose.position, message.header
                ball = self._settings.hand_radius
                self._newest = hand_ball(head.stamp.to_sec(), head.frame_id, (p.x, p.y, p.z), ball)
                self.came()

    @property
    def newest(self) -> Observation | None:
        """See the protocol."""
        return self._newest


class TrackedInput(_BodyInput):
    """A real person by the joints that the node `person` estimates. While a joint or his root is lost nothing is known
    of him.

    Args:
        node: any.
        root: namespace of the robot, with a slash at its end.
        person: the section `person` of the experiment; None: its defaults.
        where: name of that parameter.
        frame: of the arm's base, in which his markers must be.
    """

    def __init__(self, node: Node, root: str, person: Mapping[str, Any] | None, where: str, frame: str) -> None:
        body, _ = PersonSettings.of(person or {}, where).known()
        super().__init__(BodyShape(body, Pose()), frame)
        pairs = Pairs(self._take)
        self.registrations = [
            node.subscribe(f"{root}{PERSON_JOINTS}", JointState, lambda one: pairs.add(0, one)),
            node.subscribe(f"{root}{PERSON_TRACKING}", PersonTracking, lambda one: pairs.add(1, one)),
        ]

    def _take(self, joints: Any, where: Any) -> None:
        if where.root_state != LOST and len(joints.name) == len(where.name):
            super()._take(joints, where)

    @staticmethod
    def _root(where: Any) -> Pose:
        return pose_of(where.root)


def person_input(
    node: Node, root: str, settings: SupervisorSettings, person: Mapping[str, Any] | None, where: str, base: str
) -> PersonInput:
    """By the settings; the arguments are those of the classes, base: the frame of the arm's base."""
    if settings.source == MARKER:
        return MarkerInput(node, root, settings, base)
    if settings.source == PERSON:
        return TrackedInput(node, root, person, where, base)
    return HumanInput(node, root, person, where)


def _nobody() -> None:
    """Nobody wants to know."""
