"""Posture score of one instant, as a control loop or a learning environment needs it: by looking up the posture."""

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from hric_assessment.ergonomics.posture import ANGLES, NOTHING_KNOWN, Task, of_joints
from hric_assessment.ergonomics.scoring import PostureMethod
from hric_assessment.tables import PostureTable
from hric_core.errors import HricError


class InstantScore:
    """Function from the joint positions of a person to the posture score of one arm with the rest of the body.

    The score of a method that is `by_table` depends only on the thresholds that each angle exceeds. So it is computed
    once for each combination of them, by `PostureMethod.score`, and then looked up.

    Args:
        method: posture method, such as RULA.
        joints: names of the joints of a body of `hric_human.body`.
        side: side of the arm, "right" or "left".
        task: task of the arm, with one value per field.
    """

    def __init__(self, method: PostureMethod, joints: Sequence[str], side: str, task: Task = NOTHING_KNOWN) -> None:
        self._method, self._joints, self._side, self._task = method, tuple(joints), side, task
        self._thresholds = list(thresholds(method.table()).items())
        self._scores: dict[tuple[int, ...], int] = {}

    def __call__(self, q: Sequence[float]) -> int:
        """Return the score at joint positions [rad].

        Raises:
            HricError: a position is not finite.
        """
        if not all(map(math.isfinite, q)):
            raise HricError(f"the posture has joint positions that are not finite: {list(q)}; valid: finite numbers")
        posture = of_joints(self._joints, np.array(q), self._side)
        if not self._method.by_table:
            return int(self._method.score(posture, self._task).score[0])
        angles = ((getattr(posture, name), bounds) for name, bounds in self._thresholds)
        key = tuple([-1 if angle is None else bisect_right(bounds, angle) for angle, bounds in angles])
        score = self._scores.get(key)
        if score is None:
            score = self._scores[key] = int(self._method.score(posture, self._task).score[0])
        return score


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
