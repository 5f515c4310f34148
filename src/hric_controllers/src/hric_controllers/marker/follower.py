"""Targets of the end effector from marker samples: origins, frames, workspace, loss of the marker. No ROS.

With the marker's origin m_0 and the end effector's p_0, both taken at the first valid sample, the target for a marker
at m is (thesis ch. 3.3)

    p = p_0 + R (m - m_0)                        R = R_base_marker
    r = log(exp(R log(a a_0^-1)) exp(r_0))       if its attitude a is followed

The rotation vector r counts from the orientation at the start. This module moves nothing: a motion (`motion`) takes
the targets.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from hric_controllers.cartesian.workspace import Box, FrameRotation
from hric_controllers.marker.sample import MarkerSample, SampleValidator
from hric_core.geometry import Vector, quaternions


class FollowerState(Enum):
    """States of the follower."""

    WAITING = "waiting"
    FOLLOWING = "following"
    LOST = "lost"
    COMMANDED = "commanded"


class FollowerEvent(Enum):
    """Events that change the state of the follower."""

    VALID = "a valid marker came"
    GONE = "none came for too long"
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
"""Transitions of the state machine; an event without an entry changes nothing."""


@dataclass(frozen=True)
class FollowerConfig:
    """Settings of the follower.

    Attributes:
        rotation: rotation of markers that are not given in the base frame.
        workspace: box to which target positions are limited.
        validator: check of samples.
        lost_after: time without a valid sample after which the marker is lost [s].
        catch_up: True: the end effector moves to a marker that returns, origins unchanged; False: both origins are set
            again.
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
    """Position of the end effector in the base [m], and rotation vector from the start orientation, base axes [rad]."""

    position: Vector
    rotation: Vector = (0.0, 0.0, 0.0)


@dataclass
class FollowerCounts:
    """Numbers of losses, of targets limited to the workspace, and of refused samples by reason, since the start."""

    losses: int = 0
    clamped: int = 0
    refused: dict[str, int] = field(default_factory=dict)


class MarkerFollower:
    """Follower of one marker.

    Args:
        config: settings.
        report: function that takes True for a warning and a line for the user; called in the loop.

    Attributes:
        tracking: present state.
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
        """Take a sample and return the target that follows from it, None if there is none.

        Args:
            marker: sample as received.
            time: robot time [s].
            here: present or next rest pose of the end effector, used as new origin if one is needed.
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
            self._refuse("asks for more than largest_turn")
            return None
        self._enter(FollowerEvent.VALID)
        self._last, self._last_time = marker, time
        if first:
            self._report(False, "first marker: it and the end effector are the origins of the motion that follows")
        elif before is not FollowerState.FOLLOWING:
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
        """Return True if the marker is lost as of this call; the caller then stops the motion."""
        silent = time - self._last_time
        if (
            self.tracking is not FollowerState.FOLLOWING
            or silent <= self._config.lost_after
            or not self._enter(FollowerEvent.GONE)
        ):
            return False
        self.counts.losses += 1
        self._report(True, f"the marker is lost: no valid one for {1e3 * silent:.0f} ms; the end effector stops")
        return True

    def command(self) -> None:
        """Ignore markers until the commanded pose is reached."""
        self._enter(FollowerEvent.COMMAND)

    def arrived(self) -> None:
        """Accept markers again; the next one is a first marker."""
        if self._enter(FollowerEvent.ARRIVED):
            self._last = None
