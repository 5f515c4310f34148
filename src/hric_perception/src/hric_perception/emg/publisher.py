"""Publisher of EMG: its samples as chunks, their envelope, and the largest envelope of a contraction."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.signal  # noqa: F401  the filters' own, else loaded with the first sample, while others wait in the driver
from std_srvs.srv import SetBool, SetBoolResponse

from hric_core.errors import HricError
from hric_core.node import Node
from hric_core.parameters import Settings as Base
from hric_core.parameters import choice, section
from hric_msgs.msg import SampleChunk
from hric_perception.chunk import Chunk, FloatArray, chunk_message
from hric_perception.emg.envelope import Envelope
from hric_perception.emg.envelope import Settings as EnvelopeSettings
from hric_perception.lsl import LslSettings
from hric_perception.stream import CHUNK, Driver, SampleStream, StreamHealth
from hric_perception.trigno.client import Settings, TrignoClient

LOG = logging.getLogger("hric.perception.emg")


@dataclass(frozen=True)
class EmgSettings(Base):
    """Parameters of the node."""

    source: str = choice("lsl", "trigno")
    lsl: LslSettings = section(LslSettings)
    trigno: Settings = section(Settings)
    chunk: float = CHUNK
    envelope: EnvelopeSettings = section(EnvelopeSettings)

    def driver(self, stream: SampleStream, health: StreamHealth) -> Driver:
        """Return the driver of the source."""
        if self.source == "trigno":
            return TrignoClient(self.trigno, stream, health)
        return self.lsl.reader("EMG", stream, health, lambda layout: layout)


class MvcService:
    """Service `record_mvc`: true begins a recording, false ends it.

    At the end it sets the parameter `measured_mvc` and responds with the largest envelope of each channel.

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
        """Update the largest envelope with a chunk."""
        with self._lock:
            if self._recording and len(chunk.data):
                largest = np.nan_to_num(chunk.data, nan=0.0).max(axis=0)
                before = self._largest if self._names == chunk.layout.channels else None
                self._largest = largest if before is None else np.maximum(before, largest)
                self._names = chunk.layout.channels

    def _serve(self, request: Any) -> Any:
        with self._lock:
            was, self._recording = self._recording, bool(request.data)
            largest, names = self._largest, self._names
            if request.data:
                self._largest = None
        if request.data:
            return SetBoolResponse(True, "contract as hard as you can; call again with false")
        if not was or largest is None:
            return SetBoolResponse(False, "no envelope was recorded; call with true first, while samples come")
        found = {name: float(value) for name, value in zip(names, largest, strict=True)}
        self._node.set_param("measured_mvc", found)
        return SetBoolResponse(
            True, "envelope/mvc: {" + ", ".join(f"{name}: {value:.4g}" for name, value in found.items()) + "}"
        )


class EmgPublisher:
    """Publisher of chunks and their envelope; called from one thread.

    Args:
        node: private node.
        settings: settings of the envelope.
        on_trouble: callback with the reason if a stream can have no envelope.
    """

    def __init__(self, node: Node, settings: EnvelopeSettings, on_trouble: Callable[[str], None]) -> None:
        self._settings, self._on_trouble = settings, on_trouble
        topic = node.beside("hric/perception/emg")
        self._raw = node.advertise(f"{topic}/raw", SampleChunk, queue_size=100)
        self._smooth = node.advertise(f"{topic}/envelope", SampleChunk, queue_size=100)
        self._envelope: Envelope | None = None
        self._layout: object = None
        self._mvc = MvcService(node)

    def publish(self, chunk: Chunk) -> None:
        """Publish the next chunk and its envelope."""
        self._raw.publish(chunk_message(chunk))
        if self._layout is not chunk.layout:
            self._begin(chunk)
        if self._envelope is not None and (smooth := self._envelope.add(chunk)) is not None:
            self._mvc.take(smooth)
            self._smooth.publish(chunk_message(smooth))

    def _begin(self, chunk: Chunk) -> None:
        """Begin with the filters of another stream; a stream that they cannot filter has no envelope."""
        self._layout, self._envelope = chunk.layout, None
        try:
            self._envelope = Envelope(self._settings, chunk.layout)
        except HricError as error:
            LOG.error("no envelope: %s", error)
            self._on_trouble(f"no envelope: {error}")
