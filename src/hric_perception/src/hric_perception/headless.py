"""Emulated device and its driver in one process, without transport.

The samples pass through the same numbering, stamps and publishers as live ones; the result depends only on the seed.
"""

from collections.abc import Callable
from dataclasses import replace

from hric_core.node import Node
from hric_core.parameters import refused
from hric_perception.chunk import FloatArray
from hric_perception.emg.device import EmulatedEmg, EmulatedEmgSettings
from hric_perception.emg.publisher import EmgPublisher, EmgSettings
from hric_perception.emulation import Emulator, EvenSensor, Outlet
from hric_perception.plate.device import EmulatedPlate, EmulatedPlateSettings
from hric_perception.plate.publisher import ForcePlateSettings, PlatePublisher
from hric_perception.simulated import KnownTime
from hric_perception.stream import SampleStream, StreamHealth
from hric_perception.trigno.client import Settings as TrignoSettings
from hric_perception.trigno.protocol import Decoder, Encoder

NS = 1_000_000_000
SWITCHED_ON = -1.0
"""Start of the device before the run, so that the first sample has robot time 0 [s]."""


class HeadlessClock:
    """Clock that is set by hand; its monotonic clock is robot time.

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


def robot_time(monotonic: int) -> float:
    """Return the robot time [s] of a monotonic time [ns]; headless, both clocks are the same."""
    return monotonic / NS


class HeadlessSensor:
    """Emulated sensor that sends due samples block by block.

    Args:
        sensor: sampled sensor.
        outlet: receiver of the samples.
        block: robot time between sendings [s].
        known: function that returns the time up to which the measured quantity is known [s].
    """

    def __init__(self, sensor: EvenSensor, outlet: Outlet, block: float, known: Callable[[], float]) -> None:
        self._clock, self._block, self._blocks = HeadlessClock(), block, 0
        self._emulator = Emulator(sensor, outlet, KnownTime(self._clock, known))
        sensor.due(SWITCHED_ON)

    def advance(self, time: float) -> None:
        """Advance to a time of the run [s]."""
        if time >= self._blocks * self._block:
            self._blocks = int(time / self._block) + 1
            self._clock.time = time
            self._emulator.step()


class StampedOutlet:
    """Outlet of samples with stamps, as a reader of Lab Streaming Layer receives them.

    Args:
        stream: receiver of the samples; it has begun.
    """

    def __init__(self, stream: SampleStream) -> None:
        self._stream = stream

    def push(self, times: FloatArray, data: FloatArray) -> None:
        """Pass the samples and their stamps to the stream."""
        self._stream.stamped(times, data)

    def close(self) -> None:
        """End the stream."""
        self._stream.end()


class TrignoOutlet:
    """Outlet through the encoder of a Trigno server and the decoder of its client.

    A frame arrives when its last sample was sent.

    Args:
        stream: receiver of the samples; it has begun.
        settings: settings of the client.
        sensor: source of the samples.
    """

    def __init__(self, stream: SampleStream, settings: TrignoSettings, sensor: EvenSensor) -> None:
        self._stream, self._delay = stream, sensor.faults.delay
        self._encoder = Encoder(sensor.rate, sensor.faults.time_code)
        self._decoder = Decoder(len(settings.channels))

    def push(self, times: FloatArray, data: FloatArray) -> None:
        """Encode the samples, and pass decoded frames to the stream."""
        samples = self._decoder.decode(self._encoder.encode(data))
        if len(samples):
            self._stream.arrived(float(times[-1 - self._encoder.waiting]) + self._delay, samples)

    def close(self) -> None:
        """End the stream."""
        self._stream.end()


def headless_emg(driver: Node, device: Node) -> HeadlessSensor:
    """Return emulated muscles whose samples are published as by the node `emg`.

    Args:
        driver: private node with the parameters of `emg`.
        device: private node with those of `emulated_emg`.

    Raises:
        HricError: a parameter is not valid.
    """
    settings, emulated = EmgSettings.read(driver), EmulatedEmgSettings.read(device)
    if settings.source != emulated.transport:
        raise refused(f"{settings.prefix}source", settings.source, f"that of the device, {emulated.transport}")
    emg, publisher = EmulatedEmg(device, emulated), EmgPublisher(driver, settings.envelope, driver.log_error)
    stream = SampleStream(robot_time, StreamHealth(emulated.source), publisher.publish, settings.chunk)
    outlet: Outlet
    if settings.source == "lsl":
        stream.begin(replace(emg.layout, source=emulated.source))
        outlet = StampedOutlet(stream)
    else:
        stream.begin(settings.trigno.layout(emulated.rate), settings.trigno.latency)
        outlet = TrignoOutlet(stream, settings.trigno, emg.sensor)
    return HeadlessSensor(emg.sensor, outlet, emulated.block, emg.known)


def headless_plate(driver: Node, device: Node) -> HeadlessSensor:
    """Return an emulated force plate whose samples are published as by the node `force_plate`.

    Args:
        driver: private node with the parameters of `force_plate`.
        device: private node with those of `emulated_plate`.

    Raises:
        HricError: a parameter is not valid, or the plate is part of the frames of a motion capture.
    """
    settings, emulated = ForcePlateSettings.read(driver), EmulatedPlateSettings.read(device)
    if (settings.source, emulated.transport) != ("lsl", "lsl"):
        raise refused(f"{settings.prefix}source", settings.source, "lsl, without a network")
    plate, publisher = EmulatedPlate(device, emulated), PlatePublisher(driver, settings)
    stream = SampleStream(robot_time, StreamHealth(emulated.source), publisher.publish, settings.chunk)
    stream.begin(publisher.choose(replace(plate.layout, source=emulated.source)))
    return HeadlessSensor(plate.sensor(), StampedOutlet(stream), emulated.block, plate.known)
