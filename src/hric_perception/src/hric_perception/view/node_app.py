"""Node `live_view`: decimated topics and limits for viewers."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import rospy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from visualization_msgs.msg import MarkerArray

from franka_msgs.msg import FrankaState
from hric_control.limits import JointLimits, load_limits
from hric_core.errors import HricError
from hric_core.parameters import Settings, listing, number, text
from hric_core.ros import RosNode
from hric_core.ros.process import NodeApp
from hric_core.urdf import read
from hric_human.participant.settings import HUMAN, HumanSettings
from hric_msgs.msg import HumanGrip, MuscleActivation, RegionContacts, SampleChunk
from hric_perception.plate.geometry import PLATE_ID
from hric_perception.view import limit_markers
from hric_perception.view.decimation import Keeper, MeanChunk, Newest, NewestJoints, ReactionWrench
from hric_perception.view.human_markers import HumanMarkers
from hric_perception.view.muscle_markers import MuscleMarkers
from hric_perception.view.skin_marker import SkinMarker, Triangles

RINGS_PERIOD = 2.0
"""Period at which the rings of joint ranges are sent again, for an rviz that starts later [s].

Project default, unconfirmed.
"""
FOLLOWERS = ("cartesian_pose_controller", "cartesian_pose_impedance_controller")
"""Names of the controllers that have a workspace limit."""
RUNNING_TIMEOUT = 1.0
"""Largest age of a state message by which its controller counts as running [s of wall time].

Project default, unconfirmed.
"""


@dataclass(frozen=True)
class ViewSettings(Settings):
    """Parameters of the node `live_view`."""

    rate: float = number(
        30.0,
        minimum=1.0,
        maximum=200.0,
        unit="Hz",
        text="rate of the topics in wall time; nothing is published without a new message",
    )
    limits_rate: float = number(
        10.0, minimum=0.0, maximum=100.0, unit="Hz", text="rate of the markers of limits; 0: none"
    )
    skin_rate: float = number(
        12.0,
        minimum=0.0,
        maximum=60.0,
        unit="Hz",
        text="rate of the skin of a simulated human, in wall time, while there is a subscriber; 0: none",
    )
    plates: tuple[str, ...] = listing(
        PLATE_ID, default=("1",), single=True, text="force plates whose wrench is published"
    )
    robot_description: str = text(
        "robot_description", empty=False, text="parameter with the URDF, in the node's namespace"
    )


class LiveView(NodeApp):
    """Node `live_view`: publishes decimated topics and markers for viewers, from construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or the robot description cannot be read.
    """

    def __init__(self, node: RosNode) -> None:
        settings = ViewSettings.read(node)
        rate, limits_rate = settings.rate, settings.limits_rate
        self._root = RosNode()
        self._relays: list[tuple[Keeper | HumanMarkers | MuscleMarkers, Any]] = []
        description = str(self._root.param(settings.robot_description))
        turning = [
            joint.name for joint in read(description).joints.values() if joint.type in ("revolute", "continuous")
        ]
        self._relay("joint_states", "joints", JointState, NewestJoints(turning))
        self._relay("franka_state_controller/F_ext", "arm_wrench", WrenchStamped, ReactionWrench())
        self._relay("hric/perception/emg/envelope", "emg", SampleChunk, MeanChunk(rate))
        for plate in settings.plates:
            self._relay(
                f"hric/perception/force_plate/{plate}/wrench", f"force_plate/{plate}/wrench", WrenchStamped, Newest()
            )
        self._mark_human()
        self._limits = _Limits(self._root, description, turning) if limits_rate else None
        self._stop = threading.Event()
        loops = [(rate, self._send)] + ([(limits_rate, self._limits.send)] if self._limits is not None else [])
        if settings.skin_rate and (human := HumanSettings.beside_robot(self._root)) is not None:
            loops.append((settings.skin_rate, _Skin(self._root, human).send))
        self._threads = [threading.Thread(target=self._run, args=loop, daemon=True) for loop in loops]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop the threads."""
        self._stop.set()
        for thread in self._threads:
            thread.join(1.0)

    def _relay(self, source: str, target: str, kind: type, keeper: Keeper) -> None:
        self._relays.append((keeper, self._root.advertise(f"hric/view/{target}", kind)))
        self._root.subscribe(source, kind, keeper.push, queue_size=100)

    def _mark_human(self) -> None:
        """Subscribe to the data of markers on the simulated human next to the robot, if there is one."""
        if not self._root.has_param(f"hric/{HUMAN}/robot_description"):
            return
        markers, publisher = HumanMarkers(), self._root.advertise(f"hric/view/{HUMAN}", MarkerArray)
        self._relays.append((markers, publisher))
        self._root.subscribe(f"hric/{HUMAN}/grip", HumanGrip, markers.push_grip, queue_size=100)
        self._root.subscribe(f"hric/{HUMAN}/contacts", RegionContacts, markers.push_contacts, queue_size=100)
        if lines := self._root.param(f"hric/{HUMAN}/muscle_lines", {}):
            muscles = MuscleMarkers(str(self._root.param(f"hric/{HUMAN}/robot_description")), lines, HUMAN)
            self._relays.append((muscles, publisher))
            self._root.subscribe(f"hric/{HUMAN}/joint_states", JointState, muscles.push_joints, queue_size=1)
            self._root.subscribe(f"hric/{HUMAN}/activation", MuscleActivation, muscles.push_activation, queue_size=1)

    def _run(self, rate: float, work: Callable[[], None]) -> None:
        while not self._stop.wait(1.0 / rate):
            try:
                work()
            except HricError as error:
                rospy.logwarn_throttle(10.0, str(error))

    def _send(self) -> None:
        for keeper, publisher in self._relays:
            if (message := keeper.take()) is not None:
                publisher.publish(message)


