"""Publisher of a force plate: its samples as chunks, its wrench and its centre of pressure."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from geometry_msgs.msg import Point, PointStamped, Vector3, Wrench, WrenchStamped
from tf2_msgs.msg import TFMessage

from hric_core.geometry import Pose, stamped
from hric_core.node import Node
from hric_core.parameters import choice, flag, number, section, text
from hric_core.robot_time import stamps
from hric_msgs.msg import SampleChunk
from hric_perception.chunk import Chunk, Layout, chunk_message
from hric_perception.plate.geometry import (
    PLATE_ID,
    PlatePose,
    at_surface,
    centre_of_pressure,
    choose_channels,
    mean_wrench,
)
from hric_perception.plate.natnet import NATNET, plate_of
from hric_perception.sampled import DriverSettings
from hric_perception.stream import Driver, SampleStream, StreamHealth


@dataclass(frozen=True)
class ForcePlateSettings(DriverSettings):
    """Parameters of the node `force_plate`; those in its group `natnet` are read by `plate_of`."""

    kind: ClassVar[str] = "Force"
    also: ClassVar[tuple[str, ...]] = NATNET
    source: str = choice("lsl", "natnet")
    id: str = PLATE_ID
    frame: str = text("", default_text="`force_plate_<id>`", text="tf frame of force and moment")
    pose: PlatePose | None = section(PlatePose, None)
    height: float = number(
        0.0,
        unit="m",
        text="height of the surface above the origin of the device's moments; its sign differs between makers: check "
        "with a known weight",
    )
    invert: bool = flag(False, text="true: the device measures the reaction, not the load")

    def publisher(self, node: Node, on_trouble: Callable[[str], None]) -> "PlatePublisher":
        """Return the publisher of samples, wrench and centre of pressure."""
        return PlatePublisher(node, self)

    def driver(self, node: Node, publisher: Any, stream: SampleStream, health: StreamHealth) -> Driver:
        """Return the driver that reads the plate: a NatNet client or an LSL reader."""
        if self.source == "natnet":
            return plate_of(node.child("natnet"), stream, health, publisher.choose, publisher.described)
        return super().driver(node, publisher, stream, health)


class PlatePublisher:
    """Publisher of a force plate's samples, wrench and centre of pressure; called from one thread.

    Args:
        node: private node.
        settings: settings of the plate.
    """

    def __init__(self, node: Node, settings: ForcePlateSettings) -> None:
        self._node, self._frame = node, settings.frame or f"force_plate_{settings.id}"
        self._height, self._sign = settings.height, -1.0 if settings.invert else 1.0
        topic = node.beside(f"hric/perception/force_plate/{settings.id}")
        self._samples = node.advertise(f"{topic}/samples", SampleChunk, queue_size=100)
        self._wrench = node.advertise(f"{topic}/wrench", WrenchStamped, queue_size=100)
        self._cop = node.advertise(f"{topic}/cop", PointStamped, queue_size=100)
        self._static: Any = None
        if settings.pose is not None:
            self._publish_pose(settings.pose.frame, settings.pose.pose)

    def choose(self, layout: Layout) -> Layout:
        """Return a stream's layout with the plate's channel names and frame. Raises ParameterError."""
        return choose_channels(layout, self._frame)

    def described(self, parent: str, pose: Pose) -> None:
        """Publish the plate's pose in the stream's description, unless the parameter `pose` gives one."""
        if self._static is None:
            self._publish_pose(parent, pose)

    def publish(self, chunk: Chunk) -> None:
        """Publish the next chunk, its wrench and centre of pressure."""
        self._samples.publish(chunk_message(chunk))
        mean = mean_wrench(chunk)
        if mean is None:
            return
        time, wrench = mean[0], at_surface(mean[1], self._height)
        head = stamped.header(stamps.to_time(time), self._frame)
        fx, fy, fz, mx, my, mz = (self._sign * wrench).tolist()
        self._wrench.publish(WrenchStamped(head, Wrench(Vector3(fx, fy, fz), Vector3(mx, my, mz))))
        point = centre_of_pressure(wrench)
        if point is not None:
            self._cop.publish(PointStamped(head, Point(*point)))

    def _publish_pose(self, parent: str, pose: Pose) -> None:
        """Publish the pose of the plate's frame in a parent frame on `tf_static`."""
        self._static = self._node.advertise("/tf_static", TFMessage, latch=True)
        self._static.publish(
            TFMessage([stamped.transform_stamped(stamped.header(self._node.now(), parent), self._frame, pose)])
        )
