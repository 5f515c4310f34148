"""The node `force_plate`: samples of a force plate, its wrench and its centre of pressure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Point, PointStamped, Vector3, Wrench, WrenchStamped
from tf2_msgs.msg import TFMessage

from hric_control import stamps
from hric_control.errors import ParameterError
from hric_control.ros_node import RosNode
from hric_msgs.msg import SampleChunk
from hric_perception.chunk import Chunk, Layout
from hric_perception.chunk_messages import chunk_message
from hric_perception.health import StreamHealth
from hric_perception.lsl import lsl_driver
from hric_perception.plate.geometry import at_surface, centre_of_pressure, choose_channels, frame_of, mean_wrench, read_place
from hric_perception.plate.natnet import NatNetPlate
from hric_perception.section import Section
from hric_perception.sensor import MakeDriver, Sensor, section_of
from hric_perception.stream import SampleStream
from mocap_natnet import messages
from mocap_natnet.codec.descriptions import ForcePlateDescription
from mocap_natnet.parameters import read_publishing, read_settings
from mocap_natnet.poses import Pose, compose
from mocap_natnet.process import run


class ForcePlateNode:
    """Publishes from its construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: RosNode) -> None:
        section = section_of(node, "id", "frame", "height", "invert", "pose")
        name = section.text("id", "1")
        if not name.replace("_", "").isalnum() or not name.isascii():
            raise ParameterError(f"{node.resolve('id')} is {name!r}; valid: letters, digits and _")
        self._node, self._frame = node, section.text("frame", f"force_plate_{name}")
        self._height, self._sign = section.number("height", 0.0), -1.0 if section.content.get("invert", False) is True else 1.0
        topic = f"/hric/perception/force_plate/{name}"
        self._samples = node.advertise(f"{topic}/samples", SampleChunk, queue_size=100)
        self._wrench = node.advertise(f"{topic}/wrench", WrenchStamped, queue_size=100)
        self._cop = node.advertise(f"{topic}/cop", PointStamped, queue_size=100)
        self._static: Any = None
        if section.content.get("pose") is not None:
            self._place(*read_place(section.section("pose")))
        sources: dict[str, MakeDriver] = {"lsl": lsl_driver("Force"), "natnet": self._natnet}
        self._sensor = Sensor(node, sources, self._on_chunk, lambda layout: choose_channels(layout, self._frame))
        self._sensor.start()

    def tick(self) -> None:
        """Once a second. Raises HricError in a run that is not paced."""
        self._sensor.tick()

    def close(self) -> None:
        """End."""
        self._sensor.close()

    def _natnet(self, section: Section, stream: SampleStream, health: StreamHealth, choose: Callable[[Layout], Layout]) -> NatNetPlate:
        own = self._node.child("natnet")
        publishing = read_publishing(own)

        def describe(description: ForcePlateDescription) -> None:
            if self._static is None:
                pose = frame_of(description.corners, publishing.up_axis)
                self._place(publishing.frame, compose(publishing.base_from_mocap, pose) if publishing.base_frame else pose)

        return NatNetPlate(read_settings(own), section.whole("plate", 0, 0, 2**31 - 1), stream, health, choose, describe)

    def _place(self, parent: str, pose: Pose) -> None:
        """Tell where the plate is."""
        self._static = self._node.advertise("/tf_static", TFMessage, latch=True)
        self._static.publish(TFMessage([messages.transform_stamped(messages.header(self._node.now(), parent), self._frame, pose)]))

    def _on_chunk(self, chunk: Chunk) -> None:
        self._samples.publish(chunk_message(chunk))
        mean = mean_wrench(chunk)
        if mean is None:
            return
        time, wrench = mean[0], at_surface(mean[1], self._height)
        head = messages.header(stamps.to_time(time), self._frame)
        fx, fy, fz, mx, my, mz = (self._sign * wrench).tolist()
        self._wrench.publish(WrenchStamped(head, Wrench(Vector3(fx, fy, fz), Vector3(mx, my, mz))))
        point = centre_of_pressure(wrench)
        if point is not None:
            self._cop.publish(PointStamped(head, Point(*point)))


def main(text: str) -> int:
    """Run the node; text: for --help. Returns the exit code."""

    def make(node: RosNode) -> tuple[Callable[[], None], Callable[[], None]]:
        plate = ForcePlateNode(node)
        return plate.tick, plate.close

    return run("force_plate", text, make)
