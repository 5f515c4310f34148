"""What the nodes of all sensors that stream samples share: parameters, the time of the run, a driver, diagnostics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from std_msgs.msg import Header

from hric_control.errors import ParameterError
from hric_control.ros_node import RosNode
from hric_perception.chunk import Chunk, Layout
from hric_perception.diagnostics import Reporter
from hric_perception.health import OK, WARN, Health, StreamHealth
from hric_perception.replayed import START_DELAY, START_TOPIC, Replayed
from hric_perception.section import Section
from hric_perception.stream import SampleStream
from mocap_natnet.run_time import RunTime

CHUNK = 0.01
"""Duration of a message [s] (our choice)."""


class Driver(Protocol):
    """Reads a device in a thread of its own."""

    def start(self) -> None:
        """Begin."""

    def close(self) -> None:
        """End."""


MakeDriver = Callable[[Section, SampleStream, StreamHealth, Callable[[Layout], Layout]], Driver]
"""(its parameters, gets the samples, is told of trouble, may refuse or change a layout) -> a driver that has not begun."""


class Sensor:
    """From the parameters of a node to chunks.

    Args:
        node: private node.
        sources: drivers by the value of the parameter `source`.
        on_chunk: gets the chunks, in the driver's thread.
        choose: may change or refuse the layout of a source.

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: RosNode, sources: dict[str, MakeDriver], on_chunk: Callable[[Chunk], None], choose: Callable[[Layout], Layout]) -> None:
        self._reporter = Reporter(node, "stream")
        whole = section_of(node, "source", "chunk", *sources)
        source = whole.text("source", next(iter(sources)), tuple(sources))
        self.health = StreamHealth(f"a stream by {source}")
        self.run_time = RunTime(node)
        self._stream = SampleStream(self.run_time.run_time, self.health, on_chunk, whole.number("chunk", CHUNK, 0.0, 1.0))
        try:
            self._driver = sources[source](whole.section(source), self._stream, self.health, choose)
        except Exception:
            self.run_time.close()
            raise

    def start(self) -> None:
        """Begin."""
        self._driver.start()

    def tick(self) -> None:
        """Once a second.

        Raises:
            HricError: the run is not paced.
        """
        self.run_time.tick()
        health = self.health.report(self.run_time.standing)
        health.values.update({"time of the run from": self.run_time.source, "before the run's time was known": str(self._stream.untimed)})
        self._reporter.report(health)

    def close(self) -> None:
        """End."""
        self._driver.close()
        self.run_time.close()


def follow_human(node: RosNode, replayed: Replayed, faults: Section) -> None:
    """Let a trial whose beginning is not given begin with the emulated human; its samples are held back until it is certain that he had not begun."""
    if replayed.waits:
        faults.content.setdefault("delay", START_DELAY)
        node.subscribe(START_TOPIC, Header, lambda message: replayed.start(message.stamp.to_sec()))


def emulated_health(standing: bool, replayed: Replayed | None, values: dict[str, str]) -> Health:
    """What an emulated device tells: standing: whether the run's time does; replayed: the trial that it replays, if any."""
    if standing:
        return Health(WARN, "the run is paused or has not begun", values)
    waits = replayed is not None and replayed.waits
    return Health(OK, f"streams; the trial begins with the emulated human, {START_TOPIC}" if waits else "streams", values)


def section_of(node: RosNode, *names: str) -> Section:
    """Private parameters as a mapping; those that are not set are not in it."""
    given = {name: node.param(name, None) for name in names}
    return Section(node.namespace, {name: value for name, value in given.items() if value is not None})


def seed_of(node: RosNode) -> int:
    """The parameter `seed`. Raises ParameterError."""
    seed = node.param("seed", 0)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise ParameterError(f"{node.resolve('seed')} is {seed!r}; valid: a whole number, 0 or more")
    return seed
