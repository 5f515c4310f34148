"""Wrench that a topic adds to the Cartesian impedance law. No ROS node."""

import math
from collections.abc import Callable
from typing import Any

from hric_controllers.cartesian.settings import FeedForwardSettings
from hric_core.errors import CommandError
from hric_core.geometry import Quaternion, messages, quaternions
from hric_core.realtime import LatestValue


class FeedForward:
    """Newest wrench of a topic; it ends if no other one arrives for `feedforward/timeout`.

    Args:
        settings: time after which a wrench ends, and largest wrench.
        base: name of the base frame.
        end_effector: name of the end effector's frame.
        warn: function that logs a warning outside the control loop.
    """

    def __init__(
        self, settings: FeedForwardSettings, base: str, end_effector: str, warn: Callable[[str], None]
    ) -> None:
        self._settings, self._base, self._end_effector, self._warn = settings, base, end_effector, warn
        self._newest: LatestValue[tuple[bool, list[float]] | None] = LatestValue(None)
        self.start()

    def start(self) -> None:
        """Discard all wrenches so far."""
        self._newest.take_new()
        self._wrench: tuple[bool, list[float]] | None = None
        self._age = 0.0

    def take(self, message: Any) -> None:
        """Check a geometry_msgs/WrenchStamped and pass it to the loop. Raises CommandError if it is refused."""
        f, m, settings = message.wrench.force, message.wrench.torque, self._settings
        wrench = messages.finite("wrench", f.x, f.y, f.z, m.x, m.y, m.z)
        frame = message.header.frame_id.lstrip("/")
        if frame not in (self._base, self._end_effector):
            raise CommandError(
                f"wrench refused: it is given in the frame {frame!r}; valid: {self._base}, {self._end_effector}"
            )
        force, torque = math.hypot(*wrench[:3]), math.hypot(*wrench[3:])
        if force > settings.largest_force or torque > settings.largest_torque:
            raise CommandError(
                f"wrench refused: {force:.3g} N, {torque:.3g} N m; valid: up to {settings.largest_force:g} N "
                f"(feedforward/largest_force) and {settings.largest_torque:g} N m (feedforward/largest_torque)"
            )
        self._newest.set((frame == self._end_effector, wrench))

    def advance(self, period: float, orientation: Quaternion, force_limit: float) -> list[float] | None:
        """Return the wrench that the end effector exerts, axes of the base, 6 floats [N], [N m]; None: there is none.

        Args:
            period: time since the last cycle [s].
            orientation: orientation of the end effector in the base.
            force_limit: force to which a larger one is scaled down [N].
        """
        newest = self._newest.take_new()
        self._age += period
        if newest is not None:
            self._wrench, self._age = newest, 0.0
        if self._wrench is None:
            return None
        turned, wrench = self._wrench
        if self._age > self._settings.timeout:
            self._wrench = None
            if any(wrench):
                self._warn(
                    f"feed-forward wrench ended: no new one for {self._settings.timeout:g} s (feedforward/timeout)"
                )
            return None
        parts = (wrench[0], wrench[1], wrench[2]), (wrench[3], wrench[4], wrench[5])
        force, torque = (quaternions.rotated(orientation, part) if turned else part for part in parts)
        scale = min(1.0, force_limit / max(math.hypot(*force), 1e-9))
        return [*(scale * x for x in force), *torque]
