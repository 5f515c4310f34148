"""Schedule of robot time, which a simulated robot announces in advance.

All processes that know its knots map the same monotonic time to the same robot time, however busy the machine is."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence

NS = 1_000_000_000
MEMORY = 1024
"""Number of stored knots: those of 20 s, if 50 a second are announced (project default, unconfirmed)."""


class Schedule:
    """Piecewise linear map between knots (monotonic time, robot time), neither of which goes back.

    Args:
        monotonic: monotonic time of the first knot [ns].
        run: robot time of the first knot [s].
    """

    def __init__(self, monotonic: int, run: float) -> None:
        self._at: list[int] = [monotonic]
        self._run: list[float] = [run]

    @property
    def end(self) -> tuple[int, float]:
        """Last announced knot: (monotonic time [ns], robot time [s])."""
        return self._at[-1], self._run[-1]

    @property
    def rises(self) -> bool:
        """True if robot time increases between the last two knots; False in a pause."""
        return len(self._run) > 1 and self._run[-1] > self._run[-2]

    def add(self, monotonic: int, run: float) -> None:
        """Append a knot; one that goes back in monotonic or robot time is ignored."""
        if monotonic <= self._at[-1] or run < self._run[-1]:
            return
        self._at.append(monotonic)
        self._run.append(run)
        if len(self._at) > 2 * MEMORY:
            del self._at[:MEMORY], self._run[:MEMORY]

    def robot_time(self, monotonic: int) -> float:
        """Return the robot time [s] at a monotonic time [ns]; outside the schedule, that of the nearest knot."""
        k = bisect_right(self._at, monotonic)
        if k == len(self._at):
            return self._run[-1]
        return self._run[0] if k == 0 else self._piece(k, self._at, self._run, monotonic)

    def monotonic(self, run: float) -> int | None:
        """Return the first monotonic time [ns] with a robot time [s]; None if that is not announced yet."""
        k = bisect_left(self._run, run)
        if k == 0:
            return self._at[0] - round((self._run[0] - run) * NS)
        return None if k == len(self._run) else round(self._piece(k, self._run, self._at, run))

    @staticmethod
    def _piece(k: int, x: Sequence[float], y: Sequence[float], value: float) -> float:
        """Return y at x = value on the line piece that ends at knot k."""
        return y[k - 1] + (value - x[k - 1]) / (x[k] - x[k - 1]) * (y[k] - y[k - 1])
