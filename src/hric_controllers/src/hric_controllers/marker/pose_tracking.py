"""Desired pose of the end effector in each cycle, from markers or commanded poses; shared by two controllers."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped

from hric_control.speed_scale import SpeedScale
from hric_controllers.cartesian.workspace import check_target
from hric_controllers.marker.follower import FollowerState, MarkerFollower, PoseOffset
from hric_controllers.marker.jitter_buffer import MAX_WAITING, JitterBuffer
from hric_controllers.marker.motion import LineMotion, MotionLimits, OnlineTrajectoryGenerator
from hric_controllers.marker.parameters import TrackingSettings
from hric_controllers.marker.sample import MarkerSample, subscribe_markers
from hric_core import realtime
from hric_core.errors import CommandError, HricError
from hric_core.geometry import Pose, quaternions, stamped
from hric_core.node import Node
from hric_msgs.msg import MarkerTrackingState


class PoseTracking:
    """Motion of the desired pose of the end effector to markers and commanded poses, within limits.

    The constructor reads the parameters; topics are opened by `open` only.

    Args:
        node: namespace of the controller.
        base: name of the robot's base frame.
        scale: speed scale; slows the motion to the targets down, not the targets themselves.
        beside: function that resolves a topic in the robot's namespace, or in the common one of several arms.

    Attributes:
        pose: desired pose of the end effector in this cycle, in the base frame.
        twist: velocity of the desired pose, 6 floats [m/s], [rad/s].
    """

    def __init__(self, node: Node, base: str, scale: SpeedScale, beside: Callable[[str], str]) -> None:
        self._node, self._base, self._scale, self._beside = node, base, scale, beside
        self._settings = TrackingSettings.read(node)
        self._follower = MarkerFollower(self._settings.follower, self._log)
        self._translation = self._motion(self._settings.translation)
        self._rotation = self._motion(self._settings.rotation)
        self._jitter_buffer = JitterBuffer(0.0 if self._settings.thesis else self._settings.playout_margin)
        # Filled by the subscription, emptied by the loop.
        self._markers: deque[MarkerSample] = deque(maxlen=MAX_WAITING)
        self._commands: realtime.LatestValue[PoseOffset | None] = realtime.LatestValue(None)
        self._state_time = realtime.Throttle(self._settings.state_publish_rate)
        self._running, self._ignored = False, 0
        self._pending: PoseOffset | None = None
        self._start = self.pose = Pose()
        self._columns: list[quaternions.Vector] = []
        self.twist = [0.0] * 6

    def _motion(self, limits: MotionLimits) -> OnlineTrajectoryGenerator | LineMotion:
        if self._settings.thesis:
            return LineMotion(limits.velocity, limits.acceleration)
        return OnlineTrajectoryGenerator(limits.each_of(3), self._settings.smoothing_time)

    def open(self) -> None:
        """Subscribe to markers and commanded poses, and advertise the topic `state`."""
        settings, node = self._settings, self._node
        self._state = realtime.publisher(node, "state", MarkerTrackingState)
        topic = self._beside(settings.topic) if settings.topic else ""
        subscribe_markers(node, settings.source, topic, settings.body, self._base, self._markers.append)
        node.subscribe("command", PoseStamped, self._on_command, queue_size=1)

    def _log(self, warn: bool, line: str) -> None:
        """Log a text as a warning (`warn`) or information; it is written outside the loop."""
        realtime.defer(self._node, lambda: (self._node.log_warn if warn else self._node.log_info)(line), "log")

    def _on_command(self, message: Any) -> None:
        """Check a commanded pose and pass it to the loop.

        Raises:
            CommandError: the pose is refused; the node logs the error's text with the topic's name.
        """
        if not self._running:
            raise CommandError("the controller is not running, the pose is ignored; start it first")
        settings = self._settings
        # The pose may be far away: the motion to it stays within its limits.
        self._commands.set(
            PoseOffset(*check_target(message, self._base, self._start, settings.workspace, settings.largest_turn))
        )

    def start(self, O_T_EE: Sequence[float]) -> None:
        """Put the desired pose at rest and wait for a marker or command.

        Args:
            O_T_EE: pose of the end effector in the base frame, 16 column-major floats.

        Raises:
            HricError: the pose is outside of the workspace; the first target would move the end effector into it,
                without a motion of the marker.
        """
        start, box = Pose.of_column_major(O_T_EE), self._settings.workspace
        if not box.contains(start.position):
            raise HricError(
                f"the end effector is at {_text(start.position)}, outside of the workspace ({box}); move it in, or "
                "widen the workspace"
            )
        self._start = self.pose = start
        self._columns = [(O_T_EE[k], O_T_EE[k + 1], O_T_EE[k + 2]) for k in (0, 4, 8)]
        self._translation.start(start.position)
        self._rotation.start((0.0, 0.0, 0.0))
        self._follower.start()
        self._jitter_buffer.clear()
        self._markers.clear()
        self._commands.take_new()
        self._pending, self._ignored, self.twist = None, 0, [0.0] * 6
        self._state_time.restart()
        self._running = True

    def stop(self) -> None:
        """Stop accepting commanded poses."""
        self._running = False

    def update(self, time: float, period: float) -> None:
        """Process new commands and markers, and advance the pose by one period.

        Args:
            time: robot time [s].
            period: time since the last cycle [s].
        """
        self._take_command()
        while self._markers:
            self._take_marker(self._markers.popleft(), time)
        if self._follower.tracking is FollowerState.FOLLOWING:
            target = self._jitter_buffer.due(time)
            if target is not None and not self._head_for(target):
                self._ignored += 1
        if self._follower.lost(time):
            self._jitter_buffer.clear()
            self._translation.stop()
            self._rotation.stop()
        self._advance(period)

    def _take_marker(self, marker: MarkerSample, time: float) -> None:
        again = self._follower.tracking is not FollowerState.FOLLOWING
        target = self._follower.take(marker, time, self._here())
        if target is not None:
            if again:
                self._jitter_buffer.clear()
            self._jitter_buffer.add(time, marker.stamp, target)

    def _take_command(self) -> None:
        requested = self._commands.take_new()
        if requested is not None:
            self._pending = requested
            self._follower.command()
            self._jitter_buffer.clear()
        if self._pending is not None:
            if self._head_for(self._pending):
                self._pending = None
        elif self._follower.tracking is FollowerState.COMMANDED and not self._moving:
            self._follower.arrived()

    @property
    def _moving(self) -> bool:
        return self._translation.moving or self._rotation.moving

    def _here(self) -> PoseOffset:
        return PoseOffset(_vector(self._translation.rest), _vector(self._rotation.rest))

    def _head_for(self, target: PoseOffset) -> bool:
        """Begin the translation and rotation to the target and return True.

        The mode `thesis` accepts a target only while both are at rest; otherwise return False.
        """
        if self._settings.thesis and self._moving:
            return False
        for motion, goal in ((self._translation, target.position), (self._rotation, target.rotation)):
            if motion.moving or list(goal) != motion.position:
                motion.go(goal)
        return True

    def _advance(self, period: float) -> None:
        scale = self._scale.value
        self._translation.advance(period, scale)
        self._rotation.advance(period, scale)
        x, y, z = self._translation.position
        a, b, c = self._rotation.velocity
        angular = (a, b, c)
        if any(self._rotation.position):
            rotation = _vector(self._rotation.position)
            self.pose = Pose((x, y, z), self._rotated(rotation))
            angular = quaternions.angular_velocity(rotation, angular)
        else:
            self.pose = Pose((x, y, z), self._start.orientation)
        twist = [*self._translation.velocity, *angular]
        self.twist = twist if scale == 1.0 else [scale * value for value in twist]

    def _rotated(self, rotation: quaternions.Vector) -> quaternions.Quaternion:
        """Return the orientation at the start, rotated by a rotation vector [rad]."""
        return quaternions.product(quaternions.from_rotation_vector(rotation), self._start.orientation)

    def transform(self) -> list[float]:
        """Return the desired pose as 16 column-major floats.

        Without a rotation from the start it has exactly the orientation of the pose that `start` got.
        """
        columns, rotation = self._columns, self._rotation.position
        if any(rotation):
            q = quaternions.from_rotation_vector(rotation)
            columns = [quaternions.rotated(q, column) for column in columns]
        return [*columns[0], 0.0, *columns[1], 0.0, *columns[2], 0.0, *self.pose.position, 1.0]

    def publish(self, time: float, O_T_EE: Sequence[float]) -> None:
        """Publish the state if it is time to do so, by the parameter `state_publish_rate`.

        Args:
            time: robot time [s].
            O_T_EE: measured pose of the end effector in the base frame, 16 column-major floats.
        """
        if not self._state_time.due(time):
            return
        here, counts = self._here(), self._follower.counts
        target = Pose(here.position, self._rotated(here.rotation))
        counted = counts.losses, self._ignored, counts.clamped, dict(counts.refused)
        values = self._follower.tracking.value, target, self.pose, self.twist, Pose.of_column_major(O_T_EE), counted
        self._state.publish(tracking_state, self._node.now(), self._base, *values)


def _vector(values: Sequence[float]) -> quaternions.Vector:
    x, y, z = values
    return x, y, z


def _text(p: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.3f}' for value in p)}) m"


def tracking_state(
    stamp: Any,
    frame: str,
    tracking: str,
    target: Pose,
    desired: Pose,
    twist: list[float],
    measured: Pose,
    counts: tuple[int, int, int, dict[str, int]],
) -> MarkerTrackingState:
    """Return a hric_msgs/MarkerTrackingState; the arguments are in the order of its fields.

    Args:
        stamp: time of the state (genpy.Time).
        frame: name of the frame of the poses.
        tracking: state of the follower.
        target: pose to which the end effector moves.
        desired: desired pose of this cycle.
        twist: velocity of the desired pose, 6 floats [m/s], [rad/s].
        measured: measured pose.
        counts: numbers of losses, of ignored and of clamped targets, and of refused samples by reason.
    """
    losses, ignored, clamped, refused = counts
    return MarkerTrackingState(
        header=stamped.header(stamp, frame),
        tracking=tracking,
        target=stamped.pose_message(target),
        desired=stamped.pose_message(desired),
        desired_twist=stamped.twist_message(twist),
        measured=stamped.pose_message(measured),
        losses=losses,
        ignored=ignored,
        clamped=clamped,
        refused_reasons=list(refused),
        refused_counts=list(refused.values()),
    )
