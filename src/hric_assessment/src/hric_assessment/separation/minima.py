"""Separation of an arm and a person over a run, sampled finely around its minima, and times when it is too small.

    found = separation(0.0, 60.0, ends_of_arm, arm.radii, ends_of_person, person.radii)
    found.closest.distance, found.violations(protective_distance(...).total)

Between two instants the separation is not known: a minimum of another pair of capsules may be missed there; the error
is at most half a centimetre for each m/s of approach speed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hric_assessment.separation.capsules import IntArray, segment_distance
from hric_core.errors import HricError
from hric_core.geometry import FloatArray

Ends = Callable[[FloatArray], FloatArray]
"""Function from robot times, shape (n,) [s], to the axis ends of a model's capsules in the world, (n, k, 2, 3) [m]."""
RATE, CLOSE_RATE = 100.0, 1000.0
"""Sampling rates of the run, and around each minimum [Hz] (project defaults)."""
BLOCK = 500
"""Number of instants that are evaluated at once, so that arrays are a few MB large."""
ROUNDING = 1e-9
"""Larger than any rounding error of a distance [m]."""


@dataclass(frozen=True)
class Closest:
    """Minimum of the separation between arm and person.

    Attributes:
        time: robot time of the minimum [s].
        distance: separation [m]; negative if the capsules overlap.
        arm, person: indices of the two nearest capsules.
    """

    time: float
    distance: float
    arm: int
    person: int


@dataclass(frozen=True)
class Violation:
    """Time interval in which the separation is below the protective distance.

    Attributes:
        begin, end: robot time of the interval's first and last instant [s].
        time: robot time of the smallest margin [s].
        margin: separation minus protective distance at that time, below 0 [m].
    """

    begin: float
    end: float
    time: float
    margin: float


@dataclass(frozen=True)
class Separation:
    """Separation between arm and person over a run.

    Attributes:
        time: instants, denser around the minima, shape (n,) [s].
        distance: distance of the nearest capsules, shape (n,) [m].
        arm, person: indices of the nearest capsules, shape (n,).
        minima: all local minima, in order of time.
    """

    time: FloatArray
    distance: FloatArray
    arm: IntArray
    person: IntArray
    minima: tuple[Closest, ...]

    @property
    def closest(self) -> Closest:
        """Smallest separation of the run."""
        return min(self.minima, key=lambda minimum: minimum.distance)

    def violations(self, protective: FloatArray | float) -> list[Violation]:
        """Return the intervals in which the separation is below the protective distance.

        Args:
            protective: protective distance S_p [m], shape (n,), or one value for all instants.
        """
        margin = self.distance - protective
        below = np.flatnonzero(margin < 0.0)
        groups = np.split(below, np.flatnonzero(np.diff(below) > 1) + 1)
        return [self._violation(group, margin) for group in groups if len(group)]

    def _violation(self, group: IntArray, margin: FloatArray) -> Violation:
        worst = group[np.argmin(margin[group])]
        begin, end = self.time[group[0]], self.time[group[-1]]
        return Violation(float(begin), float(end), float(self.time[worst]), float(margin[worst]))


def separation(
    begin: float, end: float, arm: Ends, arm_radii: FloatArray, person: Ends, person_radii: FloatArray
) -> Separation:
    """Return the separation of arm and person over a time interval.

    Args:
        begin: robot time of the interval's begin [s].
        end: robot time of the interval's end [s].
        arm: function from times to the axis ends of the arm's capsules.
        arm_radii: radii of the arm's capsules, shape (k,) [m].
        person: function from times to the axis ends of the person's capsules.
        person_radii: radii of the person's capsules, shape (m,) [m].

    Raises:
        HricError: end is not after begin, or a position is not finite.
    """
    if not end > begin:
        raise HricError(f"the separation is requested from {begin} to {end} s; valid: an end after the begin")
    time = np.linspace(begin, end, int(np.ceil((end - begin) * RATE)) + 1)
    coarse = _nearest(time, arm, arm_radii, person, person_radii)
    around = _around(time, coarse[0])
    close = _nearest(around, arm, arm_radii, person, person_radii)
    times = np.concatenate([time, around])
    order = np.argsort(times, kind="stable")
    distance, first, second = (np.concatenate(pair)[order] for pair in zip(coarse, close, strict=True))
    times = times[order]
    minima = tuple(
        Closest(float(times[k]), float(distance[k]), int(first[k]), int(second[k])) for k in _minima(distance)
    )
    return Separation(times, distance, first.astype(np.int64), second.astype(np.int64), minima)


