"""Minimum-jerk interpolation between points over time, for motions of joints and of a walking person."""

from bisect import bisect_right
from collections.abc import Sequence

from hric_core.geometry import minimum_jerk


class RestToRest:
    """Minimum-jerk interpolation of rows of numbers: at rest at each given time, constant before and after.

    Args:
        times: increasing times [s].
        rows: values at each time, n floats.
    """

    def __init__(self, times: Sequence[float], rows: Sequence[Sequence[float]]) -> None:
        self._times, self._rows, self._still = list(times), [list(row) for row in rows], [0.0] * len(rows[0])

    def at(self, time: float) -> tuple[list[float], list[float]]:
        """Return the values and their rates at a time [s], n floats each."""
        start, step, u, duration = self._piece(time)
        share, rate = minimum_jerk(u), 30.0 * (u - u * u) ** 2 / duration
        return [a + share * x for a, x in zip(start, step, strict=True)], [rate * x for x in step]

    def bend(self, time: float) -> list[float]:
        """Return the second derivatives at a time [s], n floats."""
        _, step, u, duration = self._piece(time)
        bend = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / duration**2
        return [bend * x for x in step]

    def _piece(self, time: float) -> tuple[list[float], list[float], float, float]:
        """Return start values, their change, elapsed share and duration [s] of the interval that contains a time."""
        after = bisect_right(self._times, time)
        if after in (0, len(self._times)):
            return self._rows[max(after - 1, 0)], self._still, 0.0, 1.0
        begin, duration = self._times[after - 1], self._times[after] - self._times[after - 1]
        step = [b - a for a, b in zip(self._rows[after - 1], self._rows[after], strict=True)]
        return self._rows[after - 1], step, (time - begin) / duration, duration
