"""Controller whose joints follow a stream of targets at 10 to 50 Hz, from teleoperation, servoing or a policy."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from control_msgs.msg import JointTrajectoryControllerState
from hric_control.controller import Controller, SettingsClasses
from hric_control.hardware_interface import PositionJointInterface
from hric_control.limits import load_limits
from hric_control.robot_hw import RobotHW
from hric_control.speed_scale import SpeedScaleInterface
from hric_controllers import parameters
from hric_controllers.state.messages import Point, build_state
from hric_controllers.streaming.follower import KEPT, StreamFollower, StreamLimits
from hric_controllers.trajectory.message import read_waypoints
from hric_core import realtime
from hric_core.errors import CommandError
from hric_core.node import Node
from hric_core.parameters import Settings, names, number, per_joint, refused, text


@dataclass(frozen=True)
class JointStreamingSettings(Settings):
    """Parameters of the joint streaming controller."""

    joints: tuple[str, ...] = names()
    velocity: tuple[float, ...] = per_joint(
        number(above=0.0, unit="rad/s"), 1.5, text="largest velocity; at most that of the robot description"
    )
    acceleration: tuple[float, ...] = per_joint(
        number(above=0.0, unit="rad/s^2"), 7.0, text="below that of the arm, whose own rate limits make jerks"
    )
    jerk: tuple[float, ...] = per_joint(number(above=0.0, unit="rad/s^3"), 500.0)
    state_publish_rate: float = parameters.state_rate(100.0)


class StreamedJoints(Controller):
    """Base class of controllers that move the joints smoothly behind targets of any rate, by position commands.

    A subclass appends the targets to `_targets`; `streaming.follower` has the motion.
    """

    settings: SettingsClasses = (JointStreamingSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get the hardware interfaces, and then advertise the topics.

        An error in a parameter or interface thus leaves no topic behind.
        """
        node = self._node = controller_node
        settings = JointStreamingSettings.read(node)
        self.joints = list(settings.joints)
        self._group = robot_hw.get(PositionJointInterface).group(self.joints)
        self._scale = robot_hw.get(SpeedScaleInterface).handle()
        self._ranges = parameters.position_ranges(root_node, self.joints)
        self._check_velocity(settings, root_node)
        limits = StreamLimits(settings.velocity, settings.acceleration, settings.jerk)
        self._follower = StreamFollower(limits, self._ranges)
        # Filled by the subscriptions, emptied by the loop.
        self._targets: deque[tuple[list[float], float | None]] = deque(maxlen=KEPT)
        self._state_time = realtime.Throttle(settings.state_publish_rate)
        self._running = False
        self._state = realtime.publisher(node, "state", JointTrajectoryControllerState)

    def _check_velocity(self, settings: JointStreamingSettings, root_node: Node) -> None:
        """Raise an error if a velocity limit is above that of the robot description."""
        urdf_xml = root_node.search_param("robot_description", "")
        if not urdf_xml:
            return
        limits = load_limits(urdf_xml, root_node, self.joints, use=("velocity",))
        for joint, value, limit in zip(self.joints, settings.velocity, limits, strict=True):
            if value > limit.velocity:
                raise refused(self._node.resolve("velocity"), value, f"up to {limit.velocity:g} rad/s for {joint}")

    def starting(self, time: float) -> None:
        """Hold the last commanded position until the first target comes."""
        self._targets.clear()
        self._follower.start(self._group.commands())
        self._state_time.restart()
        self._running = True

    def update(self, time: float, period: float) -> None:
        """Take the new targets, advance the motion by one cycle and command its position."""
        follower, scale = self._follower, self._scale.value
        while self._targets:
            follower.take(time, *self._targets.popleft())
        follower.advance(time, period, scale)
        self._group.set_command(follower.position)
        if self._state_time.due(time):
            group = self._group
            desired: Point = follower.position, [scale * v for v in follower.velocity], [], []
            actual: Point = group.positions(), group.velocities(), [], group.efforts()
            self._state.publish(
                build_state, JointTrajectoryControllerState, self._node.now(), self.joints, desired, actual
            )

    def stopping(self, time: float) -> None:
        """Stop accepting targets."""
        self._running = False


@dataclass(frozen=True)
class LeaderSettings(Settings):
    """Parameter of a joint streaming controller that follows another arm."""

    leader: str = text(
        "",
        text="topic with the joint states of another arm, whose positions are then the targets, such as "
        "`left/joint_states`; relative to the namespace above that of the own arm. Joints correspond by the part of "
        "their names after the last `_`. Empty: none",
    )


class JointStreamingController(StreamedJoints):
    """Controller that follows the targets of its topics. INTERFACE.md lists its parameters and topics."""

    settings = (JointStreamingSettings, LeaderSettings)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get the hardware interfaces, and subscribe to the topics."""
        super().init(robot_hw, root_node, controller_node)
        self._ends, self._led = [joint.rpartition("_")[2] for joint in self.joints], False
        if leader := LeaderSettings.read(controller_node).leader:
            controller_node.subscribe(root_node.beside(leader), JointState, self._on_leader, queue_size=KEPT)
        controller_node.subscribe("command", Float64MultiArray, self._on_command, queue_size=KEPT)
        controller_node.subscribe("trajectory", JointTrajectory, self._on_trajectory, queue_size=KEPT)

    def _on_command(self, message: Any) -> None:
        """Pass a target without a stamp to the loop. Raises CommandError if it is refused."""
        self._take(message.data, None)

    def _on_trajectory(self, message: Any) -> None:
        """Pass the last point of a trajectory, with the stamp of its header, to the loop.

        Raises:
            CommandError: the target is refused; the node logs the error's text with the topic's name.
        """
        if not message.points:
            raise CommandError("a trajectory without points; valid: one point or more, of which the last counts")
        waypoints = read_waypoints(message, self.joints, allow_partial=False)
        stamp = message.header.stamp.to_sec() + message.points[-1].time_from_start.to_sec()
        self._take([one[-1].position for one in waypoints if one], stamp if message.header.stamp.to_sec() else None)

    def _on_leader(self, message: Any) -> None:
        """Pass the positions of another arm, with the stamp of their header, to the loop, while it runs.

        After the first message with an arm, messages without one are ignored: a hand may use the same topic.

        Raises:
            CommandError: the message has no arm, or several, or a position is outside the range of this arm.
        """
        if not self._running:
            return
        positions, ends = dict(zip(message.name, message.position, strict=False)), self._ends
        starts = [name.removesuffix(ends[0]) for name in positions if name.endswith(ends[0])]
        arms = [start for start in starts if all(start + end in positions for end in ends)]
        if not arms and self._led:
            return
        if len(arms) != 1:
            raise CommandError(
                f"joint states with the joints {', '.join(positions) or 'none'}; valid: those of one arm, with names "
                f"that end in {', '.join(ends)}"
            )
        self._led = True
        self._take([positions[arms[0] + end] for end in ends], message.header.stamp.to_sec())

    def _take(self, values: Sequence[float], stamp: float | None) -> None:
        if not self._running:
            raise CommandError("the controller is not running, the target is ignored; start it first")
        try:
            self._targets.append((parameters.check_setpoint(values, self.joints, self._ranges), stamp))
        except CommandError as error:
            raise CommandError(f"target refused, the stream continues without it: {error}") from None
