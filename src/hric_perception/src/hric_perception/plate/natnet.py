"""The samples of a force plate that come within the frames of a motion capture system. No ROS."""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable

import numpy as np

from hric_control.errors import HricError
from hric_perception.chunk import Layout
from hric_perception.health import StreamHealth
from hric_perception.plate.geometry import CHANNELS, UNITS
from hric_perception.stream import SampleStream
from mocap_natnet.client import NatNetClient, Received, Settings
from mocap_natnet.codec.descriptions import ForcePlateDescription, Model

NS = 1e-9
LOOK = 0.5
"""Between looks at the conversation [s] (our choice)."""


class NatNetPlate:
    """A client of its own, which listens to the plate alone.

    The protocol does not say when the samples of a frame were taken: they are spread evenly over the frame's period, the last one at its stamp.

    Args:
        settings: how to find the server.
        plate: id of the plate; 0: the first of the stream.
        stream, health: are told.
        choose: changes the layout.
        on_described: gets the plate's description.
    """

    def __init__(
        self,
        settings: Settings,
        plate: int,
        stream: SampleStream,
        health: StreamHealth,
        choose: Callable[[Layout], Layout],
        on_described: Callable[[ForcePlateDescription], None] = lambda description: None,
    ) -> None:
        self._plate, self._stream, self._health = plate, stream, health
        self._choose, self._on_described = choose, on_described
        self._client = NatNetClient(settings, self._on_frame, self._on_model, self._on_restart)
        self._frame_rate: float | None = None
        self._count = 0
        self._number: int | None = None
        self._missing = ""
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._look, name="natnet plate", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._client.start()
        self._thread.start()

    def close(self) -> None:
        """End."""
        self._stop.set()
        self._client.close()
        self._thread.join(3.0)

    def _look(self) -> None:
        while not self._stop.wait(LOOK):
            health = self._client.health()
            if health.level == 2:
                self._health.trouble(health.text)
                self._frame_rate = None
            elif self._frame_rate is None and self._client.server:
                try:
                    (self._frame_rate,) = struct.unpack_from("<f", self._client.ask("FrameRate"))
                except (HricError, struct.error) as error:
                    self._health.trouble(f"{self._client.server} does not tell its frame rate: {error}")
            elif self._missing:
                self._health.trouble(self._missing)

    def _on_restart(self) -> None:
        self._count = 0
        self._frame_rate = None

    def _on_model(self, model: Model) -> None:
        for description in model.descriptions:
            if isinstance(description, ForcePlateDescription) and self._plate in (0, description.id):
                self._on_described(description)
                return

    def _on_frame(self, received: Received) -> None:
        plates, rate = received.frame.force_plates, self._frame_rate
        found = next((plate for plate in plates if self._plate in (0, plate.id)), None)
        if found is None or len(found.channels) < len(CHANNELS):
            self._missing = f"no force plate {self._plate or ''} in the stream; valid: {', '.join(str(plate.id) for plate in plates) or 'none'}"
            self._count = 0
            return
        self._missing = ""
        channels = found.channels[: len(CHANNELS)]
        count = min(len(channel) for channel in channels)
        if rate is None or not rate > 0 or not count:
            self._count = 0
            return
        if count != self._count:
            self._count, self._number = count, None
            source = f"NatNet {self._client.server} plate {found.id}"
            self._stream.begin(self._choose(Layout(source, CHANNELS, UNITS, count * rate)))
        data = np.array([channel[:count] for channel in channels], dtype=float).T
        frames = received.frame.number - self._number if self._number is not None else 1
        self._number = received.frame.number
        self._stream.arrived(received.exposed * NS, data, max(0, frames - 1) * count)
