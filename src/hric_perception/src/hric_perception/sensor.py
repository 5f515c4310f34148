"""What the nodes of all sensors that stream samples share: parameters, the time of the run, a driver, diagnostics."""

from collections.abc import Callable
from typing import Protocol

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from hric_control.node import Node
from hric_control.robot_time.follower import RobotTime
from hric_control.robot_time.progress import ProgressReport
from hric_control.robot_time.stream_time import Clock
from hric_control.ros import RosNode
from hric_control.ros.process import NodeApp
from hric_perception.chunk import Chunk
from hric_perception.emulation import Emulator, EvenSensor, Outlet
from hric_perception.replayed import START_TOPIC, Replayed
from hric_perception.sent import SentCounts
from hric_perception.stream import ERROR, OK, WARN, Driver, Health, SampleStream, StreamHealth


class Closable(Protocol):
    """What sends the samples of an emulated sensor."""

    def close(self) -> None:
        """End."""


MakeDriver = Callable[[SampleStream, StreamHealth], Driver]
"""(gets the samples, is informed of trouble) -> a driver that has not begun."""


class SensorNode(NodeApp):
    """From a driver to chunks, from the construction on; a subclass overrides `_on_chunk`.

    Args:
        node: private node.
        source: what the driver is called.
        chunk: duration of a message [s].
        make_driver: makes it.

    Raises:
        HricError: the driver cannot be had.
    """

    def __init__(self, node: RosNode, source: str, chunk: float, make_driver: MakeDriver) -> None:
        self._reporter = Reporter(node, "stream")
        self._health = StreamHealth(f"a stream by {source}")
        self._robot_time = RobotTime(node)
        self._stream = SampleStream(self._robot_time.robot_time, self._health, self._on_chunk, chunk)
        try:
            self._driver = make_driver(self._stream, self._health)
        except Exception:
            self._robot_time.close()
            raise
        self._driver.start()

    def tick(self) -> None:
        """Report. Raises HricError in a run that is not paced."""
        self._robot_time.tick()
        health = self._health.report(self._robot_time.standing)
        health.values.update(
            {
                "time of the run from": self._robot_time.source,
                "before the run's time was known": str(self._stream.untimed),
            }
        )
        self._reporter.report(health)

    def close(self) -> None:
        """End."""
        self._driver.close()
        self._robot_time.close()

    def _on_chunk(self, chunk: Chunk) -> None:
        """Publish a chunk; called in the driver's thread."""
        raise NotImplementedError


class EmulatedNode(NodeApp):
    """An emulated sensor; a subclass starts what sends, in its constructor.

    Args:
        node: private node.
        replayed: trial that the sensor replays, if any.

    Attributes:
        robot_time: the time of the run.
        clock: by which it goes: the same, unless a subclass waits for what it measures.
    """

    def __init__(self, node: RosNode, replayed: Replayed | None) -> None:
        self._node, self._replayed = node, replayed
        self.robot_time, self._reporter = RobotTime(node), Reporter(node, "stream")
        self.clock: Clock = self.robot_time
        self._progress = ProgressReport(node)
        self._sensor: EvenSensor | None = None
        self._source: Closable

    def tick(self) -> None:
        """Report. Raises HricError in a run that is not paced."""
        self.robot_time.tick()
        sensor, replayed = self._sensor, self._replayed
        values = {} if sensor is None else {"samples sent": str(sensor.sent), "samples dropped": str(sensor.dropped)}
        if self.robot_time.standing:
            health = Health(WARN, "the run is paused or has not begun", values)
        elif self.clock.now() is None:
            health = Health(WARN, "nothing is known of the human in the robot's plant", values)
        elif replayed is not None and replayed.waits:
            health = Health(OK, f"streams; the trial begins with the emulated human, {START_TOPIC}", values)
        else:
            health = Health(OK, "streams", values)
        self._reporter.report(health)

    def close(self) -> None:
        """End."""
        self._source.close()
        self._progress.close()
        self.robot_time.close()

    def _send(self, sensor: EvenSensor, outlet: Outlet, source: str, block: float) -> None:
        """Send samples from now on.

        Args:
            sensor: what is sampled.
            outlet: where the samples go.
            source: what the driver's messages call it.
            block: of wall time between sendings [s].
        """
        counts = SentCounts(self._node, source, "samples", sensor.rate)
        emulator = Emulator(
            sensor, outlet, self.clock, block, self._node.log_error, counts.publish, self._progress.reached
        )
        self._sensor, self._source = sensor, emulator
        emulator.start()


class Reporter:
    """Of one stream.

    Args:
        node: private node; names the status.
        what: what the status is about, e.g. "stream".
    """

    def __init__(self, node: Node, what: str) -> None:
        self._node, self._name = node, f"{node.namespace.strip('/')}: {what}"
        self._publisher = node.advertise("/diagnostics", DiagnosticArray)
        self._level = OK

    def report(self, health: Health) -> None:
        """Publish; log where the level changed."""
        if health.level != self._level:
            self._level = health.level
            {OK: self._node.log_info, WARN: self._node.log_warn, ERROR: self._node.log_error}[health.level](health.text)
        message = DiagnosticArray()
        message.header.stamp = self._node.now()
        pairs = [KeyValue(key, value) for key, value in health.values.items()]
        message.status.append(DiagnosticStatus(health.level, self._name, health.text, "", pairs))
        self._publisher.publish(message)
