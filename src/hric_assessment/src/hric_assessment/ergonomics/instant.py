"""Posture score of one instant, as a control loop or a learning environment needs it: by looking up the posture."""

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from hric_assessment.ergonomics.posture import ANGLES, NOTHING_KNOWN, Task, of_joints
from hric_assessment.ergonomics.scoring import PostureMethod
from hric_assessment.tables import PostureTable
from hric_core.errors import HricError, check_known


class InstantScore:
    """Function from the joint positions of a person to the posture score of an arm with the rest of the body.

    The score of a method that is `by_table` depends only on the thresholds that each angle exceeds. So it is computed
    once for each combination of them, by `PostureMethod.score`, and then looked up.

    Args:
        method: posture method, such as RULA.
        joints: names of the joints of a body of `hric_human.body`.
        sides: side of the arm, "right" or "left"; several: the score is that of the arm with the highest one.
        task: task of the arm, with one value per field.

    Raises:
        UnknownNameError: an arm lacks a joint that another one has.
    """

    def __init__(self, method: PostureMethod, joints: Sequence[str], *sides: str, task: Task = NOTHING_KNOWN) -> None:
        self._method, self._joints, self._side, self._task = method, tuple(joints), sides[0], task
        self._columns = np.array([_exchanged(self._joints, self._side, side) for side in sides])
        self._thresholds = list(thresholds(method.table()).items())
        self._scores: dict[tuple[int, ...], int] = {}

    def __call__(self, q: Sequence[float]) -> int:
        """Return the score at joint positions [rad].

        Raises:
            HricError: a position is not finite.
        """
        if not all(map(math.isfinite, q)):
            raise HricError(f"the posture has joint positions that are not finite: {list(q)}; valid: finite numbers")
        posture = of_joints(self._joints, np.array(q)[self._columns], self._side)
        if not self._method.by_table:
            return int(self._method.score(posture, self._task).score.max())
        angles = [(getattr(posture, name), bounds) for name, bounds in self._thresholds]
        exceeded = [[bisect_right(bounds, a) for a in angle.tolist()] for angle, bounds in angles if angle is not None]
        keys = list(zip(*exceeded, strict=True)) or [()]
        if not all(key in self._scores for key in keys):
            self._scores |= zip(keys, self._method.score(posture, self._task).score.tolist(), strict=True)
        return max([self._scores[key] for key in keys])


def _exchanged(joints: Sequence[str], side: str, other: str) -> list[int]:
    """Return the index of each joint of a body whose sides are exchanged, so that the arm `other` is that of `side`."""
    exchanged = {side: other, other: side}
    parts = [name.split("_", 1) for name in joints]
    names = ["_".join([exchanged.get(first, first), *rest]) for first, *rest in parts]
    check_known("joint", names, joints, "the body, of which both arms count")
    return [joints.index(name) for name in names]


def thresholds(table: PostureTable) -> dict[str, list[float]]:
    """Return the angles at which a score may change, ascending, by name of the angle [rad].

    An angle that is equal to a threshold counts as above it; where a table counts it as below, the threshold is the
    next floating-point number.
    """
    found: dict[str, set[float]] = {}

    def note(name: str | None, *degrees: float) -> None:
        for value in map(math.radians, degrees):
            found.setdefault(str(name), set()).update((value, math.nextafter(value, math.inf)))

    for part in table.parts.values():
        for band in part.bands:
            note(band.angle, *(table.degrees(bound) for bound in band.bounds))
        for condition in (condition for adder in part.add for condition in adder.any if condition.angle):
            value = table.degrees(str(condition.above or condition.beyond))
            note(condition.angle, *((value,) if condition.above is not None else (-value, value)))
    return {name: sorted(values) for name, values in found.items() if name in ANGLES}
