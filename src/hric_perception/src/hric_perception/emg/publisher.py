"""Publisher of EMG: its samples as chunks, their envelope, and the largest envelope of a contraction."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.signal  # noqa: F401  imported here, so that loading it does not delay the first samples
from std_srvs.srv import SetBool, SetBoolResponse

from hric_core.errors import HricError
from hric_core.node import Node
from hric_core.parameters import choice, section
from hric_msgs.msg import SampleChunk
from hric_perception.chunk import Chunk, FloatArray, Layout, chunk_message
from hric_perception.emg.envelope import Envelope
from hric_perception.emg.envelope import EnvelopeSettings as EnvelopeSettings
from hric_perception.emulation import Faults, Outlet
from hric_perception.sampled import Device, DriverSettings, SamplePublisher, StampedOutlet
from hric_perception.stream import Driver, SampleStream, StreamHealth
from hric_perception.trigno.client import TrignoClient, TrignoSettings
from hric_perception.trigno.protocol import Decoder, Encoder

LOG = logging.getLogger("hric.perception.emg")


@dataclass(frozen=True)
class EmgSettings(DriverSettings):
    """Parameters of the node `emg`, the EMG driver."""

    kind: ClassVar[str] = "EMG"
    also: ClassVar[tuple[str, ...]] = ("measured_mvc",)
    source: str = choice("lsl", "trigno")
    trigno: TrignoSettings = section(TrignoSettings)
    envelope: EnvelopeSettings = section(EnvelopeSettings)

    def publisher(self, node: Node, on_trouble: Callable[[str], None]) -> "EmgPublisher":
        """Return the publisher of raw EMG and its envelope."""
        return EmgPublisher(node, self.envelope, on_trouble)

    def driver(self, node: Node, publisher: Any, stream: SampleStream, health: StreamHealth) -> Driver:
        """Return the driver that reads EMG: a Trigno client or an LSL reader."""
        if self.source == "trigno":
            return TrignoClient(self.trigno, stream, health)
        return super().driver(node, publisher, stream, health)

    def local_outlet(self, device: Device, publisher: SamplePublisher, stream: SampleStream) -> Outlet:
        """Return the outlet by which emulated muscles in this process send to `stream`, without a network."""
        settings = device.settings
        if not self.source == settings.transport == "trigno":
            return super().local_outlet(device, publisher, stream)
        stream.begin(self.trigno.layout(settings.rate), self.trigno.latency)
        return TrignoOutlet(stream, self.trigno, settings.rate, device.faults)


class TrignoOutlet(StampedOutlet):
    """Outlet of emulated EMG that encodes and decodes samples like Trigno server and client, within one process.

    A frame arrives when its last sample is sent.

    Args:
        stream: receiver of the samples, already begun.
        settings: settings of the client.
        rate: rate of the samples [Hz].
        faults: faults of the samples.
    """

    def __init__(self, stream: SampleStream, settings: TrignoSettings, rate: float, faults: Faults) -> None:
        super().__init__(stream)
        self._delay, self._encoder = faults.delay, Encoder(rate, faults.time_code)
        self._decoder = Decoder(len(settings.channels))

    def push(self, times: FloatArray, data: FloatArray) -> None:
        """Encode the samples, and pass decoded frames to the stream."""
        samples = self._decoder.decode(self._encoder.encode(data))
        if len(samples):
            self._stream.arrived(float(times[-1 - self._encoder.waiting]) + self._delay, samples)


class MvcService:
    """Service `record_mvc`: records the largest EMG envelope of a maximum voluntary contraction (MVC).

    A request with true begins a recording. One with false ends it, sets the parameter `measured_mvc` to the largest
    envelope of each channel, and responds with these values.

    Args:
        node: private node.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._lock = node, threading.Lock()
        self._recording = False
        self._names: tuple[str, ...] = ()
        self._largest: FloatArray | None = None
        node.service("record_mvc", SetBool, self._serve)

    def take(self, chunk: Chunk) -> None:
        """Update the largest envelope of each channel with the next chunk, while a recording runs."""
        with self._lock:
            if self._recording and len(chunk.data):
                largest = np.fmax.reduce(chunk.data, axis=0)
                before = self._largest if self._names == chunk.layout.channels else None
                self._largest = largest if before is None else np.fmax(before, largest)
                self._names = chunk.layout.channels

    def _serve(self, request: Any) -> Any:
        with self._lock:
            was, self._recording = self._recording, bool(request.data)
            largest, names = self._largest, self._names
            if request.data:
                self._largest = None
        if request.data:
            return SetBoolResponse(True, "recording: contract as hard as you can, then call again with false")
        if not was or largest is None:
            return SetBoolResponse(False, "no envelope was recorded; call with true first, while EMG samples arrive")
        maxima = {name: float(value) for name, value in zip(names, largest, strict=True)}
        if unknown := [name for name, value in maxima.items() if not value > 0.0]:
            return SetBoolResponse(
                False, f"all samples of {', '.join(unknown)} are NaN or 0; check the electrodes and repeat"
            )
        self._node.set_param("measured_mvc", maxima)
        return SetBoolResponse(
            True, "envelope/mvc: {" + ", ".join(f"{name}: {value:.4g}" for name, value in maxima.items()) + "}"
        )


class EmgPublisher:
    """Publisher of raw EMG and its envelope; called from one thread.

    Args:
        node: private node.
        settings: settings of the envelope.
        on_trouble: callback with the reason if the envelope of a stream cannot be computed.
    """

    def __init__(self, node: Node, settings: EnvelopeSettings, on_trouble: Callable[[str], None]) -> None:
        self._settings, self._on_trouble = settings, on_trouble
        topic = node.beside("hric/perception/emg")
        self._raw = node.advertise(f"{topic}/raw", SampleChunk, queue_size=100)
        self._smooth = node.advertise(f"{topic}/envelope", SampleChunk, queue_size=100)
        self._envelope: Envelope | None = None
        self._layout: object = None
        self._mvc = MvcService(node)

    def choose(self, layout: Layout) -> Layout:
        """Return the layout unchanged: EMG is published with the channels of its source."""
        return layout

    def publish(self, chunk: Chunk) -> None:
        """Publish the next chunk of raw EMG and its envelope."""
        self._raw.publish(chunk_message(chunk))
        if self._layout is not chunk.layout:
            self._begin(chunk)
        if self._envelope is not None and (smooth := self._envelope.add(chunk)) is not None:
            self._mvc.take(smooth)
            self._smooth.publish(chunk_message(smooth))

    def _begin(self, chunk: Chunk) -> None:
        """Create the envelope filter of a new stream; log why if the filter does not suit its rate or channels."""
        self._layout, self._envelope = chunk.layout, None
        try:
            self._envelope = Envelope(self._settings, chunk.layout)
        except HricError as error:
            LOG.error("the EMG envelope is not published: %s", error)
            self._on_trouble(f"the EMG envelope is not published: {error}")
