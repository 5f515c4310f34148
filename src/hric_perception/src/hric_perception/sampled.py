"""Evenly sampled sensor: parameters of its driver and of its emulated device, and both in one process. No ROS node.

A sensor derives its parameters from `DriverSettings` and `DeviceSettings`. `hric_perception.sensor` runs driver and
device as nodes, `headless` runs both in one process, without transport.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Protocol

from hric_core.node import Node
from hric_core.parameters import Settings, choice, mapping, number, refused, section, text
from hric_core.robot_time.stream_time import Clock
from hric_perception.chunk import Chunk, FloatArray, Layout, source_name
from hric_perception.emulation import BLOCK, SEED, Emulator, EvenSensor, Faults, Outlet, Signal
from hric_perception.replayed import Replayed
from hric_perception.simulated import KnownTime
from hric_perception.stream import CHUNK, NS, Driver, SampleStream, StreamHealth

SWITCHED_ON = -1.0
"""Robot time at which a headless device starts [s], before 0, so that its first sample is taken at 0."""


class SamplePublisher(Protocol):
    """Interface of a publisher of a sensor's samples, which is called from one thread."""

    def choose(self, layout: Layout) -> Layout:
        """Return the layout with which a stream's samples are published. Raises ParameterError."""

    def publish(self, chunk: Chunk) -> None:
        """Publish the next chunk, and the values computed from it."""


class Closable(Protocol):
    """Interface of a sender of an emulated sensor's samples that can be stopped."""

    def close(self) -> None:
        """Stop sending."""


class Device(NamedTuple):
    """Emulated device, without the sender of its samples.

    Attributes:
        settings: parameters of the device.
        channels, units: name and unit of each channel of the signal.
        signal: measured signal.
        faults: faults of the samples.
        known: function that returns the time up to which the measured quantity is known [s].
        replayed: recorded trial that the device replays; None: none.
    """

    settings: "DeviceSettings"
    channels: tuple[str, ...]
    units: tuple[str, ...]
    signal: Signal
    faults: Faults
    known: Callable[[], float]
    replayed: Replayed | None

    def sensor(self) -> EvenSensor:
        """Return the emulated sensor that samples the signal and adds the faults."""
        return EvenSensor(self.settings.rate, len(self.channels), self.signal, self.faults)

    @property
    def layout(self) -> Layout:
        """Layout of the samples that the device sends, time code included; the source is the stream's name."""
        code, settings = self.faults.time_code, self.settings
        return Layout(settings.name, self.channels + ("time",) * code, self.units + ("s",) * code, settings.rate)


@dataclass(frozen=True)
class DeviceSettings(Settings):
    """Parameters of an emulated sensor's node."""

    kind: ClassVar[str]
    """Type of the device's LSL stream."""
    transport: str = choice("lsl")
    session: str = text("", figures=True, text="LSL session, see below")
    name: str = text("emulated", figures=True, text="name of the LSL stream")
    rate: float = number(minimum=10.0, maximum=20000.0, unit="Hz")
    faults: Mapping[str, object] = mapping(default={}, text="faults of the samples, see below")
    seed: int = SEED
    block: float = BLOCK

    @property
    def source(self) -> str:
        """Name of the device's stream, as its driver writes it into messages."""
        return source_name(self.kind, self.name)

    @property
    def ahead(self) -> float:
        """Lead of the device's clock over the time up to which its signal is known [s]."""
        return 0.0

    @property
    def title(self) -> str:
        """Name of the device in the node's log."""
        return f"emulated {self.kind}"

    def device(self, node: Node) -> Device:
        """Create the emulated device; it may subscribe to topics with the measured quantity. Raises HricError."""
        raise NotImplementedError

    def outlet(self, device: Device) -> Outlet:
        """Create the outlet that sends the device's samples. Raises HricError."""
        from hric_perception.lsl import LslOutlet, use_session

        use_session(self.session)
        return LslOutlet(device.layout, self.kind, self.name)

    def served(self, device: Device, clock: Clock, on_reached: Callable[[float | None], None]) -> Closable | None:
        """Start and return a server that samples the device itself; None: an `Emulator` samples it for `outlet`."""
        return None