def _nearest(
    time: FloatArray, arm: Ends, arm_radii: FloatArray, person: Ends, person_radii: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return distance [m], index of the arm's capsule and of the person's capsule at each instant, shape (n,) each."""
    blocks = []
    for start in range(0, len(time), BLOCK):
        block = time[start : start + BLOCK]
        a, b = arm(block), person(block)
        lost = ~(np.isfinite(a).all(axis=(1, 2, 3)) & np.isfinite(b).all(axis=(1, 2, 3)))
        if lost.any():
            at = block[np.flatnonzero(lost)[0]]
            raise HricError(f"a position of arm or person is not finite at {at:.3f} s; valid: finite numbers")
        row, i, j = _candidates(a, arm_radii, b, person_radii)
        apart = np.full((len(block), len(arm_radii) * len(person_radii)), np.inf)
        gap = segment_distance(a[row, i], b[row, j]) - arm_radii[i] - person_radii[j]
        apart[row, i * len(person_radii) + j] = gap
        nearest = np.argmin(apart, axis=1)
        blocks.append((apart[np.arange(len(block)), nearest], *np.divmod(nearest, len(person_radii))))
    if not blocks:
        return np.empty(0), np.empty(0), np.empty(0)
    distance, first, second = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    return distance, first, second


def _candidates(
    a: FloatArray, arm_radii: FloatArray, b: FloatArray, person_radii: FloatArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return instant, capsule of the arm and capsule of the person of each pair that can be the nearest, shape (c,).

    The distance of a pair is at most that of the middles of its capsules, and smaller by at most half of both lengths.

    Args:
        a: axis ends of the arm's capsules, shape (n, k, 2, 3) [m].
        arm_radii: radii of the arm's capsules, shape (k,) [m].
        b: axis ends of the person's capsules, shape (n, m, 2, 3) [m].
        person_radii: radii of the person's capsules, shape (m,) [m].
    """
    middle_a, middle_b = (0.5 * (ends[:, :, 0] + ends[:, :, 1]) for ends in (a, b))
    reach_a, reach_b = (0.5 * np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1) for ends in (a, b))
    square = np.zeros((len(a), a.shape[1], b.shape[1]))
    for axis in range(3):
        square += (middle_a[:, :, None, axis] - middle_b[:, None, :, axis]) ** 2
    highest = np.sqrt(square) - arm_radii[:, None] - person_radii
    lowest = highest - reach_a[:, :, None] - reach_b[:, None]
    row, i, j = np.nonzero(lowest <= highest.min(axis=(1, 2), keepdims=True) + ROUNDING)
    return row, i, j


def _minima(distance: FloatArray) -> IntArray:
    """Return the indices of the local minima, ends included; of equal neighbours the first."""
    padded = np.concatenate([[np.inf], distance, [np.inf]])
    falls = padded[1:-1] < padded[:-2]
    change = np.concatenate([distance[1:] != distance[:-1], [True]])
    # The last of equal neighbours determines whether the distance rises.
    last = np.flatnonzero(change)[np.searchsorted(np.flatnonzero(change), np.arange(len(distance)))]
    return np.flatnonzero(falls & (padded[last + 2] > distance))


def _around(time: FloatArray, distance: FloatArray) -> FloatArray:
    """Return additional instants around each minimum, with rate CLOSE_RATE, shape (k,) [s]."""
    step = time[1] - time[0]
    parts = int(np.ceil(step * CLOSE_RATE))
    offsets = np.arange(-parts + 1, parts) * (step / parts)
    offsets = offsets[offsets != 0.0]
    instants = (time[_minima(distance)][:, None] + offsets).ravel()
    return np.unique(instants[(instants > time[0]) & (instants < time[-1])])
