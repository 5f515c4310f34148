"""From a marker's samples to targets of the end effector: anchors, frames, the workspace, and what happens when the
marker is lost. No ROS.

With the marker's origin m_0 and the end effector's p_0, both taken at the first valid sample, the target of a marker at
m is (thesis ch. 3.3)

    p = p_0 + R (m - m_0)                        R = R_base_marker
    r = log(exp(R log(a a_0^-1)) exp(r_0))       where its attitude a is followed

The rotation vector r counts from the orientation at the start. Nothing moves here: a motion (`motion`) takes the
targets.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from hric_control.geometry import Vector, quaternions
from hric_controllers.cartesian.workspace import Box, FrameRotation
from hric_controllers.marker.sample import Marker, SampleValidator


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
        validator: of samples.
        lost_after: time without a valid sample after which the marker is lost [s].
        catch_up: on its return the marker is met where it is by then, with the anchors as they were; else both are
            anchored again.
        follow_attitude: whether the end effector turns with the marker.
        largest_turn: a sample whose target is further from the orientation at the start is refused; below pi [rad].
    """

    rotation: FrameRotation
    workspace: Box
    validator: SampleValidator
    lost_after: float
    catch_up: bool = False
    follow_attitude: bool = False
    largest_turn: float = 2.5


@dataclass(frozen=True)
class PoseOffset:
    """Of the end effector: position in the base [m], and rotation vector from the orientation at the start, axes of the
    base [rad]."""

    position: Vector
    rotation: Vector = (0.0, 0.0, 0.0)


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
        report: takes a line for the user: True for a warning; called in the loop.

    Attributes:
        tracking: what it does.
        counts: what happened.
    """

    def __init__(self, config: FollowerConfig, report: Callable[[bool, str], None]) -> None:
        self._config, self._report = config, report
        self.start()

    def start(self) -> None:
        """Wait for a first marker; the counts begin again."""
        self.tracking, self.counts = Tracking.WAITING, Counts()
        self._marker_origin, self._here_origin = Marker((0.0, 0.0, 0.0)), PoseOffset((0.0, 0.0, 0.0))
        self._last: Marker | None = None
        self._last_time = -math.inf

    def _enter(self, event: Event) -> bool:
        """Whether the event counts now."""
        following = NEXT.get((self.tracking, event))
        if following is None:
            return False
        self.tracking = following
        return True

    def take(self, marker: Marker, time: float, here: PoseOffset) -> PoseOffset | None:
        """A sample.

        Args:
            marker: as it came.
            time: robot time [s].
            here: where the end effector is, or comes to rest: its new origin, where one is needed.

        Returns:
            Its target; None: nothing follows from this sample.
        """
        if not marker.valid or (self.tracking, Event.VALID) not in NEXT:
            return None
        last = self._last if self.tracking is Tracking.FOLLOWING else None
        reason = self._config.validator.objection(marker, last)
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
        self._last, self._last_time = marker, time
        if first:
            self._report(False, "first marker: it and the end effector are the origins of the motion that follows")
        elif before is not Tracking.FOLLOWING:
            origins = (
                "the end effector catches up with it" if catch_up else "it and the end effector are the new origins"
            )
            self._report(False, f"the marker is back: {origins}")
        return target

    def _refuse(self, reason: str) -> None:
        refused = self.counts.refused
        refused[reason] = refused.get(reason, 0) + 1
        if refused[reason] == 1:
            self._report(True, f"a marker is refused: {reason} (reported once; the state counts them)")

    def _target(self, marker: Marker) -> PoseOffset | None:
        config, origin, here = self._config, self._marker_origin, self._here_origin
        translation = (
            marker.position[0] - origin.position[0],
            marker.position[1] - origin.position[1],
            marker.position[2] - origin.position[2],
        )
        x, y, z = translation if marker.in_base else config.rotation.rotated(translation)
        requested = here.position[0] + x, here.position[1] + y, here.position[2] + z
        position = config.workspace.nearest(requested)
        rotation = self._rotation(marker) if config.follow_attitude else here.rotation
        if math.hypot(*rotation) > config.largest_turn:
            return None
        self.counts.clamped += position != requested
        return PoseOffset(position, rotation)

    def _rotation(self, marker: Marker) -> Vector:
        identity = quaternions.IDENTITY
        by = quaternions.difference(marker.attitude or identity, self._marker_origin.attitude or identity)
        in_base = by if marker.in_base else self._config.rotation.rotated(by)
        start = quaternions.from_rotation_vector(self._here_origin.rotation)
        return quaternions.rotation_vector(quaternions.product(quaternions.from_rotation_vector(in_base), start))

    def lost(self, time: float) -> bool:
        """Whether the marker is lost as of this call; then the motion is to be stopped."""
        silent = time - self._last_time
        if self.tracking is not Tracking.FOLLOWING or silent <= self._config.lost_after or not self._enter(Event.GONE):
            return False
        self.counts.losses += 1
        self._report(True, f"the marker is lost: no valid one for {1e3 * silent:.0f} ms; the end effector stops")
        return True

    def command(self) -> None:
        """A pose is commanded: markers count no more until it is reached."""
        self._enter(Event.COMMAND)

    def arrived(self) -> None:
        """It is reached: the next marker is a first one."""
        if self._enter(Event.ARRIVED):
            self._last = None