@dataclass(frozen=True)
class LslSettings(Settings):
    """Parameters that select an LSL stream; without `type`, the stream type of the sensor is used.

    Reading them does not import pylsl, since headless runs need no liblsl.
    """

    type: str | None = text(None)
    name: str = text("", figures=True)
    source_id: str = text("", figures=True)
    session: str = text("", figures=True)

    def reader(
        self, kind: str, stream: SampleStream, health: StreamHealth, choose: Callable[[Layout], Layout]
    ) -> Driver:
        """Return a reader for streams of type `kind`, or of the type in these settings if there is one."""
        from hric_perception.lsl import LslReader, StreamQuery, use_session

        use_session(self.session)
        query = StreamQuery(kind if self.type is None else self.type, self.name, self.source_id)
        return LslReader(query, stream, health, choose, local=bool(self.session))


@dataclass(frozen=True)
class DriverSettings(Settings):
    """Parameters of a sensor driver's node."""

    kind: ClassVar[str]
    """Type of the LSL stream that the driver reads, unless its parameters name another one."""
    also: ClassVar[tuple[str, ...]] = ()
    """Names of further parameters of the driver's node, which other code reads."""
    source: str = choice("lsl")
    lsl: LslSettings = section(LslSettings)
    chunk: float = CHUNK

    def publisher(self, node: Node, on_trouble: Callable[[str], None]) -> SamplePublisher:
        """Return the publisher of samples; on_trouble: callback with the reason if some output cannot be published."""
        raise NotImplementedError

    def driver(self, node: Node, publisher: Any, stream: SampleStream, health: StreamHealth) -> Driver:
        """Return the driver that reads the sensor, not started yet. Raises HricError."""
        return self.lsl.reader(self.kind, stream, health, publisher.choose)

    def local_outlet(self, device: Device, publisher: SamplePublisher, stream: SampleStream) -> Outlet:
        """Begin `stream`; return the outlet by which a device in this process sends to it. Raises ParameterError."""
        transport = device.settings.transport
        if self.source != transport:
            raise refused(f"{self.prefix}source", self.source, f"{transport}, which the emulated device uses")
        if self.source != "lsl":
            raise refused(f"{self.prefix}source", self.source, "lsl, the only source that works without a network")
        stream.begin(publisher.choose(replace(device.layout, source=device.settings.source)))
        return StampedOutlet(stream)


class HeadlessClock:
    """Clock of a headless run, set by the caller; its monotonic time is robot time.

    Attributes:
        time: robot time [s].
    """

    def __init__(self) -> None:
        self.time = SWITCHED_ON

    def now(self) -> float:
        """Return the robot time [s]."""
        return self.time

    def monotonic(self, run: float) -> int:
        """Return the robot time as monotonic time [ns]."""
        return round(run * NS)


class HeadlessSensor:
    """Emulated sensor of a headless run, which sends its due samples block by block.

    Args:
        device: emulated device.
        outlet: receiver of the samples.
    """

    def __init__(self, device: Device, outlet: Outlet) -> None:
        self._clock, self._block, self._blocks = HeadlessClock(), device.settings.block, 0
        sensor = device.sensor()
        self._emulator = Emulator(sensor, outlet, KnownTime(self._clock, device.known))
        sensor.due(SWITCHED_ON)

    def advance(self, time: float) -> None:
        """Advance to a robot time [s]; once per block, send the samples that are due."""
        if time >= self._blocks * self._block:
            self._blocks = int(time / self._block) + 1
            self._clock.time = time
            self._emulator.step()


class StampedOutlet:
    """Outlet that passes stamped samples to a stream in this process, as an LSL reader would.

    Args:
        stream: receiver of the samples, already begun.
    """

    def __init__(self, stream: SampleStream) -> None:
        self._stream = stream

    def push(self, times: FloatArray, data: FloatArray) -> None:
        """Pass the samples and their stamps to the stream."""
        self._stream.stamped(times, data)

    def close(self) -> None:
        """End the stream."""
        self._stream.end()


def headless(driver: DriverSettings, device: DeviceSettings, driver_node: Node, device_node: Node) -> HeadlessSensor:
    """Return an emulated device with its driver: samples are published as by the driver's node, without transport.

    Numbering, stamps and publishers of the samples are those of a live run; results depend only on the seed.

    Args:
        driver: parameters of the driver.
        device: parameters of the device.
        driver_node: private node of the driver, which publishes.
        device_node: private node of the device, which may subscribe.

    Raises:
        HricError: a parameter is not valid, or the transport needs a network.
    """
    emulated, publisher = device.device(device_node), driver.publisher(driver_node, driver_node.log_error)
    health = StreamHealth(device.source)
    stream = SampleStream(lambda monotonic: monotonic / NS, health, publisher.publish, driver.chunk)
    return HeadlessSensor(emulated, driver.local_outlet(emulated, publisher, stream))
