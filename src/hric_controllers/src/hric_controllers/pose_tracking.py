"""From topics to the pose of this millisecond: what the controllers share that follow a marker or go to poses."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped

from hric_control import realtime
from hric_control.errors import CommandError, HricError
from hric_control.node import Node, Registration
from hric_control.realtime import LatestValue
from hric_controllers import orientation
from hric_controllers.cartesian_law import Pose
from hric_controllers.equilibrium import JumpLimit, check_equilibrium
from hric_controllers.franka_message import to_quaternion
from hric_controllers.line_motion import LineMotion
from hric_controllers.marker import Marker
from hric_controllers.marker_follower import MarkerFollower, Place, Tracking
from hric_controllers.marker_topics import subscribe_markers
from hric_controllers.orientation import Quaternion, Vector
from hric_controllers.parameters import Every, number
from hric_controllers.playout import MOST, Playout
from hric_controllers.retargeting import MotionLimits, Retargeter
from hric_controllers.tracking_message import tracking_state
from hric_controllers.tracking_parameters import TrackingSettings, read_tracking
from hric_msgs.msg import MarkerTrackingState

ANYWHERE = JumpLimit(math.inf, math.inf)
"""A commanded pose may be far away: the motion leads there within its limits."""


class PoseTracking:
    """The desired pose, cycle by cycle.

    Args:
        node: of the controller; everything is read here, and nothing advertised before `open`.
        base: name of the base frame.

    Attributes:
        pose: desired in this cycle.
        twist: its velocity, 6 floats [m/s], [rad/s].
    """

    def __init__(self, node: Node, base: str) -> None:
        self._node, self._base = node, base
        self._settings = read_tracking(node)
        self._follower = MarkerFollower(self._settings.follower, self._tell)
        self._way, self._turn = self._motion(self._settings, self._settings.translation), self._motion(self._settings, self._settings.rotation)
        self._playout = Playout(0.0 if self._settings.thesis else self._settings.playout_margin)
        self._markers: deque[Marker] = deque(maxlen=MOST)  # filled by the subscription, emptied by the loop
        self._commands: LatestValue[Pose | None] = LatestValue(None)
        self._state_time = Every(number(node, "state_publish_rate", 100.0, minimum=0.0))
        self._running, self._ignored = False, 0
        self._pending: Place | None = None
        self._start = self.pose = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        self._columns: list[Vector] = []
        self.twist = [0.0] * 6

    @staticmethod
    def _motion(settings: TrackingSettings, limits: MotionLimits) -> Retargeter | LineMotion:
        return LineMotion(limits.velocity, limits.acceleration) if settings.thesis else Retargeter(limits.each_of(3), settings.smoothing_time)

    def open(self) -> list[Registration]:
        """Subscribe and advertise; what is to be taken back at the end."""
        settings, node = self._settings, self._node
        self._state = realtime.publisher(node, "state", MarkerTrackingState)
        markers = subscribe_markers(node, settings.source, settings.topic, settings.body, self._base, self._markers.append)
        return [node.subscribe("command", PoseStamped, self._on_command, queue_size=1), *markers, self._state]

    def _tell(self, warn: bool, line: str) -> None:
        """Out of the loop."""
        realtime.defer(self._node, lambda: (self._node.log_warn if warn else self._node.log_info)(line), "log")

    def _on_command(self, message: Any) -> None:
        """A refusal is logged with the topic's name."""
        if not self._running:
            raise CommandError("the controller is not running, the pose is ignored; start it first")
        follower = self._settings.follower
        wanted = check_equilibrium(message, self._base, self._start, ANYWHERE)
        if not follower.workspace.contains(wanted.position):
            raise CommandError(f"pose refused: {_said(wanted.position)} is outside of the workspace; valid: {follower.workspace}")
        turn = math.hypot(*orientation.difference(wanted.orientation, self._start.orientation))
        if turn > follower.largest_turn:
            raise CommandError(
                f"pose refused: it turns by {turn:.3g} rad from the orientation at the start; valid: up to {follower.largest_turn:g} (largest_turn)"
            )
        self._commands.set(wanted)

    def start(self, O_T_EE: Sequence[float]) -> None:
        """Rest at a pose, 16 column-major floats, and wait for a marker.

        Raises:
            HricError: it is outside of the workspace, where the first target would draw it in at once.
        """
        position = (O_T_EE[12], O_T_EE[13], O_T_EE[14])
        box = self._settings.follower.workspace
        if not box.contains(position):
            raise HricError(f"the end effector stands at {_said(position)}, outside of the workspace ({box}); move it in, or widen the workspace")
        self._start = self.pose = Pose(position, to_quaternion(O_T_EE))
        self._columns = [(O_T_EE[k], O_T_EE[k + 1], O_T_EE[k + 2]) for k in (0, 4, 8)]
        self._way.start(position)
        self._turn.start((0.0, 0.0, 0.0))
        self._follower.start()
        self._playout.clear()
        self._markers.clear()
        self._commands.take_new()
        self._pending, self._ignored, self.twist = None, 0, [0.0] * 6
        self._state_time.restart()
        self._running = True

    def stop(self) -> None:
        """From here on commands are refused."""
        self._running = False

    @property
    def tracking(self) -> Tracking:
        """What the follower does."""
        return self._follower.tracking

    def update(self, time: float, period: float) -> None:
        """Take what came, and lead the pose on by one period.

        Args:
            time: run time [s].
            period: since the last cycle [s].
        """
        self._take_command()
        while self._markers:
            self._take_marker(self._markers.popleft(), time)
        if self._follower.tracking is Tracking.FOLLOWING:
            target = self._playout.due(time)
            if target is not None and not self._head_for(target):
                self._ignored += 1
        if self._follower.lost(time):
            self._playout.clear()
            self._way.stop()
            self._turn.stop()
        self._advance(period)

    def _take_marker(self, marker: Marker, time: float) -> None:
        anew = self._follower.tracking is not Tracking.FOLLOWING
        target = self._follower.take(marker, time, self._here())
        if target is not None:
            if anew:
                self._playout.clear()
            self._playout.add(time, marker.stamp, target)

    def _take_command(self) -> None:
        wanted = self._commands.take_new()
        if wanted is not None:
            self._pending = Place(wanted.position, orientation.difference(wanted.orientation, self._start.orientation))
            self._follower.command()
            self._playout.clear()
        if self._pending is not None:
            if self._head_for(self._pending):
                self._pending = None
        elif self._follower.tracking is Tracking.COMMANDED and not self._moving:
            self._follower.arrived()

    @property
    def _moving(self) -> bool:
        return self._way.moving or self._turn.moving

    def _here(self) -> Place:
        (x, y, z), (a, b, c) = self._way.rest, self._turn.rest
        return Place((x, y, z), (a, b, c))

    def _head_for(self, place: Place) -> bool:
        """Whether the motions take the target: in the thesis's mode only while both rest."""
        if self._settings.thesis and self._moving:
            return False
        for motion, target in ((self._way, place.position), (self._turn, place.turn)):
            if motion.moving or list(target) != motion.position:
                motion.go(target)
        return True

    def _advance(self, period: float) -> None:
        self._way.advance(period)
        self._turn.advance(period)
        x, y, z = self._way.position
        a, b, c = self._turn.velocity
        angular = (a, b, c)
        if any(self._turn.position):
            turn = self._turned_by(self._turn.position)
            self.pose = Pose((x, y, z), orientation.product(orientation.from_rotation_vector(turn), self._start.orientation))
            angular = orientation.angular_velocity(turn, angular)
        else:
            self.pose = Pose((x, y, z), self._start.orientation)
        self.twist = [*self._way.velocity, *angular]

    @staticmethod
    def _turned_by(values: Sequence[float]) -> Vector:
        x, y, z = values
        return x, y, z

    def transform(self) -> list[float]:
        """The desired pose as 16 column-major floats; not turned, it keeps the bits of the start."""
        columns, turn = self._columns, self._turned_by(self._turn.position)
        if any(turn):
            q = orientation.from_rotation_vector(turn)
            columns = [orientation.rotated(q, column) for column in columns]
        return [*columns[0], 0.0, *columns[1], 0.0, *columns[2], 0.0, *self.pose.position, 1.0]

    def publish(self, time: float, O_T_EE: Sequence[float]) -> None:
        """The state, at its rate; O_T_EE: measured pose, 16 column-major floats."""
        if not self._state_time.due(time):
            return
        measured = Pose((O_T_EE[12], O_T_EE[13], O_T_EE[14]), to_quaternion(O_T_EE))
        here, counts = self._here(), self._follower.counts
        turned: Quaternion = orientation.product(orientation.from_rotation_vector(here.turn), self._start.orientation)
        numbers = counts.losses, self._ignored, counts.clamped, dict(counts.refused)
        values = self.tracking.value, Pose(here.position, turned), self.pose, self.twist, measured, numbers
        self._state.publish(tracking_state, self._node.now(), self._base, *values)


def _said(p: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.3f}' for value in p)}) m"
