"""Common parts of the nodes of all sensors that stream samples: parameters, time of the run, driver, diagnostics."""

from collections.abc import Callable
from typing import Protocol

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from hric_core.node import Node
from hric_core.robot_time.follower import RobotTime
from hric_core.robot_time.progress import ProgressReport
from hric_core.robot_time.stream_time import Clock
from hric_core.ros import RosNode
from hric_core.ros.process import NodeApp
from hric_perception.chunk import Chunk
from hric_perception.emulation import Emulator, EvenSensor, Outlet
from hric_perception.replayed import START_TOPIC, Replayed
from hric_perception.sent import SentCounts
from hric_perception.stream import ERROR, OK, WARN, Driver, Health, SampleStream, StreamHealth


class Closable(Protocol):
    """Sender of the samples of an emulated sensor."""

    def close(self) -> None:
        """Stop sending."""


MakeDriver = Callable[[SampleStream, StreamHealth], Driver]
"""(receiver of the samples, receiver of status reports) -> a driver that has not started."""


class SensorNode(NodeApp):
    """Node from a driver to chunks, running from construction on; a subclass overrides `_on_chunk`.

    Args:
        node: private node.
        source: name of the driver.
        chunk: duration of a message [s].
        make_driver: factory of the driver.

    Raises:
        HricError: the driver cannot be created.
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
        """Publish diagnostics. Raises HricError in a run that is not paced."""
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
        """Stop the driver."""
        self._driver.close()
        self._robot_time.close()

    def _on_chunk(self, chunk: Chunk) -> None:
        """Publish a chunk; called in the driver's thread."""
        raise NotImplementedError


class EmulatedNode(NodeApp):
    """Node of an emulated sensor; a subclass starts the sender in its constructor.

    Args:
        node: private node.
        replayed: trial that the sensor replays, if any.

    Attributes:
        robot_time: time of the run.
        clock: clock of the sensor: robot_time, unless a subclass waits for measured values.
    """

    def __init__(self, node: RosNode, replayed: Replayed | None) -> None:
        self._node, self._replayed = node, replayed
        self.robot_time, self._reporter = RobotTime(node), Reporter(node, "stream")
        self.clock: Clock = self.robot_time
        self._progress = ProgressReport(node)
        self._sensor: EvenSensor | None = None
        self._source: Closable

    def tick(self) -> None:
        """Publish diagnostics. Raises HricError in a run that is not paced."""
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
        """Stop the sender."""
        self._source.close()
        self._progress.close()
        self.robot_time.close()

    def _send(self, sensor: EvenSensor, outlet: Outlet, source: str, block: float) -> None:
        """Send samples from now on.

        Args:
            sensor: sampled sensor.
            outlet: receiver of the samples.
            source: name of the source in the driver's messages.
            block: wall time between sendings [s].
        """
        counts = SentCounts(self._node, source, "samples", sensor.rate)
        emulator = Emulator(
            sensor, outlet, self.clock, block, self._node.log_error, counts.publish, self._progress.reached
        )
        self._sensor, self._source = sensor, emulator
        emulator.start()


class Reporter:
    """Diagnostics of one stream.

    Args:
        node: private node; names the status.
        what: subject of the status, e.g. "stream".
    """

    def __init__(self, node: Node, what: str) -> None:
        self._node, self._name = node, f"{node.namespace.strip('/')}: {what}"
        self._publisher = node.advertise("/diagnostics", DiagnosticArray)
        self._level = OK

    def report(self, health: Health) -> None:
        """Publish a health report, and log each change of its level."""
        if health.level != self._level:
            self._level = health.level
            {OK: self._node.log_info, WARN: self._node.log_warn, ERROR: self._node.log_error}[health.level](health.text)
        message = DiagnosticArray()
        message.header.stamp = self._node.now()
        pairs = [KeyValue(key, value) for key, value in health.values.items()]
        message.status.append(DiagnosticStatus(health.level, self._name, health.text, "", pairs))
        self._publisher.publish(message)
