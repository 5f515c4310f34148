"""The node `synchronizer`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from hric_control.errors import ParameterError
from hric_control.ros_node import RosNode
from hric_msgs.msg import SyncedSample, SyncLayout, SyncStatus
from hric_perception.sync import messages
from hric_perception.sync.core import Synchroniser
from hric_perception.sync.layout import Source, read_plan
from mocap_natnet.process import run
from mocap_natnet.run_time import RunTime

TOPIC = "/hric/perception/sync"
PERIOD = 0.02
"""Between looks at what is due [s] (our choice): all instants of a look are computed together, and a look costs half a millisecond or more. The
robot's cycles come in pieces as long."""
QUEUE = 4000
"""Samples that wait for a listener that is slow: 4 s at 1 kHz (our choice)."""
STATUS_PERIOD = 0.2
"""[s]; a source that starves is told after its time-out and this at most."""
STATUSES = 5
"""Diagnostics come with every fifth status (1 Hz, REP 107), and when a source begins or ends to starve."""


class SynchronizerNode:
    """Subscribes to all sources and publishes the samples of all of them, from a thread of its own.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: RosNode) -> None:
        plan, topic = read_plan(node.resolve("plan"), node.param("plan")), str(node.param("topic", TOPIC))
        period = node.param("period", PERIOD)
        if not isinstance(period, int | float) or isinstance(period, bool) or not 0.0 < period <= 1.0:
            raise ParameterError(f"{node.resolve('period')} is {period!r}; valid: a number above 0 to 1 s")
        self._node, self._plan, self._period = node, plan, float(period)
        # Topics of sources are relative to the namespace that the node is in, as those of its subscriptions.
        self._topics = [node.resolve(_relative(source.topic, node)) for source in plan.sources]
        self._synchroniser, self._units = Synchroniser(plan, time.monotonic()), messages.Units(plan)
        self._samples = node.advertise(topic, SyncedSample, queue_size=QUEUE)
        self._layouts = node.advertise(f"{topic}_layout", SyncLayout, latch=True)
        self._statuses = node.advertise(f"{topic}_status", SyncStatus)
        self._diagnostics = node.advertise("/diagnostics", DiagnosticArray)
        self._layouts.publish(messages.layout(plan, self._units, self._topics))
        self._run_time = RunTime(node)
        self._before: Any = None
        self._told, self._count = "", 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, name="synchronizer", daemon=True)
        pairs = enumerate(zip(plan.sources, self._topics, strict=True))
        self._subscriptions = [node.subscribe(name, source.message, self._hearer(index, source), queue_size=0) for index, (source, name) in pairs]
        self._thread.start()
        node.log_info(f"{plan.policy} of {', '.join(self._topics)} on {node.resolve(topic)}")

    def close(self) -> None:
        """End."""
        for one in self._subscriptions:
            one.unregister()
        self._stop.set()
        self._thread.join(2.0)
        self._run_time.close()

    def _hearer(self, index: int, source: Source) -> Callable[[Any], None]:
        push, units = self._synchroniser.push_message, self._units

        def hear(message: Any) -> None:
            push(index, message, time.monotonic())

        def hear_chunk(message: Any) -> None:
            if units.see(source, message):
                self._layouts.publish(messages.layout(self._plan, units, self._topics))
            push(index, message, time.monotonic())

        return hear_chunk if source.message._type == "hric_msgs/SampleChunk" else hear

    def _work(self) -> None:
        look = status = time.monotonic()
        while not self._stop.wait(max(look - time.monotonic(), 0.0)):
            now = time.monotonic()
            look = max(look + self._period, now)
            while (batch := self._synchroniser.take(now)) is not None:
                for message in messages.samples(batch):
                    self._samples.publish(message)
            if now >= status:
                status = now + STATUS_PERIOD
                self._report(now)

    def _report(self, now: float) -> None:
        found = messages.status(self._synchroniser, now, self._topics)
        self._statuses.publish(found)
        starving = "; ".join(f"{topic}: {reason.split(' for ')[0]}" for topic, reason in zip(found.sources, found.reasons, strict=True) if reason)
        if starving == self._told and self._count % STATUSES:
            self._count += 1
            return
        state = messages.diagnostics(found, self._synchroniser, self._before, self._run_time.standing)
        if starving != self._told:
            self._tell(state, starving)
        self._count, self._before = 1, found
        state.name, state.hardware_id = f"{self._node.namespace.strip('/')}: sources", ""
        message = DiagnosticArray(status=[state])
        message.header.stamp = self._node.now()
        self._diagnostics.publish(message)

    def _tell(self, state: Any, starving: str) -> None:
        if state.level == DiagnosticStatus.ERROR:
            self._node.log_error(state.message)
        elif not starving:
            self._node.log_info("all sources are heard")
        self._told = starving


def _relative(topic: str, node: RosNode) -> str:
    """A topic of a source: relative to the namespace that the node is in, not to its private one."""
    return topic if topic.startswith("/") else f"{node.namespace.rsplit('/', 1)[0]}/{topic}"


def main(text: str) -> int:
    """Run the node; text: for --help. Returns the exit code."""

    def make(node: RosNode) -> tuple[Callable[[], None], Callable[[], None]]:
        return (lambda: None), SynchronizerNode(node).close

    return run("synchronizer", text, make)
