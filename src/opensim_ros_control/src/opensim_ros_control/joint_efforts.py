"""Bounded efforts that bring joints to a target speed in one step: Coulomb friction, joint stops, and drives.

Each is described by a row: joint i, effort e_i within [low, high], target speed w. Given the speeds at the end of the
step without these efforts, and the response of the speeds to efforts, each e_i is chosen so that the joint reaches its
target speed, or so that e_i is at the bound that prevents it (projected Gauss-Seidel). The efforts are constant over
the step, as commands are. So friction holds exactly up to its value, and a stop is rigid and absorbs the joint's energy
for any time step and inertia. A stop limits the speed so that the joint just reaches it at the end of the step; a joint
beyond a stop returns by a fifth of the distance in each step.
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
"""Distance to a stop, in addition to the travel in two steps, within which the stop is considered [rad or m].

Project default, unconfirmed.
"""
_SWEEPS = 50
_TOLERANCE = 1e-12
"""Relative change of the efforts at which the iteration ends [1]."""


@dataclass(frozen=True)
class EffortRow:
    """Bounded effort of one joint that brings it to a target speed.

    Attributes:
        joint: index of the coordinate.
        low, high: bounds of the effort [N m or N].
        speed: target speed at the end of the step [rad/s or m/s].
        drive: True for a velocity or position drive, whose effort is reported.
    """

    joint: int
    low: float
    high: float
    speed: float
    drive: bool = False


@dataclass
class JointEfforts:
    """Bounded joint efforts of one robot: Coulomb friction, joint stops, and drives.

    Joints are identified by the indices of their coordinates in OpenSim's order.

    Args:
        coulomb: Coulomb friction by joint [N m or N]; joints without friction are left out.
        stops: joint ranges in the order of `stop_joints`, and the stops that are inactive because the joint started
            beyond them.
        stop_joints: indices of the joints in the order of `stops`.
        time_step: duration of a step [s].

    Attributes:
        drives: rows of velocity and position drives for the coming step.
        active: True if any bounded effort may act in the coming step.
        driven: effort of each drive in the last step, by joint [N m or N].
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
        """Clear the previous efforts and the distances to stops, after the state was set from outside."""
        self._before.clear()
        self._clearance = self._fastest = 0.0

    @property
    def always(self) -> bool:
        """True if a bounded effort acts in every step: there is Coulomb friction or a drive."""
        return bool(self.coulomb or self.drives)

    def near_stop(self, q: Sequence[float], u: Sequence[float]) -> bool:
        """Return True if a joint stop could act in the coming step.

        Distances to the stops are computed again only after enough travel.

        Args:
            q: positions of all coordinates [rad or m].
            u: speeds of all coordinates [rad/s or m/s].
        """
        fastest = max(max(u), -min(u)) * self.time_step
        self._clearance -= max(fastest, self._fastest)
        self._fastest = fastest
        if self._clearance > fastest:
            return False
        gaps = [min(q[index] - low, high - q[index]) for index, low, high in self._ranges]
        self._clearance = min(gaps, default=math.inf) - NEAR
        return self._clearance <= 2.0 * fastest

    def rows(self, q: FloatArray, v: FloatArray) -> list[EffortRow]:
        """Return the rows that may act in a step.

        Args:
            q: positions of all coordinates at the start of the step [rad or m].
            v: speeds at the end of the step without these efforts [rad/s or m/s].
        """
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
        """Return the sum of the efforts of all rows, shape (nu,) [N m or N].

        Args:
            rows: rows that may act.
            v: speeds at the end of the step without these efforts, shape (nu,).
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
