"""Posture score of one instant, as a control loop or a learning environment needs it: by looking up the posture."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from hric_assessment.ergonomics.posture import ANGLES, NOTHING_KNOWN, Task, of_joints, sources
from hric_assessment.ergonomics.scoring import IntArray, PostureMethod
from hric_assessment.tables import PostureTable
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.native import load

_exceeded: Callable[[Sequence[float], IntArray, FloatArray], bytes] = load("hric_posture").exceeded


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
        HricError: a side is neither "right" nor "left".
    """

    def __init__(self, method: PostureMethod, joints: Sequence[str], *sides: str, task: Task = NOTHING_KNOWN) -> None:
        self._method, self._joints, self._sides, self._task = method, tuple(joints), sides, task
        self._thresholds = [_by_joints(thresholds(method.table()), joints, side) for side in sides]
        self._scores: dict[tuple[int, bytes], int] = {}

    def __call__(self, q: Sequence[float]) -> int:
        """Return the score at joint positions [rad].

        Raises:
            HricError: a position is not finite.
        """
        if not all(map(math.isfinite, q)):
            raise HricError(f"the posture has joint positions that are not finite: {list(q)}; valid: finite numbers")
        if not self._method.by_table:
            return max(self._score(q, side) for side in self._sides)
        keys = [(number, _exceeded(q, *rows)) for number, rows in enumerate(self._thresholds)]
        self._scores |= {key: self._score(q, self._sides[key[0]]) for key in keys if key not in self._scores}
        return max([self._scores[key] for key in keys])

    def _score(self, q: Sequence[float], side: str) -> int:
        return int(self._method.score(of_joints(self._joints, np.array(q), side), self._task).score[0])


def _by_joints(bounds: dict[str, list[float]], joints: Sequence[str], side: str) -> tuple[IntArray, FloatArray]:
    """Return sources and thresholds of the known angles for posture.c, shapes (n, 5) and (n, m)."""
    known = {name: source for name, source in sources(joints, side).items() if name in bounds}
    size = max((len(bounds[name]) for name in known), default=0)
    rows = [bounds[name] + [math.inf] * (size - len(bounds[name])) for name in known]
    return np.array(list(known.values()), np.intc).reshape(-1, 5), np.array(rows).reshape(len(known), size)


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
