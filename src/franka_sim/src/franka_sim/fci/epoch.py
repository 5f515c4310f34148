"""Where an emulated arm's own time lies in the time of the run, which its driver gives."""

from bisect import bisect_right
from collections import deque
from time import monotonic_ns

CYCLES = 2000
"""Cycles that are remembered: more than a pair is under way. Project defaults, unconfirmed, all of them."""
WINDOW = 1_000_000_000
"""A driver that was behind for so long has another time by now [ns]."""
SAME = 1e-5
"""Epochs so near are one, but for the rounding of stamps, so that stamps keep the spacing of the cycles [s]."""


def _sent(cycle: tuple[int, float]) -> int:
    return cycle[0]


class Epoch:
    """The time of the run at which an arm's own time was 0, from the pairs of clocks on `hric/clock`.

    A driver stamps the states of its arm evenly, and sends with a pair the stamp of the state that it has then: the
    newest one that was sent, while a motion waits for each command, or an earlier one where the driver is behind. So
    the largest that the pairs of the last second say is right to the rounding of stamps, however late they come.

    Args:
        value: as long as there is no pair [s].

    Attributes:
        value: [s].
    """

    def __init__(self, value: float) -> None:
        self.value = value
        self._cycles: deque[tuple[int, float]] = deque(maxlen=CYCLES)
        self._found: deque[tuple[int, float]] = deque()

    def on_cycle(self, time: float) -> None:
        """A state of this time of the arm [s] is sent next. In the arm's loop; `on_pair` may come from another
        thread."""
        self._cycles.append((monotonic_ns(), time))

    def on_pair(self, monotonic: int, run: float) -> bool:
        """A pair of clocks came; returns whether it changes the value.

        Args:
            monotonic: [ns].
            run: time of the run then [s].
        """
        cycles = list(self._cycles)
        newest = bisect_right(cycles, monotonic, key=_sent)
        if newest == 0:
            return False
        found = self._found
        found.append((monotonic, run - cycles[newest - 1][1]))
        while found[0][0] < monotonic - WINDOW:
            found.popleft()
        value = max(epoch for _, epoch in found)
        if abs(value - self.value) <= SAME:
            return False
        self.value = value
        return True
