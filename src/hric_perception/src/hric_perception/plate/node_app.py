"""Node `force_plate`: samples of a force plate, its wrench and its centre of pressure."""

from hric_core.ros import RosNode, run
from hric_perception.chunk import Chunk
from hric_perception.plate.natnet import NATNET, plate_of
from hric_perception.plate.publisher import ForcePlateSettings, PlatePublisher
from hric_perception.sensor import SensorNode
from hric_perception.stream import Driver, SampleStream, StreamHealth


class ForcePlateNode(SensorNode):
    """Force plate node; publishes from construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: RosNode) -> None:
        settings = ForcePlateSettings.read(node)
        self._publisher = publisher = PlatePublisher(node, settings)

        def driver(stream: SampleStream, health: StreamHealth) -> Driver:
            if settings.source == "natnet":
                return plate_of(node.child("natnet"), stream, health, publisher.choose, publisher.described)
            return settings.lsl.reader("Force", stream, health, publisher.choose)

        super().__init__(node, settings.source, settings.chunk, driver)

    def _on_chunk(self, chunk: Chunk) -> None:
        self._publisher.publish(chunk)


def main(text: str) -> int:
    """Run the node, and return the exit code; text: for --help."""
    return run("force_plate", text, ForcePlateNode, ForcePlateSettings, *NATNET)
