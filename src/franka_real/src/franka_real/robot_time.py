"""Robot time of a robot that brings its own clock, and the ROS time of its states."""

import math
import time as wall
from collections.abc import Iterable
from typing import Any

WINDOW = 100
"""States over which the minimum delay is taken."""
LATE = 0.01
"""Minimum delay of a window above which the two clocks count as apart [s]; project default, unconfirmed, as below."""
EARLY = 0.002
"""How far the arm's time may be ahead of this machine's [s]."""


class RobotTime:
    """Counts from the first state that the loop sees, in the arm's own milliseconds, and never goes back.

    ROS stamps follow it: the ROS time of the first state, plus robot time. So stamps are those of the measurement,
    without the jitter of this machine. Where the two clocks drift apart (an emulated arm that is slower than real time,
    hours of a real one), stamps are brought back to this machine's clock by the minimum delay of a window, since a
    state can only be late; they never go back.

    Args:
        nodes: whose `now()` returns that time; nodes derived from them follow.

    Attributes:
        now: robot time of the last state [s].
        epoch: ROS time at which robot time was 0, as of now [s].
    """

    def __init__(self, nodes: Iterable[Any]) -> None:
        self._nodes = list(nodes)
        self._first: int | None = None
        self._last = 0
        self.now = self.epoch = 0.0
        self._follows_wall = False
        self._left, self._min_delay = WINDOW, math.inf
        self._stamp = 0.0

    def advance(self, milliseconds: int) -> float:
        """A state came; returns the time since the one before, 0 if it is not newer [s].

        Args:
            milliseconds: the arm's time of it.
        """
        if self._first is None:
            self._begin(milliseconds)
            return 1e-3
        passed = milliseconds - self._last
        if passed <= 0:
            return 0.0
        self._last = milliseconds
        self.now = (milliseconds - self._first) * 0.001
        if self._follows_wall:
            self._compare(wall.time() - self.epoch - self.now)
        return passed * 0.001

    def _begin(self, milliseconds: int) -> None:
        self._first = self._last = milliseconds
        node = self._nodes[0]
        self.epoch = node.now().to_sec()
        # A LocalNode has no time but robot time, and under /use_sim_time another clock rules.
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
        """ROS time of the last state [s]."""
        self._stamp = max(self._stamp, self.epoch + self.now)
        return self._stamp
