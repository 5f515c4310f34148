"""Node `emg`: EMG from a device, as chunks, its envelope, and the largest envelope of a contraction."""

from hric_core.ros import RosNode, run
from hric_perception.chunk import Chunk
from hric_perception.emg.publisher import EmgPublisher, EmgSettings
from hric_perception.sensor import SensorNode


class EmgNode(SensorNode):
    """EMG node; publishes from construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: RosNode) -> None:
        settings = EmgSettings.read(node)
        self._publisher = EmgPublisher(node, settings.envelope, lambda reason: self._health.event(reason))
        super().__init__(node, settings.source, settings.chunk, settings.driver)

    def _on_chunk(self, chunk: Chunk) -> None:
        self._publisher.publish(chunk)


def main(text: str) -> int:
    """Run the node, and return the exit code; text: for --help."""
    return run("emg", text, EmgNode, EmgSettings, "measured_mvc")
