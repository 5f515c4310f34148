"""Progress reports, which let a paced simulation wait for processes that must process all of its data.

Emulated devices, sensor drivers and the recorder report up to which robot time they are done. The simulation does not
run ahead of the slowest of them by more than `AHEAD`."""

import time
from typing import Any

from std_msgs.msg import Header

from hric_core.node import Node
from hric_core.robot_time import stamps
from hric_core.robot_time.schedule import NS

TOPIC = "hric/progress"
"""Topic of progress reports in the robot's namespace: std_msgs/Header.

`frame_id` is the name of the reporting node, `stamp` the robot time up to which its work is done; 0: it is finished."""
PERIOD = NS // 20
"""Time between two reports of one node [ns of wall time].

Project default, unconfirmed, as are all constants of this file."""
AHEAD = 0.2
"""Largest lead of the simulation over the slowest reporting node [s of robot time]."""
SILENT = 2 * NS
"""Time without a report after which the simulation no longer waits for a node [ns of wall time]."""


class ProgressReport:
    """Publisher of a node's progress reports. To be called from one thread.

    Args:
        node: private node, whose name identifies the reports.
    """

    def __init__(self, node: Node) -> None:
        self._source = node.namespace
        self._publisher = node.advertise(node.beside(TOPIC), Header, queue_size=10)
        self._due = 0

    def reached(self, run: float | None) -> None:
        """Publish the progress if the last report was at least `PERIOD` ago.

        Args:
            run: robot time up to which the work is done [s]; None: not known, nothing is published.
        """
        now = time.monotonic_ns()
        if run is None or now < self._due:
            return
        self._due = now + PERIOD
        self._publisher.publish(Header(stamp=stamps.to_time(max(run, 1e-9)), frame_id=self._source))

    def close(self) -> None:
        """Report that the simulation need not wait for this node any more."""
        self._publisher.publish(Header(frame_id=self._source))
        self._publisher.unregister()


class Gate:
    """Limit for the simulation's robot time, computed from the progress reports.

    Args:
        node: node of the robot.

    Attributes:
        held: time for which the simulation has waited for each reporting node [s of wall time].
    """

    def __init__(self, node: Node) -> None:
        self._reached: dict[str, tuple[float, int]] = {}
        self._last = 0
        self.held: dict[str, float] = {}
        self._subscription = node.subscribe(TOPIC, Header, self._on_progress, queue_size=0)

    def close(self) -> None:
        """Unsubscribe from the progress reports."""
        self._subscription.unregister()

    def limit(self, desired: float) -> float:
        """Return the robot time up to which the simulation may advance [s]; called in the loop, never blocks.

        Args:
            desired: robot time up to which the simulation would advance without a limit [s].
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
        """Return the names of the nodes that have not reported for `SILENT`."""
        now = time.monotonic_ns()
        return [source for source, (_, at) in list(self._reached.items()) if now - at >= SILENT]

    def _on_progress(self, message: Any) -> None:
        if message.stamp:
            self._reached[message.frame_id] = (message.stamp.to_sec(), time.monotonic_ns())
        else:
            self._reached.pop(message.frame_id, None)
