"""Torque that keeps joints away from the ends of their position ranges. No ROS."""

from collections.abc import Sequence

from hric_controllers.cartesian.settings import JointRepulsionSettings


class JointRepulsion:
    """Spring and damper inside a margin at both ends of each joint's range.

    With s the depth in the margin relative to its width, at most 1, the torque is `s (tau_max - d dq)` away from the
    end: zero at the border of the margin, `tau_max` at rest at the end of the range and beyond it.

    Args:
        settings: width of the margin, torque and damping at the end of the range.
        ranges: position range (lower, upper) of each joint [rad].
    """

    def __init__(self, settings: JointRepulsionSettings, ranges: Sequence[tuple[float, float]]) -> None:
        self._margin, self._torque, self._damping = settings.margin, settings.torque, settings.damping
        self._ranges = ranges

    def _depths(self, q: Sequence[float]) -> list[float]:
        """Return the signed relative depth in the margin of each joint, positive at the lower end; not limited to 1."""
        width = self._margin
        return [
            max(0.0, low + width - x) / width - max(0.0, x - high + width) / width
            for x, (low, high) in zip(q, self._ranges, strict=True)
        ]

    def torque(self, q: Sequence[float], dq: Sequence[float]) -> list[float]:
        """Return the torques, n floats [N m]; q, dq: joint positions and velocities [rad], [rad/s]."""
        bounded = [max(-1.0, min(depth, 1.0)) for depth in self._depths(q)]
        return [s * self._torque - abs(s) * self._damping * v for s, v in zip(bounded, dq, strict=True)]

    def energy(self, q: Sequence[float]) -> float:
        """Return the energy that the springs store [J]."""
        depths = [abs(depth) for depth in self._depths(q)]
        relative = sum(0.5 * depth * depth if depth < 1.0 else depth - 0.5 for depth in depths)
        return self._torque * self._margin * relative
