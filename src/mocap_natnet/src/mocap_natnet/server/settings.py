"""Settings of the emulated Motive's stream."""

from dataclasses import dataclass

from hric_core.parameters import Settings as Base
from hric_core.parameters import choice, flag, number, whole
from mocap_natnet.client.settings import address, bitstream, group
from mocap_natnet.codec.layout import Version
from mocap_natnet.codec.packets import COMMAND_PORT, DATA_PORT, MULTICAST_GROUP

TRANSPORTS = ("unicast", "multicast")
UNICAST_TO = ("endpoint", "data_port", "both")
MAX_RATE = 10_000.0
"""Highest frame rate [Hz] (project default, unconfirmed)."""
FREQUENCIES = (10_000_000, 3_312_787)
"""Clock frequencies of observed servers [Hz]: on a newer Windows, and on an older one."""


@dataclass(frozen=True)
class MotiveSettings(Base):
    """Parameters of the emulated Motive's stream."""

    version: Version = bitstream((4, 1), "newest bitstream (protocol version) of the emulated Motive", "version")
    rate: float = number(240.0, minimum=1e-3, maximum=MAX_RATE, unit="Hz", text="frames per second")
    transport: str = choice(*TRANSPORTS, default="multicast")
    unicast_to: str = choice(
        *UNICAST_TO,
        text='receiver of a client\'s frames: the "endpoint" from which it connected, its "data_port", or "both"; '
        "clients differ",
    )
    ip: str = address("127.0.0.1", "address to listen on", empty=False)
    command_port: int = whole(
        COMMAND_PORT, minimum=0, maximum=65535, text="UDP port of requests; 0: any free one, for tests"
    )
    data_port: int = whole(DATA_PORT, minimum=1, maximum=65535, text="UDP port on which clients listen for frames")
    group: str = group(MULTICAST_GROUP, "multicast group of frames", empty=False)
    latency: float = number(
        0.0055,
        minimum=0.0,
        maximum=10.0,
        unit="s",
        text="time from the middle of the exposure to the sending of the frame",
    )
    jitter: float = number(
        0.0, minimum=0.0, maximum=10.0, unit="s", text="maximum of the random addition to the latency, seeded"
    )
    loss: float = number(0.0, minimum=0.0, maximum=1.0, text="share of frames that are not sent, seeded")
    drift: float = number(0.0, minimum=-1e5, maximum=1e5, unit="1e-6", text="excess rate of the server's clock")
    epoch: float = number(
        4000.0, minimum=0.0, maximum=1e9, unit="s", text="time of the server's clock at the start of the stream"
    )
    frequency: int = whole(
        FREQUENCIES[0], minimum=1, maximum=10**10, unit="Hz", text="ticks per second of the server's clock"
    )
    exposure_known: bool = flag(True, text="true: frames have the time of their exposure")
    client_timeout: float = number(
        10.0,
        minimum=0.0,
        maximum=1e9,
        unit="s",
        text="silence after which a unicast client gets no more frames; 0: never",
    )
    seed: int = whole(0, minimum=0, maximum=2**62, text="seed of jitter and loss")

    @property
    def period(self) -> float:
        """Time between frames [s]."""
        return 1.0 / self.rate

    def ticks(self, time: float) -> int:
        """Return the ticks of the server's clock at a time of the stream [s]."""
        return round((self.epoch + time * (1.0 + 1e-6 * self.drift)) * self.frequency)