class _Skin:
    """Publisher of the skin of the simulated human next to the robot."""

    def __init__(self, root: RosNode, human: HumanSettings) -> None:
        body = human.body()
        self._marker = SkinMarker(body, human.gripping(body), HUMAN)
        self._publisher = root.advertise(f"hric/view/{HUMAN}/skin", Triangles)
        root.subscribe(f"hric/{HUMAN}/joint_states", JointState, self._marker.push, queue_size=1)

    def send(self) -> None:
        """Publish the skin if its topic has a subscriber."""
        if self._publisher.subscribers() and (marker := self._marker.take()) is not None:
            self._publisher.publish(marker)


class _Limits:
    """Publisher of markers that show how near the arm is to its limits."""

    def __init__(self, root: RosNode, description: str, names: list[str]) -> None:
        limits: dict[str, JointLimits] = {joint.name: joint for joint in load_limits(description, root, names)}
        self._rings = limit_markers.rings(description, limits)
        self._base = read(description).root
        self._joints, self._state = NewestJoints(names), Newest()
        self._publisher = root.advertise("hric/view/limits", MarkerArray)
        self._rings_sent = -math.inf
        self._boxes: dict[str, tuple[list[float], list[float], str]] = {}
        self._received: dict[str, float] = {}
        self._root = root
        root.subscribe("joint_states", JointState, self._joints.push)
        root.subscribe("franka_state_controller/franka_states", FrankaState, self._state.push)
        for name in FOLLOWERS:
            # The content does not matter, only that the controller publishes.
            rospy.Subscriber(
                root.resolve(f"{name}/state"), rospy.AnyMsg, self._on_follower, callback_args=name, queue_size=1
            )

    def send(self) -> None:
        """Publish the markers: joint ranges, joint positions, and limits that are near."""
        markers: list[Any] = []
        now = time.monotonic()
        if now - self._rings_sent > RINGS_PERIOD:
            self._rings_sent = now
            markers += [
                limit_markers.ring(joint_ring, number) for number, joint_ring in enumerate(self._rings.values())
            ]
        markers += self._hands(self._joints.take()) + self._walls(self._state.take(), now)
        if markers:
            self._publisher.publish(MarkerArray(markers))

    def _hands(self, message: Any) -> list[Any]:
        if message is None:
            return []
        states = dict(
            zip(message.name, zip(message.position, message.velocity, message.effort, strict=True), strict=True)
        )
        return [
            marker
            for index, (name, ring) in enumerate(self._rings.items())
            if name in states
            for marker in limit_markers.hand(
                ring, index, states[name][0], limit_markers.of_joint(ring.limits, *states[name])
            )
        ]

    def _walls(self, state: Any, now: float) -> list[Any]:
        if state is None:
            return []
        running = [name for name, received in self._received.copy().items() if now - received < RUNNING_TIMEOUT]
        boxes = [self._boxes[name] for name in running if name in self._boxes]
        return [
            limit_markers.wall(wall, lower, upper, frame)
            for lower, upper, frame in boxes
            for wall in limit_markers.walls(lower, upper, state.O_T_EE[12:15])
        ]

    def _on_follower(self, _: Any, name: str) -> None:
        if name not in self._received:
            lower, upper = (self._root.param(f"{name}/workspace/{end}", None) for end in ("lower", "upper"))
            arm = self._root.param(f"{name}/arm_id", "")
            if lower and upper:
                self._boxes[name] = (
                    list(map(float, lower)),
                    list(map(float, upper)),
                    f"{arm}_link0" if arm else self._base,
                )
        self._received[name] = time.monotonic()
