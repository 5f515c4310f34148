"""The node `synchronizer`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from hric_control.errors import ParameterError
from hric_control.ros_node import RosNode
from hric_perception.section import Section
from hric_perception.sync.layout import RESAMPLE, Plan, Source, read_plan
from hric_perception.sync.stream import SyncStream
from hric_perception.sync.topics import TOPIC, rate_topic
from mocap_natnet.process import run
from mocap_natnet.run_time import RunTime

PERIOD = 0.02
"""Between looks at what is due [s] (our choice): all instants of a look are computed together, and a look costs half a millisecond or more. The
robot's cycles come in pieces as long."""


class SynchronizerNode:
    """Subscribes to all sources and publishes the samples of all of them, from a thread of its own.

    Several rates cost one subscription to each source, whose messages are the same.

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
        self._period = float(period)
        # Topics of sources are relative to the namespace that the node is in, as those of its subscriptions.
        topics = [node.resolve(_relative(source.topic, node)) for source in plan.sources]
        self._run_time = RunTime(node)
        outputs = outputs_of(plan, topic, read_rates(node.resolve("rates"), node.param("rates", None), plan))
        self._streams = [
            SyncStream(node, one, name, topics, self._run_time, self._period, f" at {one.rate:g} Hz" * (name != topic)) for one, name in outputs
        ]
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, name="synchronizer", daemon=True)
        pairs = enumerate(zip(plan.sources, topics, strict=True))
        self._subscriptions = [node.subscribe(name, source.message, self._hearer(index, source), queue_size=0) for index, (source, name) in pairs]
        self._thread.start()
        node.log_info(f"{plan.policy} of {', '.join(topics)} on {', '.join(node.resolve(name) for _, name in outputs)}")

    def close(self) -> None:
        """End."""
        for one in self._subscriptions:
            one.unregister()
        self._stop.set()
        self._thread.join(2.0)
        self._run_time.close()

    def _hearer(self, index: int, source: Source) -> Callable[[Any], None]:
        streams, chunked = self._streams, source.message._type == "hric_msgs/SampleChunk"

        def hear(message: Any) -> None:
            arrived = time.monotonic()
            for stream in streams:
                if chunked:
                    stream.see_units(source, message)
                stream.synchroniser.push_message(index, message, arrived)

        return hear

    def _work(self) -> None:
        look = time.monotonic()
        while not self._stop.wait(max(look - time.monotonic(), 0.0)):
            now = time.monotonic()
            look = max(look + self._period, now)
            for stream in self._streams:
                stream.work(now)


def read_rates(where: str, content: Any, plan: Plan) -> list[float]:
    """Several rates of one plan; empty: the plan's own alone.

    Args:
        where: full name of the parameter, for messages.
        content: None, or a list of rates [Hz].
        plan: whose policy must be resample.

    Raises:
        ParameterError: not a list of different rates, or another policy.
    """
    if content is None:
        return []
    if plan.policy != RESAMPLE:
        raise ParameterError(f"{where} is given, but the reference of policy {plan.policy} is a topic; valid: policy {RESAMPLE}")
    section = Section(where, {str(index): value for index, value in enumerate(content)} if isinstance(content, list | tuple) else {})
    rates = [section.number(name, 0.0, 0.0, 10_000.0, above=True) for name in section.content]
    if not rates or len(set(rates)) != len(rates):
        raise ParameterError(f"{where} is {content!r}; valid: a list of different rates above 0 [Hz]")
    return rates


def outputs_of(plan: Plan, topic: str, rates: Sequence[float]) -> list[tuple[Plan, str]]:
    """(plan, topic) of each stream: one on the topic itself, or one per rate on `<topic>_<rate>hz`."""
    if not rates:
        return [(plan, topic)]
    return [(replace(plan, rate=rate), rate_topic(topic, rate)) for rate in rates]


def _relative(topic: str, node: RosNode) -> str:
    """A topic of a source: relative to the namespace that the node is in, not to its private one."""
    return topic if topic.startswith("/") else f"{node.namespace.rsplit('/', 1)[0]}/{topic}"


def main(text: str) -> int:
    """Run the node; text: for --help. Returns the exit code."""

    def make(node: RosNode) -> tuple[Callable[[], None], Callable[[], None]]:
        return (lambda: None), SynchronizerNode(node).close

    return run("synchronizer", text, make)
