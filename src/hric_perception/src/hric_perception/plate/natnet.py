"""Force plates in the NatNet frames of a motion capture system: a driver, and an emulated Motive with only a plate.

Among EMG, plates and synchroniser, only this module needs motion capture. No ROS except a node's parameters.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import UP_AXES, Pose, Vector, compose
from hric_core.node import Node
from hric_core.parameters import Settings, choice, known_names, number, numbers, refused, whole
from hric_core.robot_time.stream_time import Clock
from hric_perception.chunk import Layout
from hric_perception.emulation import BlockNoise, Faults
from hric_perception.plate.geometry import CHANNELS, UNITS, frame_of
from hric_perception.plate.loads import Load
from hric_perception.stream import Driver, SampleStream, StreamHealth
from mocap_natnet import client, server
from mocap_natnet.client.settings import address
from mocap_natnet.codec import COMMAND_PORT, DATA_PORT, ForcePlateDescription, ServerModel
from mocap_natnet.node.parameters import Publishing

NS = 1e-9
LOOK = 0.5
"""Time between checks of the NatNet connection [s] (project default, unconfirmed)."""
CODE_PERIOD = 1.0
"""Period after which a time code starts at 0 again [s]: a 32 bit float has too few digits for more."""


class NatNetPlate(Driver):
    """Driver that reads a force plate from a NatNet stream.

    The protocol does not contain the times of the samples of a frame: they are spread evenly over the frame's period,
    the last one at its stamp.

    Args:
        settings: settings of the connection to the NatNet server.
        plate: id of the plate; 0: the first of the stream.
        stream: receiver of the samples.
        health: receiver of status reports.
        choose: function that returns the layout to publish; it may raise ParameterError.
        on_described: callback for the plate's description in the stream.
    """

    def __init__(
        self,
        settings: client.ClientSettings,
        plate: int,
        stream: SampleStream,
        health: StreamHealth,
        choose: Callable[[Layout], Layout],
        on_described: Callable[[ForcePlateDescription], None] = lambda description: None,
    ) -> None:
        super().__init__("natnet plate", 3.0)
        self._plate, self._stream, self._health = plate, stream, health
        self._choose, self._on_described = choose, on_described
        self._client = client.NatNetClient(settings, self._on_frame, self._on_model, self._on_restart)
        self._frame_rate: float | None = None
        self._count = 0
        self._number: int | None = None
        self._missing = ""

    def start(self) -> None:
        """Start the NatNet client and the thread."""
        self._client.start()
        super().start()

    def close(self) -> None:
        """Stop the NatNet client and the thread."""
        self._stop.set()
        self._client.close()
        super().close()

    def _run(self) -> None:
        while not self._stop.wait(LOOK):
            health = self._client.health()
            if health.level == 2:
                self._health.trouble(health.text)
                self._frame_rate = None
            elif self._frame_rate is None and self._client.server:
                try:
                    (self._frame_rate,) = struct.unpack_from("<f", self._client.request("FrameRate"))
                except (HricError, struct.error) as error:
                    self._health.trouble(f"{self._client.server} does not report its frame rate: {error}")
            elif self._missing:
                self._health.trouble(self._missing)

    def _on_restart(self) -> None:
        self._count = 0
        self._frame_rate = None

    def _on_model(self, model: ServerModel) -> None:
        for description in model.descriptions:
            if isinstance(description, ForcePlateDescription) and self._plate in (0, description.id):
                self._on_described(description)
                return

    def _on_frame(self, received: client.Received) -> None:
        plates, rate = received.frame.force_plates, self._frame_rate
        plate = next((plate for plate in plates if self._plate in (0, plate.id)), None)
        if plate is None or len(plate.channels) < len(CHANNELS):
            self._missing = (
                f"no force plate {self._plate or 'with six channels'} in the NatNet stream; valid: "
                f"{', '.join(str(plate.id) for plate in plates) or 'none'}"
            )
            self._count = 0
            return
        self._missing = ""
        channels = plate.channels[: len(CHANNELS)]
        count = min(len(channel) for channel in channels)
        if rate is None or not rate > 0 or not count:
            self._count = 0
            return
        if count != self._count:
            self._count, self._number = count, None
            source = f"NatNet {self._client.server} plate {plate.id}"
            self._stream.begin(self._choose(Layout(source, CHANNELS, UNITS, count * rate)))
        data = np.array([channel[:count] for channel in channels], dtype=float).T
        frames = received.frame.number - self._number if self._number is not None else 1
        self._number = received.frame.number
        self._stream.arrived(received.exposed * NS, data, max(0, frames - 1) * count)


@dataclass(frozen=True)
class PlateClient(client.ClientSettings, Publishing):
    """Parameters in the group `natnet` of a force plate's node: NatNet connection, and id of the plate."""

    plate: int = whole(0, minimum=0, maximum=2**31 - 1, text="id of the plate; 0: the first of the stream")


