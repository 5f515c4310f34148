"""One stream of synchronised samples: its core, its topics and how it fares."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import cycle, islice
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from hric_control.ros_node import RosNode
from hric_msgs.msg import SyncedSample, SyncLayout, SyncStatus
from hric_perception.sync import messages
from hric_perception.sync.core import Synchroniser
from hric_perception.sync.layout import Plan, Source
from mocap_natnet.run_time import RunTime

QUEUE = 200
"""Looks whose samples wait for a listener that is slow: 4 s (our choice)."""
BURST, LEAST_BURST = 2.0, 20
"""At most so many times the samples of the time between two looks go out at once, and so many at least: listeners with a short queue, such as rosbag
record with its 100 messages, lose nothing when a backlog is worked off (our choice)."""
STATUS_PERIOD = 0.2
"""[s]; a source that starves is told after its time-out and this at most."""
STATUSES = 5
"""Diagnostics come with every fifth status (1 Hz, REP 107), and when a source begins or ends to starve."""


class SyncStream:
    """Messages are pushed into `synchroniser` from any threads; `work` is called by one.

    Args:
        node: private node.
        plan: what, and how.
        topic: of the samples; `_layout` and `_status` are added for the others.
        topics: full names of the sources' topics.
        run_time: whether the run stands.
        period: between calls of `work` [s].
        label: of the stream where the node has several, for diagnostics.
    """

    def __init__(self, node: RosNode, plan: Plan, topic: str, topics: list[str], run_time: RunTime, period: float, label: str = "") -> None:
        self._node, self._plan, self._topics, self._run_time = node, plan, topics, run_time
        self.synchroniser, self._units = Synchroniser(plan, time.monotonic()), messages.Units(plan)
        self._samples = node.advertise(topic, SyncedSample, queue_size=QUEUE)
        self._layouts = node.advertise(f"{topic}_layout", SyncLayout, latch=True)
        self._statuses = node.advertise(f"{topic}_status", SyncStatus)
        self._diagnostics = node.advertise("/diagnostics", DiagnosticArray)
        self._name = f"{node.namespace.strip('/')}: sources{label}"
        self._layouts.publish(messages.layout(plan, self._units, topics))
        self._burst = max(LEAST_BURST, round(BURST * plan.rate * period))
        self._blanks = cycle([SyncedSample() for _ in range(self._burst)])
        self._waiting: Iterator[Any] = iter(())
        self._before: Any = None
        self._told, self._count, self._status = "", 0, time.monotonic()

    def see_units(self, source: Source, message: Any) -> None:
        """A SampleChunk of a source: it may tell units that were not known."""
        if self._units.see(source, message):
            self._layouts.publish(messages.layout(self._plan, self._units, self._topics))

    def work(self, now: float) -> None:
        """Publish what is due, by the monotonic clock [s]."""
        due: list[Any] = []
        while True:
            due += islice(self._waiting, self._burst - len(due))
            if len(due) == self._burst or (batch := self.synchroniser.take(now)) is None:
                break
            self._waiting = messages.samples(batch, self._blanks)
        self._samples.publish_all(due)
        if now >= self._status:
            self._status = now + STATUS_PERIOD
            self._report(now)

    def _report(self, now: float) -> None:
        found = messages.status(self.synchroniser, now, self._topics)
        self._statuses.publish(found)
        starving = "; ".join(f"{topic}: {reason.split(' for ')[0]}" for topic, reason in zip(found.sources, found.reasons, strict=True) if reason)
        if starving == self._told and self._count % STATUSES:
            self._count += 1
            return
        state = messages.diagnostics(found, self.synchroniser, self._before, self._run_time.standing)
        if starving != self._told:
            self._tell(state, starving)
        self._count, self._before = 1, found
        state.name, state.hardware_id = self._name, ""
        message = DiagnosticArray(status=[state])
        message.header.stamp = self._node.now()
        self._diagnostics.publish(message)

    def _tell(self, state: Any, starving: str) -> None:
        if state.level == DiagnosticStatus.ERROR:
            self._node.log_error(state.message)
        elif not starving:
            self._node.log_info("all sources are heard")
        self._told = starving
