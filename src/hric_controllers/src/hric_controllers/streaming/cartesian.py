"""Controller whose end effector follows a stream of poses at 10 to 50 Hz."""

from collections import deque
from typing import Any

from geometry_msgs.msg import PoseStamped

from franka_hw_interface.interfaces import FrankaPoseCartesianInterface
from hric_control.controller import Controller
from hric_control.robot_hw import RobotHW
from hric_control.speed_scale import SpeedScaleInterface
from hric_controllers import parameters
from hric_controllers.cartesian.workspace import check_target
from hric_controllers.streaming.follower import KEPT, StreamFollower
from hric_controllers.streaming.joint_bounds import JointBounds, Occurrences
from hric_controllers.streaming.settings import CartesianStreamingSettings
from hric_core import realtime
from hric_core.errors import CommandError
from hric_core.geometry import Pose, quaternions, stamped
from hric_core.node import Node


class CartesianStreamingController(Controller):
    """Controller that moves the end effector smoothly behind poses of any rate, by the arm's own pose motion.

    INTERFACE.md lists its parameters and topics; `streaming.follower` has the motion of the end effector, and
    `streaming.joint_bounds` slows it down such that the joints stay within their limits.
    """

    settings = (parameters.ArmSettings, CartesianStreamingSettings)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get the hardware interfaces, and then advertise the topics.

        An error in a parameter or interface thus leaves no topic behind.
        """
        node = self._node = controller_node
        arm_id = parameters.ArmSettings.read(node).arm_id
        self._settings = settings = CartesianStreamingSettings.read(node)
        self._base = f"{arm_id}_link0"
        interface = robot_hw.get(FrankaPoseCartesianInterface)
        self._arm = interface.handle(f"{arm_id}_robot")
        self._scale = robot_hw.get(SpeedScaleInterface).handle()
        self._follower = StreamFollower(settings.limits, settings.ranges)
        self._bounds = JointBounds.of_arm(root_node, arm_id, interface.of(arm_id))
        self._slow = Occurrences()
        self._targets: deque[tuple[list[float], float | None]] = deque(maxlen=KEPT)
        self._start, self._running = Pose(), False
        self._state_time = realtime.Throttle(settings.state_publish_rate)
        self._desired = realtime.publisher(node, "desired_pose", PoseStamped)
        node.subscribe("command", PoseStamped, self._on_command, queue_size=KEPT)

    def _on_command(self, message: Any) -> None:
        """Check a pose and pass it to the loop.

        Raises:
            CommandError: the pose is refused; the node logs the error's text with the topic's name.
        """
        if not self._running:
            raise CommandError("the controller is not running, the target is ignored; start it first")
        settings = self._settings
        position, rotation = check_target(message, self._base, self._start, settings.workspace, settings.largest_turn)
        self._targets.append(([*position, *rotation], message.header.stamp.to_sec() or None))

    def starting(self, time: float) -> None:
        """Hold the last commanded pose until the first target comes."""
        self._targets.clear()
        self._start = Pose.of_column_major(self._arm.robot_state.O_T_EE_c)
        self._follower.start([*self._start.position, 0.0, 0.0, 0.0])
        state = self._arm.robot_state
        T = state.O_T_EE_c
        self._columns = [(T[k], T[k + 1], T[k + 2]) for k in (0, 4, 8)]
        self._bounds.start(state)
        self._state_time.restart()
        self._running = True

    def update(self, time: float, period: float) -> None:
        """Take the new targets, advance the motion by one cycle and command its pose."""
        while self._targets:
            self._follower.take(time, *self._targets.popleft())
        self._follower.advance(time, period, self._scale.value)
        x, y, z, a, b, c = self._follower.position
        rotation = quaternions.from_rotation_vector((a, b, c))
        columns = [quaternions.rotated(rotation, column) for column in self._columns]
        T = [*columns[0], 0.0, *columns[1], 0.0, *columns[2], 0.0, x, y, z, 1.0]
        T = self._bounded(time, period, T)
        self._arm.set_command(T)
        if self._state_time.due(time):
            header = stamped.header(self._node.now(), self._base)
            self._desired.publish(stamped.pose_stamped, header, Pose.of_column_major(T))

    def _bounded(self, time: float, period: float, T: list[float]) -> list[float]:
        """Return the pose that the joints allow; the motion goes on from it. A reason to be slow is logged once."""
        allowed = self._bounds.advance(T, self._arm.robot_state, period)
        step = self._scale.value * period
        if allowed is not T and step > 0.0:
            pose = Pose.of_column_major(allowed)
            rotation = quaternions.difference(pose.orientation, self._start.orientation)
            self._follower.correct([*pose.position, *rotation], step)
        reason = self._bounds.reason
        if self._slow.is_new(time, reason):
            text = f"the end effector slows down, since {reason}; keep the targets away from there"
            realtime.defer(self._node, lambda: self._node.log_warn(text), "log")
        return allowed

    def stopping(self, time: float) -> None:
        """Stop accepting targets."""
        self._running = False
