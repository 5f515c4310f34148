"""Bounded efforts that bring joints to a target speed in one step: Coulomb friction, stops, and drives.

Each is a row: joint i, effort e_i within [low, high], target speed w. With the speeds v at the end of the step without
rows, and the response K dt of the speeds to efforts, e is such that each joint reaches its w, or its effort is at the
bound that prevents it (projected Gauss-Seidel). The efforts are constant over the step, as commands are; so friction
holds exactly up to its value, and a stop is rigid and absorbs the joint's energy at any step and any inertia. A stop
limits the speed so that the joint just reaches it at the end of the step; a joint beyond it returns by a fifth of the
way in each step.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hric_control.plant import FloatArray
from hric_control.plants import StopMemory

RETURN = 0.2
"""Fraction of a stop violation that is corrected per step, as in common engines [1] (project default, unconfirmed)."""
NEAR = 0.01
"""Distance beyond two steps' travel at which a stop is considered [rad or m] (project default, unconfirmed)."""
_SWEEPS = 50
_TOLERANCE = 1e-12
"""Relative change of the efforts at which the iteration ends [1]."""


@dataclass(frozen=True)
class EffortRow:
    """Effort within [low, high] [N m or N] that drives `joint` to `speed` [rad/s or m/s]; drive: it is reported."""

    joint: int
    low: float
    high: float
    speed: float
    drive: bool = False


@dataclass
class JointEfforts:
    """Rows of one robot; all by indices in the tree.

    Args:
        coulomb: joint -> Coulomb friction [N m or N], if any.
        stops: ranges in the order of `stop_joints`, and the stops that are still inactive.
        stop_joints: indices of the joints in the order of `stops`.
        time_step: [s].

    Attributes:
        drives: rows of velocity and position drives for the coming step.
        active: True if there may be rows in the coming step.
        driven: joint -> effort of its drive in the last step [N m or N].
    """

    coulomb: dict[int, float]
    stops: StopMemory
    stop_joints: list[int]
    time_step: float
    drives: list[EffortRow] = field(default_factory=list)
    active: bool = True
    driven: dict[int, float] = field(default_factory=dict)
    _before: dict[tuple[int, float], float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        ranges = zip(self.stop_joints, self.stops.limits, strict=True)
        self._ranges = [(index, low, high) for index, (low, high) in ranges if low > -math.inf or high < math.inf]
        self.forget()

    def forget(self) -> None:
        """Forget the previous efforts and distances to stops, after the state was set from outside."""
        self._before.clear()
        self._clearance = self._fastest = 0.0

    @property
    def always(self) -> bool:
        """True if there are rows in every step."""
        return bool(self.coulomb or self.drives)

    def near_stop(self, q: Sequence[float], u: Sequence[float]) -> bool:
        """Return True if a stop could act in the coming step; distances are computed again only after enough travel."""
        fastest = max(max(u), -min(u)) * self.time_step
        self._clearance -= max(fastest, self._fastest)
        self._fastest = fastest
        if self._clearance > fastest:
            return False
        gaps = [min(q[index] - low, high - q[index]) for index, low, high in self._ranges]
        self._clearance = min(gaps, default=math.inf) - NEAR
        return self._clearance <= 2.0 * fastest

    def rows(self, q: FloatArray, v: FloatArray) -> list[EffortRow]:
        """Return the rows that may act in a step from positions q with end speeds v."""
        rows = [EffortRow(i, -F, F, 0.0) for i, F in self.coulomb.items()]
        rows += self.drives
        return rows + self._stop_rows(q, v)

    def _stop_rows(self, q: FloatArray, v: FloatArray) -> list[EffortRow]:
        rows = []
        for i, (index, (low, high)) in enumerate(zip(self.stop_joints, self.stops.limits, strict=True)):
            below, above = self.stops.waiting.get(i, (False, False))
            margin = NEAR + 2.0 * self.time_step * abs(float(v[index]))
            if not below and q[index] < low + margin:
                rows.append(EffortRow(index, 0.0, math.inf, self._speed(low - float(q[index]), q[index] >= low)))
            if not above and q[index] > high - margin:
                rows.append(EffortRow(index, -math.inf, 0.0, self._speed(high - float(q[index]), q[index] <= high)))
        return rows

    def _speed(self, distance: float, inside: bool) -> float:
        return distance / self.time_step if inside else RETURN * distance / self.time_step

    def solve(self, rows: Sequence[EffortRow], v: FloatArray, gain: FloatArray) -> FloatArray:
        """Return the efforts of all rows together, shape (nu,) [N m or N].

        Args:
            rows: rows that may act.
            v: speeds at the end of the step without them, shape (nu,).
            gain: change of these speeds per effort, shape (nu, nu).
        """
        efforts = [min(max(self._before.get((row.joint, row.low), 0.0), row.low), row.high) for row in rows]
        v = v + sum((e * gain[:, row.joint] for e, row in zip(efforts, rows, strict=True)), np.zeros_like(v))
        for _ in range(_SWEEPS):
            change = 0.0
            for k, row in enumerate(rows):
                response = float(gain[row.joint, row.joint])
                if response <= 0.0:
                    continue  # braked
                new = min(max(efforts[k] + (row.speed - float(v[row.joint])) / response, row.low), row.high)
                v += (new - efforts[k]) * gain[:, row.joint]
                change = max(change, abs(new - efforts[k]))
                efforts[k] = new
            if change <= _TOLERANCE * max(map(abs, efforts), default=0.0):
                break
        self._before = {(row.joint, row.low): e for row, e in zip(rows, efforts, strict=True)}
        self.driven = {row.joint: e for row, e in zip(rows, efforts, strict=True) if row.drive}
        total = np.zeros_like(v)
        for row, effort in zip(rows, efforts, strict=True):
            total[row.joint] += effort
        return total