NATNET = tuple(f"natnet/{name}" for name in known_names((PlateClient,)))
"""Names of the parameters in the group `natnet`, group included."""


def plate_of(
    node: Node,
    stream: SampleStream,
    health: StreamHealth,
    choose: Callable[[Layout], Layout],
    on_pose: Callable[[str, Pose], None],
) -> NatNetPlate:
    """Return the driver of the force plate that a node's parameters select.

    Args:
        node: node with the parameters of `PlateClient`.
        stream: receiver of the samples.
        health: receiver of status reports.
        choose: function that returns the layout to publish; it may raise ParameterError.
        on_pose: callback for the frame of the stream and the plate's pose in it, once the stream describes the plate.

    Raises:
        ParameterError: a parameter is not valid.
    """
    settings = PlateClient.read(node)

    def describe(description: ForcePlateDescription) -> None:
        pose = frame_of(description.corners, settings.up_axis)
        on_pose(settings.frame, compose(settings.base_from_mocap, pose) if settings.base_frame else pose)

    return NatNetPlate(settings, settings.plate, stream, health, choose, describe)


@dataclass(frozen=True)
class PlateStream(Settings):
    """Settings of the emulated Motive that streams a plate."""

    rate: float = number(200.0, minimum=1.0, maximum=1000.0, unit="Hz", text="frame rate")
    ip: str = address("127.0.0.1", "address to listen on", empty=False)
    command_port: int = whole(COMMAND_PORT, minimum=0, maximum=65535)
    data_port: int = whole(DATA_PORT, minimum=1, maximum=65535)
    transport: str = choice("unicast", "multicast")
    up_axis: str = choice(*UP_AXES)
    latency: float = number(0.0055, minimum=0.0, maximum=1.0, unit="s")
    loss: float = number(0.0, minimum=0.0, maximum=1.0)
    centre: Vector | None = numbers(
        3, None, unit="m", text="centre of the plate's surface in the stream, z up; none: `emulated_plate/pose/xyz`"
    )


class PlateMotive:
    """Emulated Motive that streams a plate from construction on; end it with `close`.

    Args:
        stream: settings of the stream.
        rate: sample rate of the plate, a multiple of the frame rate [Hz].
        load: load on the plate.
        faults: faults of the samples; only noise, bias and time code (in channel Mz) are used.
        clock: clock of the stream.
        on_reached: callback with the robot time up to which all samples are sent [s]; None: not known.

    Raises:
        HricError: a value is not valid, or the UDP port is in use.
    """

    def __init__(
        self,
        stream: PlateStream,
        rate: float,
        load: Load,
        faults: Faults,
        clock: Clock,
        on_reached: Callable[[float | None], None] = lambda reached: None,
    ) -> None:
        count = round(rate / stream.rate)
        if count < 1 or abs(count * stream.rate - rate) > 1e-6 * rate:
            valid = f"a frame rate that divides the plate's {rate:g} Hz without remainder"
            raise refused(f"{stream.prefix}rate", stream.rate, valid)
        shared = ("rate", "ip", "command_port", "data_port", "transport", "latency", "loss")
        settings = server.MotiveSettings(**{name: getattr(stream, name) for name in shared}, seed=faults.seed)
        self._rate, self._load, self._faults, self._noise = rate, load, faults, BlockNoise(6, faults.seed)
        plate = server.ServedPlate(self._sample, centre=stream.centre or (0.0, 0.0, 0.0), samples=count)
        scene = server.ServedScene((), (plate,), up=stream.up_axis)
        self.server = server.MotiveServer(server.Motive(settings, scene), clock, on_reached)
        self.server.start()

    def close(self) -> None:
        """Stop streaming."""
        self.server.close()

    def _sample(self, time: float) -> tuple[float, ...]:
        """Return the plate's measured wrench at a time of the stream [s]: six values [N, N m]."""
        robot_time, faults = self.server.robot_time(time), self._faults
        robot_time = time if robot_time is None else robot_time
        values = self._load(np.array([robot_time]))[0] + faults.bias
        if faults.noise:
            values = values + faults.noise * self._noise.values(max(0, round(time * self._rate)), 1)[0]
        if faults.time_code:
            values[5] = robot_time % CODE_PERIOD
        return tuple(values.tolist())
