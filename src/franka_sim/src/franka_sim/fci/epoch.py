"""Offset between an emulated arm's own time and the time of the ROS run, from the clock pairs of the arm's driver.

The driver is the robot node that is connected to the emulated control box as its client.
"""

from bisect import bisect_right
from collections import deque
from time import monotonic_ns

CYCLES = 2000
"""Number of stored cycles, longer than the delay of a clock pair. Project default, unconfirmed, as are the others."""
WINDOW = 1_000_000_000
"""Time over which clock pairs are evaluated [ns]; a driver that is late for longer changes the offset."""
SAME = 1e-5
"""Maximum change of the offset that is ignored [s], so that the rounding of stamps does not shift the cycles."""


def _sent(cycle: tuple[int, float]) -> int:
    return cycle[0]


class Epoch:
    """Epoch of the emulated arm: the time of the run at which the arm's own time was 0.

    It is estimated from the clock pairs (monotonic clock, time of the run) that the driver publishes on `hric/clock`.
    Each pair has the stamp of the driver's present state: the newest one sent, or an earlier one if the driver is
    late. So the largest estimate of the last second is exact up to the rounding of stamps.

    Args:
        value: epoch until the first clock pair [s].

    Attributes:
        value: present epoch [s].
    """

    def __init__(self, value: float) -> None:
        self.value = value
        self._cycles: deque[tuple[int, float]] = deque(maxlen=CYCLES)
        self._epochs: deque[tuple[int, float]] = deque()

    def on_cycle(self, time: float) -> None:
        """Store the robot time of the next sent state [s]. To be called in the arm's loop, `on_pair` in any thread."""
        self._cycles.append((monotonic_ns(), time))

    def on_pair(self, monotonic: int, run: float) -> bool:
        """Add a clock pair and return True if the epoch has changed.

        Args:
            monotonic: monotonic clock of the machine [ns].
            run: time of the run at the same instant [s].
        """
        cycles = list(self._cycles)
        newest = bisect_right(cycles, monotonic, key=_sent)
        if newest == 0:
            return False
        epochs = self._epochs
        epochs.append((monotonic, run - cycles[newest - 1][1]))
        while epochs[0][0] < monotonic - WINDOW:
            epochs.popleft()
        value = max(epoch for _, epoch in epochs)
        if abs(value - self.value) <= SAME:
            return False
        self.value = value
        return True
