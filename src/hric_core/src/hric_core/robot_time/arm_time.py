"""Time of an arm that has its own clock: robot time, and the ROS time stamps of its states."""

import math
import time as wall
from collections.abc import Iterable
from typing import Any

WINDOW = 100
"""Number of states over which the minimum delay of the states is determined."""
LATE = 0.01
"""Minimum delay in a window above which the time stamps are corrected [s]; project default, unconfirmed."""
EARLY = 0.002
"""Time by which stamps may be ahead of this machine's clock [s]; beyond it they are corrected. Unconfirmed default."""


class ArmTime:
    """Robot time, which counts the arm's own milliseconds from the first state of the loop, and the ROS stamps from it.

    The ROS stamp of a state is the ROS time of the first state plus robot time. So it is the time of measurement,
    without the jitter of this machine. If the arm's and this machine's clock drift apart (an emulated arm slower than
    real time, hours of a real one), stamps are corrected by the minimum delay of the states in a window, since states
    can arrive late but never early. Stamps never go back.

    Args:
        nodes: nodes whose `now()`, and that of their child nodes, is to return the stamp of the last state.
        period: duration of the cycle of the first state [s].

    Attributes:
        time: robot time of the last state [s].
        epoch: present estimate of the ROS time at which robot time was 0 [s].
    """

    def __init__(self, nodes: Iterable[Any], period: float = 1e-3) -> None:
        self._nodes, self._period = list(nodes), period
        self._first: int | None = None
        self._last = 0
        self.time = self.epoch = 0.0
        self._follows_wall = False
        self._left, self._min_delay = WINDOW, math.inf
        self._stamp = 0.0

    def advance(self, milliseconds: int) -> float:
        """Advance robot time to a new state; return the time since the previous one [s], 0 if the state is not newer.

        Args:
            milliseconds: time of the state on the arm's clock [ms].
        """
        if self._first is None:
            self._begin(milliseconds)
            return self._period
        passed = milliseconds - self._last
        if passed <= 0:
            return 0.0
        self._last = milliseconds
        self.time = (milliseconds - self._first) * 0.001
        if self._follows_wall:
            self._compare(wall.time() - self.epoch - self.time)
        return passed * 0.001

    def _begin(self, milliseconds: int) -> None:
        self._first = self._last = milliseconds
        node = self._nodes[0]
        self.epoch = node.now().to_sec()
        # A LocalNode has robot time only, and under /use_sim_time another clock is used.
        self._follows_wall = abs(self.epoch - wall.time()) < 1.0
        for node in self._nodes:
            node.clock = self.stamp

    def _compare(self, delay: float) -> None:
        if delay < self._min_delay:
            self._min_delay = delay
        self._left -= 1
        if self._left > 0 and self._min_delay > -EARLY:
            return
        if not -EARLY <= self._min_delay <= LATE:
            self.epoch += self._min_delay
        self._left, self._min_delay = WINDOW, math.inf

    def stamp(self) -> float:
        """Return the ROS time stamp of the last state [s]."""
        self._stamp = max(self._stamp, self.epoch + self.time)
        return self._stamp
