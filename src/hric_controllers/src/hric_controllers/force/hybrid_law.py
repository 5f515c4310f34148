"""Hybrid law: force along chosen axes of a task frame, Cartesian impedance along the others. No ROS."""

import math
from collections.abc import Sequence

import numpy as np

from hric_controllers.cartesian.law import CartesianArmState, CartesianLaw, Compliance
from hric_controllers.force.force_axis import ForceAxis, ForceGains
from hric_core.geometry import Pose, Vector, quaternions

UNITS: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class HybridLaw(CartesianLaw):
    """Cartesian impedance law without spring and damper along the force axes, where the push of a ForceAxis acts.

    Args:
        compliance, filter_time: as in `CartesianLaw`.
        gains: gains of all force axes.
        turning: True if the task frame has the orientation of the equilibrium pose, False if that of the base.

    Attributes:
        desired: desired force by axis of the task frame, 0 to 2 [N]; empty: impedance along all axes.
        force: force that the arm exerts, base axes [N].
        period: time since the last cycle [s].
        pace: speed scale, 0 to 1, by which the approach speed is multiplied.
        offset: displacement of the equilibrium, base axes [m]; `twist` has its velocity.
    """

    def __init__(self, compliance: Compliance, filter_time: float, gains: ForceGains, turning: bool) -> None:
        super().__init__(compliance, filter_time)
        self._axes, self._turning = [ForceAxis(gains) for _ in range(3)], turning
        self.desired: dict[int, float] = {}
        self.force, self.offset, self.period, self.pace = [0.0] * 3, [0.0] * 3, 0.0, 1.0

    @property
    def touching(self) -> bool:
        """True if there are force axes, and all are in contact."""
        return bool(self.desired) and all(self._axes[index].touching for index in self.desired)

    @property
    def reference(self) -> list[float]:
        """Force to which the force on the surface is controlled now, base axes [N]; 0 without contact."""
        pairs = [(math.copysign(self._axes[k].reference, force), self.axis(k)) for k, force in self.desired.items()]
        return [sum(r * n[i] for r, n in pairs) for i in range(3)]

    @property
    def approached(self) -> float:
        """Displacement towards a surface since the begin of an approach, the largest of all force axes [m]."""
        return max((self._axes[index].approached for index in self.desired), default=0.0)

    def axis(self, index: int) -> Vector:
        """Return the unit vector of an axis of the task frame, base axes."""
        return quaternions.rotated(self.pose.orientation, UNITS[index]) if self._turning else UNITS[index]

    def press(self, desired: dict[int, float]) -> None:
        """Set the attribute `desired`; an axis that had no force, or one of the other sign, starts its approach."""
        for index, force in desired.items():
            if self.desired.get(index, 0.0) * force <= 0.0:
                self._axes[index].start()
        self.desired = desired

    def torque(self, measured: Pose, arm: CartesianArmState) -> list[float]:
        """Return the joint torques of the law without gravity, 7 floats [N m]; `measured`: end-effector pose."""
        pose, twist = self.pose, self.twist
        v = (arm.jacobian[:3] @ np.asarray(arm.dq)).tolist()
        p, t = [a + b for a, b in zip(pose.position, self.offset, strict=True)], list(twist)
        pushes = [0.0, 0.0, 0.0]
        for index, desired in self.desired.items():
            n = self.axis(index)
            push = self._axes[index].advance(
                desired, _dot(n, self.force), _dot(n, v), self.period, self.force_limit, self.pace
            )
            away = _dot(n, measured.position) - _dot(n, p)
            faster = _dot(n, v) - _dot(n, t)
            for i in range(3):
                p[i] += away * n[i]  # no spring along the axis
                t[i] += faster * n[i]  # and no damper
                pushes[i] += push * n[i]
        self.pose, self.twist = Pose((p[0], p[1], p[2]), pose.orientation), t
        tau = super().torque(measured, arm)
        self.pose, self.twist = pose, twist
        self.wrench = [a + b for a, b in zip(self.wrench, [*pushes, 0.0, 0.0, 0.0], strict=True)]
        added = (np.asarray(pushes) @ arm.jacobian[:3]).tolist()
        return [a + b for a, b in zip(tau, added, strict=True)]


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
