"""Commands that came and commands that did not."""

from __future__ import annotations


class PacketCount:
    """Counts lost packets in a row and the share of cycles with a command; counting begins with the first command of a motion.

    Args:
        window: cycles over which the share is taken.

    Attributes:
        started: whether the motion's first command has come.
        lost_in_a_row: packets lost since the last command.
        success_rate: share of the last `window` cycles (of those so far, while there are fewer) that had a command, 0 to 1; 0 before the first.
    """

    def __init__(self, window: int) -> None:
        self._window, self._mask = window, (1 << window) - 1
        self.reset()

    def reset(self) -> None:
        """A motion begins or ended."""
        self.started, self.lost_in_a_row, self.success_rate = False, 0, 0.0
        self._history, self._seen, self._all = 0, 0, False

    def accept(self) -> None:
        """A command came in time."""
        self.started, self.lost_in_a_row = True, 0
        if not self._all:
            self._count(1)

    def lose(self) -> None:
        """No command came."""
        if self.started:
            self.lost_in_a_row += 1
            self._count(0)

    def _count(self, bit: int) -> None:
        self._history = (self._history << 1 | bit) & self._mask
        self._seen = min(self._seen + 1, self._window)
        good = self._history.bit_count()
        self.success_rate = good / self._seen
        self._all = good == self._window
