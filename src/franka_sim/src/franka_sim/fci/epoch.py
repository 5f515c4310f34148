"""Offset between an emulated arm's time and the time of the run, from its driver's clock pairs."""

from bisect import bisect_right
from collections import deque
from time import monotonic_ns

CYCLES = 2000
"""Number of stored cycles, more than a pair's delay. All values here: project defaults, unconfirmed."""
WINDOW = 1_000_000_000
"""Time window of the pairs [ns]; a driver that was late for longer has another offset."""
SAME = 1e-5
"""Tolerance for equal epochs, so that the rounding of stamps does not change the spacing of cycles [s]."""


def _sent(cycle: tuple[int, float]) -> int:
    return cycle[0]


class Epoch:
    """Time of the run at which the arm's time was 0, from the pairs of clocks on `hric/clock`.

    A driver stamps the states of its arm evenly, and sends with a pair the stamp of its present state: the newest one
    sent while a motion waits for each command, or an earlier one if the driver is late. So the largest epoch in the
    pairs of the last second is exact up to the rounding of stamps, however late they come.

    Args:
        value: epoch until the first pair [s].

    Attributes:
        value: present epoch [s].
    """

    def __init__(self, value: float) -> None:
        self.value = value
        self._cycles: deque[tuple[int, float]] = deque(maxlen=CYCLES)
        self._epochs: deque[tuple[int, float]] = deque()

    def on_cycle(self, time: float) -> None:
        """Register the arm time [s] of the state sent next. In the arm's loop; `on_pair` may use another thread."""
        self._cycles.append((monotonic_ns(), time))

    def on_pair(self, monotonic: int, run: float) -> bool:
        """Add a pair of clocks and return True if the epoch has changed.

        Args:
            monotonic: monotonic clock [ns].
            run: time of the run at that moment [s].
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
