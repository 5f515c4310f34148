"""The node `emg`: EMG from a device, as chunks, and its envelope."""

from __future__ import annotations

import logging
from collections.abc import Callable

from hric_control.errors import HricError
from hric_control.ros_node import RosNode
from hric_msgs.msg import SampleChunk
from hric_perception.chunk import Chunk
from hric_perception.chunk_messages import chunk_message
from hric_perception.emg.envelope import Envelope, read_settings
from hric_perception.emg.mvc import MvcService
from hric_perception.lsl import lsl_driver
from hric_perception.section import Section
from hric_perception.sensor import Sensor
from hric_perception.trigno.driver import trigno_driver
from mocap_natnet.process import run

LOG = logging.getLogger("hric.perception.emg")


class EmgNode:
    """Publishes from its construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: RosNode) -> None:
        self._settings = read_settings(Section(node.resolve("envelope"), node.param("envelope", None)))
        self._raw = node.advertise("/hric/perception/emg/raw", SampleChunk, queue_size=100)
        self._smooth = node.advertise("/hric/perception/emg/envelope", SampleChunk, queue_size=100)
        self._envelope: Envelope | None = None
        self._layout: object = None
        self._mvc = MvcService(node)
        self._sensor = Sensor(node, {"lsl": lsl_driver("EMG"), "trigno": trigno_driver}, self._on_chunk, lambda layout: layout)
        self._sensor.start()

    def tick(self) -> None:
        """Once a second. Raises HricError in a run that is not paced."""
        self._sensor.tick()

    def close(self) -> None:
        """End."""
        self._sensor.close()

    def _on_chunk(self, chunk: Chunk) -> None:
        self._raw.publish(chunk_message(chunk))
        if self._layout is not chunk.layout:
            self._begin(chunk)
        if self._envelope is not None and (smooth := self._envelope.add(chunk)) is not None:
            self._mvc.take(smooth)
            self._smooth.publish(chunk_message(smooth))

    def _begin(self, chunk: Chunk) -> None:
        """Filters for another stream; one that they cannot serve has no envelope."""
        self._layout, self._envelope = chunk.layout, None
        try:
            self._envelope = Envelope(self._settings, chunk.layout)
        except HricError as error:
            LOG.error("no envelope: %s", error)
            self._sensor.health.event(f"no envelope: {error}")


def main(text: str) -> int:
    """Run the node; text: for --help. Returns the exit code."""

    def make(node: RosNode) -> tuple[Callable[[], None], Callable[[], None]]:
        emg = EmgNode(node)
        return emg.tick, emg.close

    return run("emg", text, make)
