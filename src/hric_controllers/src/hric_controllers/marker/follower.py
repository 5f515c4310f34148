"""Targets of the end effector from marker samples: origins, frames, workspace, loss of the marker. No ROS.

The end effector repeats the displacement of the marker. With the marker's position m_0 and the end effector's position
p_0 at the first valid sample (their origins), the target position for a marker at m is (thesis ch. 3.3)

    p = p_0 + R (m - m_0)                        R = R_base_marker
    r = log(exp(R log(a a_0^-1)) exp(r_0))       if the marker's attitude a is followed

The rotation vector r counts from the orientation at the start, r_0 and a_0 are values at the first valid sample. This
module computes targets only; the classes of module `motion` move the end effector to them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from hric_controllers.cartesian.workspace import Box, FrameRotation
from hric_controllers.marker.sample import MarkerSample, SampleValidator
from hric_core.geometry import Vector, quaternions


class FollowerState(Enum):
    """States of the follower of a marker."""

    WAITING = "waiting"
    FOLLOWING = "following"
    LOST = "lost"
    COMMANDED = "commanded"


class FollowerEvent(Enum):
    """Events that change the state of the follower."""

    VALID = "a valid sample has arrived"
    GONE = "no valid sample has arrived for lost_after"
    COMMAND = "a pose is commanded"
    ARRIVED = "the commanded pose is reached"


NEXT: dict[tuple[FollowerState, FollowerEvent], FollowerState] = {
    (FollowerState.WAITING, FollowerEvent.VALID): FollowerState.FOLLOWING,
    (FollowerState.WAITING, FollowerEvent.COMMAND): FollowerState.COMMANDED,
    (FollowerState.FOLLOWING, FollowerEvent.VALID): FollowerState.FOLLOWING,
    (FollowerState.FOLLOWING, FollowerEvent.GONE): FollowerState.LOST,
    (FollowerState.FOLLOWING, FollowerEvent.COMMAND): FollowerState.COMMANDED,
    (FollowerState.LOST, FollowerEvent.VALID): FollowerState.FOLLOWING,
    (FollowerState.LOST, FollowerEvent.COMMAND): FollowerState.COMMANDED,
    (FollowerState.COMMANDED, FollowerEvent.COMMAND): FollowerState.COMMANDED,
    (FollowerState.COMMANDED, FollowerEvent.ARRIVED): FollowerState.WAITING,
}
"""Next state by present state and event; an event without an entry for the present state changes nothing."""


@dataclass(frozen=True)
class FollowerConfig:
    """Settings of the follower of a marker.

    Attributes:
        rotation: rotation R_base_marker, applied to markers that are not given in the base frame.
        workspace: box to which target positions are limited.
        validator: check of samples.
        lost_after: time without a valid sample after which the marker is lost [s].
        catch_up: what happens if a lost marker returns. True: the end effector moves to the target by the old origins;
            False: marker and end effector get new origins, so that the end effector moves on from its place.
        follow_attitude: True if the end effector rotates with the marker.
        largest_turn: maximum rotation of a target from the orientation at the start, below pi [rad]; a sample beyond
            it is refused.
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
    """Position and rotation of the end effector.

    Attributes:
        position: position in the base frame [m].
        rotation: rotation vector from the orientation at the start, in base axes [rad].
    """

    position: Vector
    rotation: Vector = (0.0, 0.0, 0.0)


@dataclass
class FollowerCounts:
    """Counters of a follower since its start.

    Attributes:
        losses: number of times that the marker was lost.
        clamped: number of targets that were moved to the border of the workspace.
        refused: number of refused samples, by reason.
    """

    losses: int = 0
    clamped: int = 0
    refused: dict[str, int] = field(default_factory=dict)


