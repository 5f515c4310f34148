"""Nodes of all sensors that stream samples: driver and emulated device, and diagnostics of a stream."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from hric_core.node import Node
from hric_core.robot_time.follower import RobotTime
from hric_core.robot_time.progress import ProgressReport
from hric_core.ros import RosNode, run
from hric_core.ros.process import NodeApp
from hric_perception.emulation import Emulator, Outlet
from hric_perception.replayed import START_TOPIC
from hric_perception.sampled import Closable, DeviceSettings, DriverSettings
from hric_perception.sent import SentCounts
from hric_perception.simulated import KnownTime
from hric_perception.stream import ERROR, OK, WARN, SampleStream, StreamHealth, StreamReport


class SensorNode(NodeApp):
    """Node that publishes the samples of a sensor's driver, running from construction on.

    Args:
        node: private node.
        settings: parameters of the driver.

    Raises:
        HricError: the driver cannot be created.
    """

    def __init__(self, node: RosNode, settings: DriverSettings) -> None:
        self._reporter = Reporter(node, "stream")
        self._health = StreamHealth(f"a stream by {settings.source}")
        publisher = settings.publisher(node, self._health.event)
        self._robot_time = RobotTime(node)
        self._stream = SampleStream(self._robot_time.robot_time, self._health, publisher.publish, settings.chunk)
        try:
            self._driver = settings.driver(node, publisher, self._stream, self._health)
        except Exception:
            self._robot_time.close()
            raise
        self._driver.start()

    def tick(self) -> None:
        """Publish diagnostics. Raises HricError if the run is not paced, that is, not held to a real-time factor."""
        self._robot_time.tick()
        health = self._health.report(self._robot_time.standing)
        health.values.update(
            {
                "source of robot time": self._robot_time.source,
                "samples before robot time was known": str(self._stream.untimed),
            }
        )
        self._reporter.report(health)

    def close(self) -> None:
        """Stop the driver."""
        self._driver.close()
        self._robot_time.close()


def run_driver(name: str, text: str, settings: type[DriverSettings]) -> int:
    """Run the node of a sensor's driver, and return its exit code; text: printed by --help."""
    return run(name, text, lambda node: SensorNode(node, settings.read(node)), settings, *settings.also)


class EmulatedNode(NodeApp):
    """Node of an emulated device that streams from construction on, as far as the measured quantity is known.

    Args:
        node: private node.
        settings: parameters of the device.

    Raises:
        HricError: a parameter is not valid, or a network port is in use.
    """

    def __init__(self, node: RosNode, settings: DeviceSettings) -> None:
        device = settings.device(node)
        self._replayed, self._sensor = device.replayed, device.sensor()
        self._robot_time, self._reporter = RobotTime(node), Reporter(node, "stream")
        self._clock = KnownTime(self._robot_time, device.known, settings.ahead)
        self._progress = ProgressReport(node)
        self._source: Closable = settings.served(device, self._clock, self._progress.reached) or self._sending(
            node, settings, settings.outlet(device)
        )
        node.log_info(f"streaming {settings.title} at {settings.rate:g} Hz by {settings.transport}")

    def tick(self) -> None:
        """Publish diagnostics. Raises HricError if the run is not paced, that is, not held to a real-time factor."""
        self._robot_time.tick()
        sensor, replayed = self._sensor, self._replayed
        sends = isinstance(self._source, Emulator)
        values = {"samples sent": str(sensor.sent), "samples dropped": str(sensor.dropped)} if sends else {}
        if self._robot_time.standing:
            health = StreamReport(WARN, "the run is paused or has not begun", values)
        elif self._clock.now() is None:
            health = StreamReport(WARN, "waiting for the first message about the simulated human", values)
        elif replayed is not None and replayed.waits:
            text = f"streaming; the recorded trial begins with the emulated human (topic {START_TOPIC})"
            health = StreamReport(OK, text, values)
        else:
            health = StreamReport(OK, "streaming", values)
        self._reporter.report(health)

    def close(self) -> None:
        """Stop the sender."""
        self._source.close()
        self._progress.close()
        self._robot_time.close()

    def _sending(self, node: RosNode, settings: DeviceSettings, outlet: Outlet) -> Emulator:
        counts = SentCounts(node, settings.source, "samples", settings.rate)
        emulator = Emulator(
            self._sensor, outlet, self._clock, settings.block, node.log_error, counts.publish, self._progress.reached
        )
        emulator.start()
        return emulator


def run_device(name: str, text: str, settings: type[DeviceSettings]) -> int:
    """Run the node of an emulated device, and return its exit code; text: printed by --help."""
    return run(name, text, lambda node: EmulatedNode(node, settings.read(node)), settings)


class Reporter:
    """Publisher of the diagnostics of one stream.

    Args:
        node: private node; its name is the first part of the status' name.
        what: second part of the status' name, e.g. "stream".
    """

    def __init__(self, node: Node, what: str) -> None:
        self._node, self._name = node, f"{node.namespace.strip('/')}: {what}"
        self._publisher = node.advertise("/diagnostics", DiagnosticArray)
        self._level = OK

    def report(self, health: StreamReport) -> None:
        """Publish a health report, and log each change of its level."""
        if health.level != self._level:
            self._level = health.level
            {OK: self._node.log_info, WARN: self._node.log_warn, ERROR: self._node.log_error}[health.level](health.text)
        message = DiagnosticArray()
        message.header.stamp = self._node.now()
        pairs = [KeyValue(key, value) for key, value in health.values.items()]
        message.status.append(DiagnosticStatus(health.level, self._name, health.text, "", pairs))
        self._publisher.publish(message)
