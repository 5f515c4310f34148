"""Progress reports, by which a paced run waits for participants that must process all of it.

Emulated devices, sensor drivers and the recorder report how far they have got, and the robot's clock stays close to
them."""

import time
from typing import Any

from std_msgs.msg import Header

from hric_core.node import Node
from hric_core.robot_time import stamps
from hric_core.robot_time.schedule import NS

TOPIC = "hric/progress"
"""Topic in the robot's namespace, next to `hric/clock`: std_msgs/Header with the name of the source as `frame_id`.

`stamp` is the robot time up to which its work is done; 0: it has finished."""
PERIOD = NS // 20
"""Time between messages of one source [ns of wall time]. All constants here are project defaults, unconfirmed."""
AHEAD = 0.2
"""Largest lead of the run over the slowest source [s of robot time]."""
SILENT = 2 * NS
"""Time without a report after which the run no longer waits for a source [ns of wall time]."""


class ProgressReport:
    """Reporter of a source's progress. One thread calls it.

    Args:
        node: private node of the source, whose name is the source's.
    """

    def __init__(self, node: Node) -> None:
        self._source = node.namespace
        self._publisher = node.advertise(node.beside(TOPIC), Header, queue_size=10)
        self._due = 0

    def reached(self, run: float | None) -> None:
        """Publish the progress if the last message is long enough ago.

        Args:
            run: robot time up to which the work is done [s]; None: not known, nothing is published.
        """
        now = time.monotonic_ns()
        if run is None or now < self._due:
            return
        self._due = now + PERIOD
        self._publisher.publish(Header(stamp=stamps.to_time(max(run, 1e-9)), frame_id=self._source))

    def close(self) -> None:
        """Report that the run need not wait for this source any more."""
        self._publisher.publish(Header(frame_id=self._source))
        self._publisher.unregister()


class Gate:
    """Limit of the run's robot time, from the progress reports.

    Args:
        node: node of the robot.

    Attributes:
        held: time for which the run has waited, by source [s of wall time].
    """

    def __init__(self, node: Node) -> None:
        self._reached: dict[str, tuple[float, int]] = {}
        self._last = 0
        self.held: dict[str, float] = {}
        self._subscription = node.subscribe(TOPIC, Header, self._on_progress, queue_size=0)

    def close(self) -> None:
        """Unsubscribe."""
        self._subscription.unregister()

    def limit(self, desired: float) -> float:
        """Return the robot time up to which the run may go [s]; called in the loop, never blocks.

        Args:
            desired: robot time up to which it would go [s].
        """
        now = time.monotonic_ns()
        passed, self._last = min(now - self._last, SILENT) / NS, now
        slowest, name = desired, ""
        for source, (reached, at) in list(self._reached.items()):
            if now - at < SILENT and reached + AHEAD < slowest:
                slowest, name = reached + AHEAD, source
        if name:
            self.held[name] = self.held.get(name, 0.0) + passed
        return slowest

    def silent(self) -> list[str]:
        """Return the names of the sources without a report for `SILENT`."""
        now = time.monotonic_ns()
        return [source for source, (_, at) in list(self._reached.items()) if now - at >= SILENT]

    def _on_progress(self, message: Any) -> None:
        if message.stamp:
            self._reached[message.frame_id] = (message.stamp.to_sec(), time.monotonic_ns())
        else:
            self._reached.pop(message.frame_id, None)
