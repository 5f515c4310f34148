"""Node `synchronizer`: publishes samples of many topics at common instants."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, islice
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from hric_core.errors import ParameterError
from hric_core.parameters import Settings, listing, mapping, number, text
from hric_core.robot_time.follower import RobotTime
from hric_core.ros import RosNode, run
from hric_core.ros.process import NodeApp
from hric_msgs.msg import SyncedSample, SyncLayout, SyncStatus
from hric_perception.sync import messages
from hric_perception.sync.core import Synchroniser
from hric_perception.sync.layout import RESAMPLE, SyncPlan, SyncSource, read_plan
from hric_perception.sync.messages import TOPIC, rate_topic

QUEUE = 200
"""Queue length for a slow subscriber, in work cycles: 4 s of samples (project default, unconfirmed)."""
BURST, MIN_BURST = 2.0, 20
"""Largest number of samples sent at once, relative to one work cycle, and at least MIN_BURST.

Subscribers with a short queue, such as rosbag record with its 100 messages, thus lose nothing when a backlog is sent
(project default, unconfirmed).
"""
STATUS_PERIOD = 0.2
"""Period of the status messages [s]; a starving source is reported at most this after its time-out."""
STATUSES = 5
"""Number of status messages per diagnostics message (1 Hz, REP 107).

Diagnostics are also published when a source begins or ceases to starve.
"""


class SyncStream:
    """Publisher of synchronised samples at one rate; messages come from any threads, `work` is called by one.

    Args:
        node: private node.
        plan: plan of the synchronisation.
        topic: topic of the samples; layout and status are on `<topic>_layout` and `<topic>_status`.
        topics: full names of the sources' topics.
        robot_time: clock of robot time, from which it is known if the run is paused.
        period: time between calls of `work` [s].
        label: name of the stream in diagnostics, if the node has several.
    """

    def __init__(
        self,
        node: RosNode,
        plan: SyncPlan,
        topic: str,
        topics: list[str],
        robot_time: RobotTime,
        period: float,
        label: str = "",
    ) -> None:
        self._node, self._plan, self._topics, self._robot_time = node, plan, topics, robot_time
        self.synchroniser, self._units = Synchroniser(plan, time.monotonic()), messages.Units(plan)
        self._samples = node.advertise(topic, SyncedSample, queue_size=QUEUE)
        self._layouts = node.advertise(f"{topic}_layout", SyncLayout, latch=True)
        self._statuses = node.advertise(f"{topic}_status", SyncStatus)
        self._diagnostics = node.advertise("/diagnostics", DiagnosticArray)
        self._name = f"{node.namespace.strip('/')}: sources{label}"
        self._layouts.publish(messages.layout(plan, self._units, topics))
        self._burst = max(MIN_BURST, round(BURST * plan.rate * period))
        self._blanks = cycle([SyncedSample() for _ in range(self._burst)])
        self._waiting: Iterator[Any] = iter(())
        self._before: Any = None
        self._starving, self._count, self._status = "", 0, time.monotonic()

    def see_units(self, source: SyncSource, message: Any) -> None:
        """Publish the layout again if a SampleChunk of a source has units that were missing in it."""
        if self._units.see(source, message):
            self._layouts.publish(messages.layout(self._plan, self._units, self._topics))

    def work(self, now: float) -> None:
        """Publish the synchronised samples that are due, and the status; now: monotonic time [s]."""
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
        status = messages.status(self.synchroniser, now, self._topics)
        self._statuses.publish(status)
        starving = "; ".join(
            f"{topic}: {reason.split(' for ')[0]}"
            for topic, reason in zip(status.sources, status.reasons, strict=True)
            if reason
        )
        if starving == self._starving and self._count % STATUSES:
            self._count += 1
            return
        state = messages.diagnostics(status, self.synchroniser, self._before, self._robot_time.standing)
        if starving != self._starving:
            self._log(state, starving)
        self._count, self._before = 1, status
        state.name, state.hardware_id = self._name, ""
        message = DiagnosticArray(status=[state])
        message.header.stamp = self._node.now()
        self._diagnostics.publish(message)

    def _log(self, state: Any, starving: str) -> None:
        if state.level == DiagnosticStatus.ERROR:
            self._node.log_error(state.message)
        elif not starving:
            self._node.log_info("all sources of the synchroniser send samples")
        self._starving = starving


PERIOD = 0.02
"""Period of the work cycle [s] (project default, unconfirmed).

