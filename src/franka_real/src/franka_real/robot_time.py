"""Robot time of a robot with its own clock, and the ROS time of its states."""

import math
import time as wall
from collections.abc import Iterable
from typing import Any

WINDOW = 100
"""Number of states over which the minimum delay is taken."""
LATE = 0.01
"""Minimum delay in a window above which the clocks have drifted apart [s]; project default, unconfirmed."""
EARLY = 0.002
"""Maximum lead of the arm's time over this machine's [s]; project default, unconfirmed."""


class ArmTime:
    """Clock that counts from the first state of the loop, in the arm's own milliseconds, and never goes back.

    ROS stamps are the ROS time of the first state plus robot time. So they are those of the measurement, without the
    jitter of this machine. If the two clocks drift apart (an emulated arm slower than real time, hours of a real one),
    stamps are corrected to this machine's clock by the minimum delay in a window, since a state can only be late; they
    never go back.

    Args:
        nodes: nodes whose `now()` returns that time, also in nodes derived from them.

    Attributes:
        now: robot time of the last state [s].
        epoch: present estimate of the ROS time at which robot time was 0 [s].
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
        """Take the time of a new state and return the time since the previous one, 0 if it is not newer [s].

        Args:
            milliseconds: the arm's time of the state.
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
        """Return the ROS time of the last state [s]."""
        self._stamp = max(self._stamp, self.epoch + self.now)
        return self._stamp