class MarkerFollower:
    """Follower of one marker: makes targets of the end effector from valid samples, and detects the marker's loss.

    Args:
        config: settings.
        report: function for messages to the user, called in the loop; its arguments are True for a warning (False for
            an information) and the text.

    Attributes:
        tracking: present state of the follower.
        counts: counters since the start.
    """

    def __init__(self, config: FollowerConfig, report: Callable[[bool, str], None]) -> None:
        self._config, self._report = config, report
        self.start()

    def start(self) -> None:
        """Wait for a first marker and reset the counters."""
        self.tracking, self.counts = FollowerState.WAITING, FollowerCounts()
        self._marker_origin, self._here_origin = MarkerSample((0.0, 0.0, 0.0)), PoseOffset((0.0, 0.0, 0.0))
        self._last: MarkerSample | None = None
        self._last_time = -math.inf

    def _enter(self, event: FollowerEvent) -> bool:
        """Apply an event to the state machine and return True if it has a transition in the present state."""
        following = NEXT.get((self.tracking, event))
        if following is None:
            return False
        self.tracking = following
        return True

    def take(self, marker: MarkerSample, time: float, here: PoseOffset) -> PoseOffset | None:
        """Return the target for a sample, None if the sample is invalid, refused or ignored in the present state.

        Args:
            marker: sample as received.
            time: robot time [s].
            here: pose at which the end effector rests, or will rest at the end of its motion; its new origin if one is
                needed.
        """
        if not marker.valid or (self.tracking, FollowerEvent.VALID) not in NEXT:
            return None
        last = self._last if self.tracking is FollowerState.FOLLOWING else None
        reason = self._config.validator.objection(marker, last)
        if reason:
            self._refuse(reason)
            return None
        before, first = self.tracking, self._last is None
        catch_up = (
            before is FollowerState.LOST and self._config.catch_up and marker.in_base == self._marker_origin.in_base
        )
        if before is not FollowerState.FOLLOWING and not catch_up:
            self._marker_origin, self._here_origin = marker, here
        target = self._target(marker)
        if target is None:
            self._refuse("rotates the end effector by more than largest_turn")
            return None
        self._enter(FollowerEvent.VALID)
        self._last, self._last_time = marker, time
        if first:
            self._report(False, "first valid marker: the end effector now repeats its displacement from this position")
        elif before is not FollowerState.FOLLOWING:
            origins = (
                "the end effector catches up with its displacement"
                if catch_up
                else "the present positions of marker and end effector are the new origins"
            )
            self._report(False, f"the marker is back: {origins}")
        return target

    def _refuse(self, reason: str) -> None:
        refused = self.counts.refused
        refused[reason] = refused.get(reason, 0) + 1
        if refused[reason] == 1:
            self._report(True, f"marker refused: {reason} (logged only once; the topic state counts all)")

    def _target(self, marker: MarkerSample) -> PoseOffset | None:
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

    def _rotation(self, marker: MarkerSample) -> Vector:
        identity = quaternions.IDENTITY
        by = quaternions.difference(marker.attitude or identity, self._marker_origin.attitude or identity)
        in_base = by if marker.in_base else self._config.rotation.rotated(by)
        start = quaternions.from_rotation_vector(self._here_origin.rotation)
        return quaternions.rotation_vector(quaternions.product(quaternions.from_rotation_vector(in_base), start))

    def lost(self, time: float) -> bool:
        """Return True in the call that detects the loss of the marker; the caller then stops the motion.

        The marker is lost if no valid sample was taken for `lost_after`; `time`: robot time [s].
        """
        silent = time - self._last_time
        if (
            self.tracking is not FollowerState.FOLLOWING
            or silent <= self._config.lost_after
            or not self._enter(FollowerEvent.GONE)
        ):
            return False
        self.counts.losses += 1
        self._report(
            True, f"the marker is lost: no valid sample for {1e3 * silent:.0f} ms; the end effector is brought to rest"
        )
        return True

    def command(self) -> None:
        """Ignore markers from now on, since a pose is commanded, until `arrived` is called."""
        self._enter(FollowerEvent.COMMAND)

    def arrived(self) -> None:
        """Accept markers again, since the commanded pose is reached; the next valid one sets new origins."""
        if self._enter(FollowerEvent.ARRIVED):
            self._last = None
