"""From a marker's samples to targets of the end effector: anchors, frames, the workspace, and what happens when the marker is lost. No ROS.

With the marker's origin m_0 and the end effector's p_0, both taken at the first valid sample, a marker at m asks for (thesis ch. 3.3)

    p    = p_0 + R (m - m_0)                        R = R_base_marker
    turn = log(exp(R log(a a_0^-1)) exp(turn_0))    where its attitude a is followed

`turn` counts from the orientation at the start. Nothing moves here: a motion (`retargeting`, `line_motion`) takes the targets.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from hric_controllers import orientation
from hric_controllers.marker import Believable, Marker
from hric_controllers.orientation import Quaternion, Vector
from hric_controllers.workspace import Box, FrameRotation

NO_TURN: Quaternion = (0.0, 0.0, 0.0, 1.0)


class Tracking(Enum):
    """What the follower does."""

    WAITING = "waiting"
    FOLLOWING = "following"
    LOST = "lost"
    COMMANDED = "commanded"


class Event(Enum):
    """What changes that."""

    VALID = "a valid marker came"
    GONE = "none came for too long"
    COMMAND = "a pose is commanded"
    ARRIVED = "the commanded pose is reached"


NEXT: dict[tuple[Tracking, Event], Tracking] = {
    (Tracking.WAITING, Event.VALID): Tracking.FOLLOWING,
    (Tracking.WAITING, Event.COMMAND): Tracking.COMMANDED,
    (Tracking.FOLLOWING, Event.VALID): Tracking.FOLLOWING,
    (Tracking.FOLLOWING, Event.GONE): Tracking.LOST,
    (Tracking.FOLLOWING, Event.COMMAND): Tracking.COMMANDED,
    (Tracking.LOST, Event.VALID): Tracking.FOLLOWING,
    (Tracking.LOST, Event.COMMAND): Tracking.COMMANDED,
    (Tracking.COMMANDED, Event.COMMAND): Tracking.COMMANDED,
    (Tracking.COMMANDED, Event.ARRIVED): Tracking.WAITING,
}
"""The whole state machine; an event that has no entry changes nothing."""


@dataclass(frozen=True)
class FollowerConfig:
    """How a marker is followed.

    Attributes:
        rotation: for markers that are not given in the base already.
        workspace: targets are brought back into it.
        believable: what a sample must fulfil.
        lost_after: time without a valid sample after which the marker is lost [s].
        catch_up: on its return the marker is met where it is by then, with the anchors as they were; else both are anchored anew.
        follow_attitude: whether the end effector turns with the marker.
        largest_turn: a sample that asks for more, from the orientation at the start, is refused; below pi [rad].
    """

    rotation: FrameRotation
    workspace: Box
    believable: Believable
    lost_after: float
    catch_up: bool = False
    follow_attitude: bool = False
    largest_turn: float = 2.5


@dataclass(frozen=True)
class Place:
    """Of the end effector: position in the base [m], and rotation vector from the orientation at the start, axes of the base [rad]."""

    position: Vector
    turn: Vector = (0.0, 0.0, 0.0)


@dataclass
class Counts:
    """Since the start: losses, targets brought back into the workspace, refused samples by reason."""

    losses: int = 0
    clamped: int = 0
    refused: dict[str, int] = field(default_factory=dict)


class MarkerFollower:
    """Follows one marker.

    Args:
        config: how.
        tell: takes a line for the user: True for a warning; called in the loop.

    Attributes:
        tracking: what it does.
        counts: what happened.
    """

    def __init__(self, config: FollowerConfig, tell: Callable[[bool, str], None]) -> None:
        self._config, self._tell = config, tell
        self.start()

    def start(self) -> None:
        """Wait for a first marker; the counts begin anew."""
        self.tracking, self.counts = Tracking.WAITING, Counts()
        self._marker_origin, self._here_origin = Marker((0.0, 0.0, 0.0)), Place((0.0, 0.0, 0.0))
        self._last: Marker | None = None
        self._seen = -math.inf

    def _enter(self, event: Event) -> bool:
        """Whether the event counts now."""
        following = NEXT.get((self.tracking, event))
        if following is None:
            return False
        self.tracking = following
        return True

    def take(self, marker: Marker, time: float, here: Place) -> Place | None:
        """A sample.

        Args:
            marker: as it came.
            time: run time [s].
            here: where the end effector stands, or comes to rest: its new origin, where one is needed.

        Returns:
            Where it shall go; None: nothing follows from this sample.
        """
        if not marker.valid or (self.tracking, Event.VALID) not in NEXT:
            return None
        last = self._last if self.tracking is Tracking.FOLLOWING else None
        reason = self._config.believable.objection(marker, last)
        if reason:
            self._refuse(reason)
            return None
        before, first = self.tracking, self._last is None
        catch_up = before is Tracking.LOST and self._config.catch_up and marker.in_base == self._marker_origin.in_base
        if before is not Tracking.FOLLOWING and not catch_up:
            self._marker_origin, self._here_origin = marker, here
        target = self._target(marker)
        if target is None:
            self._refuse("asks for more than largest_turn")
            return None
        self._enter(Event.VALID)
        self._last, self._seen = marker, time
        if before is not Tracking.FOLLOWING:
            self._tell(False, self._greeting(first, catch_up))
        return target

    def _greeting(self, first: bool, catch_up: bool) -> str:
        if first:
            return "first marker: it and the end effector are the origins of the motion that follows"
        return f"the marker is back: {'the end effector catches up with it' if catch_up else 'it and the end effector are the new origins'}"

    def _refuse(self, reason: str) -> None:
        refused = self.counts.refused
        refused[reason] = refused.get(reason, 0) + 1
        if refused[reason] == 1:
            self._tell(True, f"a marker is refused: {reason} (told once; the state counts them)")

    def _target(self, marker: Marker) -> Place | None:
        config, origin, here = self._config, self._marker_origin, self._here_origin
        way = (marker.position[0] - origin.position[0], marker.position[1] - origin.position[1], marker.position[2] - origin.position[2])
        x, y, z = way if marker.in_base else config.rotation.turned(way)
        wanted = here.position[0] + x, here.position[1] + y, here.position[2] + z
        position = config.workspace.nearest(wanted)
        turn = self._turn(marker) if config.follow_attitude else here.turn
        if math.hypot(*turn) > config.largest_turn:
            return None
        self.counts.clamped += position != wanted
        return Place(position, turn)

    def _turn(self, marker: Marker) -> Vector:
        by = orientation.difference(marker.attitude or NO_TURN, self._marker_origin.attitude or NO_TURN)
        in_base = by if marker.in_base else self._config.rotation.turned(by)
        start = orientation.from_rotation_vector(self._here_origin.turn)
        return orientation.rotation_vector(orientation.product(orientation.from_rotation_vector(in_base), start))

    def lost(self, time: float) -> bool:
        """Whether the marker is lost as of this call; then the motion is to be stopped."""
        silent = time - self._seen
        if self.tracking is not Tracking.FOLLOWING or silent <= self._config.lost_after or not self._enter(Event.GONE):
            return False
        self.counts.losses += 1
        self._tell(True, f"the marker is lost: no valid one for {1e3 * silent:.0f} ms; the end effector stops")
        return True

    def command(self) -> None:
        """A pose is commanded: markers count no more until it is reached."""
        self._enter(Event.COMMAND)

    def arrived(self) -> None:
        """It is reached: the next marker is a first one."""
        if self._enter(Event.ARRIVED):
            self._last = None