All instants of a work cycle are computed together; one costs at least half a millisecond. The robot's control cycles
also arrive in batches of 20 ms.
"""


@dataclass(frozen=True)
class SyncSettings(Settings):
    """Parameters of the node `synchronizer`."""

    plan: Mapping[str, object] = mapping(text='plan of the synchronisation, see "Synchroniser"')
    rates: tuple[float, ...] | None = listing(
        number(above=0.0, maximum=10_000.0),
        range(1, 100),
        None,
        different=True,
        unit="Hz",
        text="several streams of one plan with policy resample, each with its own rate, on `<topic>_<rate>hz`: "
        "one subscription to each source serves all; not of `synchronizer_cpp`",
    )
    topic: str = text(
        TOPIC, empty=False, text="topic of the samples; layout and status are on `<topic>_layout` and `<topic>_status`"
    )
    period: float = number(
        PERIOD,
        above=0.0,
        maximum=1.0,
        unit="s",
        text="period at which due samples are published; not of `synchronizer_cpp`",
    )


class SynchronizerNode(NodeApp):
    """Synchronizer node: subscribes to all sources and publishes synchronised samples from a separate thread.

    Several rates share one subscription to each source.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: RosNode) -> None:
        settings = SyncSettings.read(node)
        plan, self._period = read_plan(node.resolve("plan"), settings.plan), settings.period
        topic, *topics = (
            node.resolve(node.beside(name)) for name in (settings.topic, *(source.topic for source in plan.sources))
        )
        self._robot_time = RobotTime(node)
        outputs = outputs_of(plan, topic, checked_rates(node.resolve("rates"), settings.rates or (), plan))
        self._streams = [
            SyncStream(
                node, output, name, topics, self._robot_time, self._period, f" at {output.rate:g} Hz" * (name != topic)
            )
            for output, name in outputs
        ]
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, name="synchronizer", daemon=True)
        pairs = enumerate(zip(plan.sources, topics, strict=True))
        self._subscriptions = [
            node.subscribe(name, source.message, self._receiver(index, source), queue_size=0)
            for index, (source, name) in pairs
        ]
        self._thread.start()
        names = ", ".join(node.resolve(name) for _, name in outputs)
        node.log_info(f"synchronising {', '.join(topics)} on {names}; policy {plan.policy}")

    def close(self) -> None:
        """Stop the thread."""
        for subscription in self._subscriptions:
            subscription.unregister()
        self._stop.set()
        self._thread.join(2.0)
        self._robot_time.close()

    def _receiver(self, index: int, source: SyncSource) -> Callable[[Any], None]:
        streams, chunked = self._streams, source.message._type == "hric_msgs/SampleChunk"

        def receive(message: Any) -> None:
            arrived = time.monotonic()
            for stream in streams:
                if chunked:
                    stream.see_units(source, message)
                stream.synchroniser.push_message(index, message, arrived)

        return receive

    def _work(self) -> None:
        look = time.monotonic()
        while not self._stop.wait(max(look - time.monotonic(), 0.0)):
            now = time.monotonic()
            look = max(look + self._period, now)
            for stream in self._streams:
                stream.work(now)


def checked_rates(where: str, rates: Sequence[float], plan: SyncPlan) -> Sequence[float]:
    """Return the rates if the plan's policy is resample, or if there are none. Raises ParameterError otherwise."""
    if rates and plan.policy != RESAMPLE:
        raise ParameterError(
            f"{where} is given, but the reference of policy {plan.policy} is a topic; valid: policy {RESAMPLE}"
        )
    return rates


def outputs_of(plan: SyncPlan, topic: str, rates: Sequence[float]) -> list[tuple[SyncPlan, str]]:
    """Return (plan, topic) of each output: one on the topic itself, or one per rate on `<topic>_<rate>hz`."""
    if not rates:
        return [(plan, topic)]
    return [(replace(plan, rate=rate), rate_topic(topic, rate)) for rate in rates]


def main(text: str, warning: str = "") -> int:
    """Run the node, and return its exit code; text: printed by --help; warning: logged at the start."""

    def start(node: RosNode) -> SynchronizerNode:
        if warning:
            node.log_warn(warning)
        return SynchronizerNode(node)

    return run("synchronizer", text, start, SyncSettings, *(["queue"] if warning else []))
