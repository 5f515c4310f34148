"""Tells drivers and emulators beside the robot what time of the run it is: pairs of the machine's monotonic clock and run time on /hric/clock."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic_ns
from typing import Any

from hric_control import realtime
from hric_control.node import Node
from hric_msgs.msg import ClockPair

TOPIC = "/hric/clock"
"""Absolute: one clock per run."""
PERIOD = 20_000_000
"""Between pairs, of wall time [ns]."""


class ClockPairs:
    """Publishes pairs from the control loop, one in 20 ms of wall time.

    Args:
        node: where to advertise.
        stamp: run time [s] -> what the stamps of the run tell then (genpy.Time).
        factor: run time per wall time that is asked for, 0 where the run is not paced.
    """

    __slots__ = ("_due", "_factor", "_publisher", "_stamp")

    def __init__(self, node: Node, stamp: Callable[[float], Any], factor: Callable[[], float]) -> None:
        self._stamp, self._factor, self._due = stamp, factor, 0
        self._publisher = realtime.publisher(node, TOPIC, ClockPair, newest_only=True)

    def tell(self, time: float) -> None:
        """Publish a pair if one is due; never blocks. Also while run time stands, so that everybody knows that it does.

        Args:
            time: run time now [s].
        """
        now = monotonic_ns()
        if now >= self._due:
            # On a grid, so that cycles of 1 ms give a pair in 20 ms, not in 21.
            self._due = max(self._due + PERIOD, now + PERIOD // 2)
            self._publisher.publish(ClockPair, now, self._stamp(time), self._factor())
