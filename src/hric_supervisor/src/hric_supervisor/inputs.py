"""Subscriptions of the supervisor: joint states of the arm, and the sources of the persons' poses."""

import math
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from hric_assessment.typed_json import Content
from hric_core.errors import HricError, ParameterError
from hric_core.geometry import Pose
from hric_core.geometry.messages import pose_of
from hric_core.node import Node, Registration, publisher_of
from hric_human.participant.settings import HumanSettings
from hric_motion.tracking import BRIDGED, LOST
from hric_msgs.msg import MocapData, PersonTracking
from hric_perception.person.settings import PersonSettings
from hric_supervisor.arm import ArmState
from hric_supervisor.decision import WORLD
from hric_supervisor.person import BodyShape, Observation, hand_ball, unplaced
from hric_supervisor.settings import MARKER, PERSON, SupervisorNodeSettings

WAITING = 50
"""Maximum number of messages of a topic that wait for their counterpart or a decision (project default)."""
JOINTS, FRAMES = "joint_states", "hric/perception/mocap"
PERSON_JOINTS, PERSON_TRACKING = "hric/person/joint_states", "hric/person/tracking"
HUMAN_JOINTS, HUMAN_ROOT = "hric/human/joint_states", "hric/human/root"


class Publishers:
    """Record of the nodes that publish one body's topics, since two publishers of a topic would mix two bodies."""

    def __init__(self) -> None:
        self._names: dict[str, str] = {}
        self._fault = ""

    def note(self, topic: str, message: Any) -> None:
        """Record the publisher of a message on a topic."""
        name = publisher_of(message)
        before = self._names.setdefault(topic, name)
        if name != before:
            self._names[topic] = name
            self._fault = f"is doubled: {before} and {name} both publish {topic}"

    def take(self) -> str:
        """Return the fault found since the last call; empty: there was none."""
        fault, self._fault = self._fault, ""
        return fault


class ArmInput:
    """Subscription to the arm's joint states; two nodes that publish them are a fault.

    Args:
        node: node that subscribes.
        root: namespace of the robot, with a trailing slash.
        joints: names of the joints, in order.
    """

    def __init__(self, node: Node, root: str, joints: Sequence[str]) -> None:
        self._joints = tuple(joints)
        self._publishers = Publishers()
        self._newest: ArmState | None = None
        self.registrations: list[Registration] = [node.subscribe(f"{root}{JOINTS}", JointState, self._on_joints)]

    def _on_joints(self, message: Any) -> None:
        index = {name: at for at, name in enumerate(message.name)}
        if any(name not in index for name in self._joints):
            return  # joints of a gripper or another robot
        self._publishers.note(JOINTS, message)
        if len(index) < len(message.name):
            return  # ambiguous: a joint has two values
        rows = [index[name] for name in self._joints]
        if max(rows) >= min(len(message.position), len(message.velocity)):
            return  # a state without velocities is unusable
        q, dq = (np.array([values[at] for at in rows]) for values in (message.position, message.velocity))
        self._newest = ArmState(message.header.stamp.to_sec(), q, dq)

    def take(self) -> ArmState | None:
        """Return the newest state of the arm; None before the first."""
        newest, fault = self._newest, self._publishers.take()
        return newest if newest is None or not fault else newest._replace(fault=fault)


class PersonInput:
    """Subscriptions that observe one person; two nodes that publish one of the topics are a fault.

    Attributes:
        frame: frame in which the person is observed.
        came: callback for a new observation.
        registrations: subscriptions.
    """

    def __init__(self, frame: str) -> None:
        self.frame, self.came = frame, _nobody
        self.registrations: list[Registration] = []
        self._publishers = Publishers()
        self._newest: Observation | None = None

    def _subscribe(self, node: Node, topic: str, message_type: type, take: Callable[[Any], None]) -> None:
        def on_message(message: Any) -> None:
            self._publishers.note(topic, message)
            take(message)

        self.registrations.append(node.subscribe(topic, message_type, on_message))

    def take(self) -> Observation | None:
        """Return the newest observation, with those since the last call in `earlier`; None before the first."""
        if new := self._made():
            fault = self._publishers.take()
            self._newest = new[-1]._replace(earlier=tuple(new[:-1]), fault=new[-1].fault or fault)
        return self._newest

    def _made(self) -> list[Observation]:
        """Return the observations received since the last call."""
        raise NotImplementedError


