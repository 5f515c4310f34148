"""Positions of the hands and feet of a person at some instants, with the interval that uncertain joint angles give.

stances = Stances(person, np.array([1.2, 3.4]))
stances.middle.hands, stances.half_width(lambda stance: stance.hands[:, 2])
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.body import Body
from hric_human.control.whole_body import RootMotion, WholeBody

NORMAL = 1.96
"""Ratio of a 95 % interval's half-width to the standard deviation, for a normal distribution [1]."""
SIDES = ("right", "left")


class Stance(NamedTuple):
    """Hands and feet of a person at n instants, in a frame whose z axis points up; NaN: not known.

    Attributes:
        hands: midpoint of the middles of both hands, shape (n, 3) [m].
        feet: midpoint of the ankles, shape (n, 3) [m]; of the hips, if the body has no legs.
        forward: horizontal part of the pelvis's forward axis, shape (n, 2).
    """

    hands: FloatArray
    feet: FloatArray
    forward: FloatArray

    @property
    def reach(self) -> FloatArray:
        """Horizontal distance of the hands from the feet, shape (n,) [m]."""
        return np.asarray(np.linalg.norm((self.hands - self.feet)[:, :2], axis=1))

    @property
    def asymmetry(self) -> FloatArray:
        """Horizontal angle between the direction to the hands and the pelvis's forward axis, shape (n,) [rad]."""
        to = (self.hands - self.feet)[:, :2]
        across = self.forward[:, 0] * to[:, 1] - self.forward[:, 1] * to[:, 0]
        return np.asarray(np.abs(np.arctan2(across, (self.forward * to).sum(axis=1))))


class Stances:
    """Stance of a person at n instants, and its change by errors of the joint angles.

    Args:
        body: body of the person.
        q: joint positions, shape (n, j) [rad]; NaN: not known.
        deviation: standard deviations of the joint angles, shape (n, j) [rad].
        pose: poses of the root link in a frame whose z axis points up, shape (n, 7) [m], quaternion x, y, z, w.

    Attributes:
        middle: stance at the joint positions `q`.
        legs: True if the body has legs, so that the feet can be known.

    Raises:
        HricError: the body lacks a hand, or the position of hands or feet is not known.
    """

    def __init__(self, body: Body, q: FloatArray, deviation: FloatArray, pose: FloatArray) -> None:
        self._q, self._deviation = q, deviation
        self._root = RootMotion(pose[:, :3], pose[:, 3:], *[np.zeros((len(q), 3))] * 3)
        x, y, z, w = pose[:, 3:].T
        self._forward = np.column_stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)])
        self._whole, self._segments = WholeBody(body), body.segments
        self.legs = f"{SIDES[0]}_foot" in self._segments
        self.middle = self._stance(q)
        if not np.isfinite(self.middle.hands).all():
            raise HricError("the angles of trunk or arms are not known, nor is the position of the hands")
        if not np.isfinite(self.middle.feet).all():
            raise HricError("the angles of the legs are not known, nor is the position of the feet")

    def half_width(self, quantity: Callable[[Stance], FloatArray]) -> FloatArray:
        """Return the half-width of the 95 % interval of a quantity, in its shape and unit.

        The variance is the sum of the squared changes by one standard deviation of each joint angle, up or down, the
        larger one (first order, as independent).
        """
        middle = quantity(self.middle)
        variance = np.zeros_like(middle)
        for column in np.flatnonzero((self._deviation > 0.0).any(axis=0)):
            changes = []
            for sign in (1.0, -1.0):
                q = self._q.copy()
                q[:, column] += sign * self._deviation[:, column]
                changes.append(np.abs(quantity(self._stance(q)) - middle))
            variance += np.fmax(*changes) ** 2
        return np.asarray(NORMAL * np.sqrt(variance))

    def _stance(self, q: FloatArray) -> Stance:
        still = np.zeros_like(q)
        needed = self._whole.inverse_dynamics(q, still, still, self._root)
        hands, feet = [], []
        for side in SIDES:
            if (hand := self._segments.get(f"{side}_hand")) is None:
                raise HricError(f"the body has no {side} hand")
            at = self._whole.index[hand.link]
            hands.append(needed.position[:, at] + needed.rotation[:, at] @ (0.5 * (hand.start + hand.end)))
            if self.legs:
                feet.append(needed.position[:, self._whole.index[self._segments[f"{side}_foot"].link]])
        return Stance(np.mean(hands, axis=0), np.mean(feet, axis=0) if feet else self._root.position, self._forward)