class Pairs:
    """Pairing of messages of two topics with equal stamps; either topic may be delayed.

    Args:
        take: callback with both messages of a pair.
    """

    def __init__(self, take: Callable[[Any, Any], None]) -> None:
        self._take = take
        self._waiting: tuple[dict[int, Any], dict[int, Any]] = {}, {}
        self._lock = threading.Lock()

    def add(self, side: int, message: Any) -> None:
        """Add a message of topic 0 or 1, from any thread."""
        stamp = message.header.stamp.to_nsec()
        with self._lock:
            other = self._waiting[1 - side].pop(stamp, None)
            waiting = self._waiting[side]
            if other is None:
                waiting[stamp] = message
                for old in list(waiting)[:-WAITING]:
                    del waiting[old]
                return
        self._take(*((message, other) if side == 0 else (other, message)))


class _BodyInput(PersonInput):
    """Subscriptions to a person's joint angles and, in another message, the pose of the root link.

    Args:
        shape: capsules of the body.
        frame: frame in which the person is observed.
        capacity: maximum number of message pairs stored between two decisions; the newest are stored.
    """

    def __init__(self, shape: BodyShape, frame: str, capacity: int) -> None:
        super().__init__(frame)
        self._shape, self._joints = shape, ()
        self._pairs: deque[tuple[Any, Any]] = deque(maxlen=capacity)

    def _take(self, joints: Any, where: Any) -> None:
        """Store both messages of one instant; where: None for a fixed root."""
        self._pairs.append((joints, where))
        self.came()

    @staticmethod
    def _root(where: Any) -> Pose:
        return pose_of(where.pose)

    def _made(self) -> list[Observation]:
        return [self._observation(*self._pairs.popleft()) for _ in range(len(self._pairs))]

    def _observation(self, joints: Any, where: Any) -> Observation:
        """Return the observation of a message pair; where: message with the root's pose, None for a fixed root."""
        stamp, frame = joints.header.stamp.to_sec(), self.frame if where is None else where.header.frame_id
        before, self._joints = self._joints, tuple(joints.name)
        if before not in ((), self._joints):
            return unplaced(stamp, frame, f"has other joints: {', '.join(before)} before, {', '.join(joints.name)} now")
        try:
            angles = dict(zip(joints.name, joints.position, strict=True))
            return self._shape.seen(stamp, frame, angles, None if where is None else self._root(where))
        except (HricError, ValueError, ArithmeticError) as error:
            return unplaced(stamp, frame, f"cannot be placed: {error}")


class HumanInput(_BodyInput):
    """Subscriptions to the simulated human in the robot's plant: joint states and, if walking, the root's pose.

    Args:
        node: node that subscribes.
        root: namespace of the robot, with a trailing slash.
        person: section `human` of the experiment.
        where: name of the parameter with that section, for error messages.
    """

    def __init__(self, node: Node, root: str, person: Content | None, where: str) -> None:
        if person is None:
            valid = "the section human of the experiment, or source: marker"
            raise ParameterError(
                f"{where} is not set, but the source is the simulated human in the robot's plant; valid: {valid}"
            )
        settings = HumanSettings.of(person, where)
        body = settings.body()
        super().__init__(BodyShape(body, settings.root(body)), WORLD, 1)
        pairs = Pairs(self._take)
        if settings.walk is None:
            self._subscribe(node, f"{root}{HUMAN_JOINTS}", JointState, lambda joints: self._take(joints, None))
        else:
            self._subscribe(node, f"{root}{HUMAN_ROOT}", PoseStamped, lambda pose: pairs.add(1, pose))
            self._subscribe(node, f"{root}{HUMAN_JOINTS}", JointState, lambda joints: pairs.add(0, joints))


class MarkerInput(PersonInput):
    """Subscription to a hand that motion capture tracks as a rigid body; frames in which it is lost are ignored.

    Args:
        node: node that subscribes.
        root: namespace of the robot, with a trailing slash.
        radius: radius of the sphere around the hand [m].
        body: name of the rigid body.
        frame: frame of the arm's base, in which the data must be given.
    """

    def __init__(self, node: Node, root: str, radius: float, body: str, frame: str) -> None:
        super().__init__(frame)
        self._radius, self._body = radius, body
        self._frames: deque[Observation] = deque(maxlen=WAITING)
        self._subscribe(node, f"{root}{FRAMES}", MocapData, self._on_frame)

    def _on_frame(self, message: Any) -> None:
        tracked = [body for body in message.rigid_bodies if body.name == self._body and body.tracking_valid]
        if not tracked:
            return
        p, head = tracked[0].pose.position, message.header
        ball = hand_ball(head.stamp.to_sec(), head.frame_id, (p.x, p.y, p.z), self._radius)
        if len(tracked) > 1:
            ball = ball._replace(fault=f"is doubled: {len(tracked)} rigid bodies {self._body} in one frame")
        self._frames.append(ball)
        self.came()

    def _made(self) -> list[Observation]:
        return [self._frames.popleft() for _ in range(len(self._frames))]


class TrackedInput(_BodyInput):
    """Subscriptions to a real person tracked by the node `person`; ignored while a joint or the root is lost.

    Args:
        node: node that subscribes.
        root: namespace of the robot, with a trailing slash.
        person: section `person` of the experiment; None: its defaults.
        where: name of the parameter with that section, for error messages.
        frame: frame of the arm's base, in which the markers must be given.
        uncertainty: largest accepted residual of the tracker [m], the supervisor's `person_uncertainty`.
    """

    def __init__(
        self, node: Node, root: str, person: Content | None, where: str, frame: str, uncertainty: float
    ) -> None:
        self._uncertainty = uncertainty
        body, _ = PersonSettings.of(person or {}, where).known()
        super().__init__(BodyShape(body, Pose()), frame, WAITING)
        pairs = Pairs(self._take)
        self._subscribe(node, f"{root}{PERSON_JOINTS}", JointState, lambda joints: pairs.add(0, joints))
        self._subscribe(node, f"{root}{PERSON_TRACKING}", PersonTracking, lambda tracking: pairs.add(1, tracking))

    def _take(self, joints: Any, where: Any) -> None:
        if where.root_state != LOST and len(joints.name) == len(where.name):
            super()._take(joints, where)

    def _observation(self, joints: Any, where: Any) -> Observation:
        observation = super()._observation(joints, where)
        if where.residual <= self._uncertainty or (where.root_state == BRIDGED and math.isnan(where.residual)):
            return observation
        valid = f"up to person_uncertainty, {self._uncertainty:g} m"
        text = f"has markers {where.residual:.3f} m away from those of the body; valid: {valid}"
        return observation._replace(fault=observation.fault or text)

    @staticmethod
    def _root(where: Any) -> Pose:
        return pose_of(where.root)


def person_inputs(node: Node, root: str, settings: SupervisorNodeSettings, base: str) -> list[PersonInput]:
    """Return the subscriptions for each person of `settings.persons`.

    Args:
        node: node of the supervisor.
        root: namespace of the robot, with a trailing slash.
        settings: parameters of the supervisor.
        base: frame of the arm's base.

    Raises:
        ParameterError: the section of a person is missing or invalid.
    """
    inputs: list[PersonInput] = []
    for name, source in settings.persons:
        if source == MARKER:
            body = settings.body[0] if len(settings.persons) == 1 else name
            inputs.append(MarkerInput(node, root, settings.hand_radius, body, base))
        elif source == PERSON:
            about = settings.person, node.resolve("person"), base, settings.person_uncertainty
            inputs.append(TrackedInput(node, root, *about))
        else:
            section = settings.person if settings.human is None and PERSON not in settings.source else settings.human
            inputs.append(HumanInput(node, root, section, node.resolve("human")))
    return inputs


def _nobody() -> None:
    """Do nothing; default of `PersonInput.came`."""
