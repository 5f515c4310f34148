"""How the emulated Motive streams."""

from __future__ import annotations

import ipaddress
import math
from dataclasses import dataclass

from hric_control.errors import ParameterError
from mocap_natnet.codec.layout import Version, layout
from mocap_natnet.codec.packets import COMMAND_PORT, DATA_PORT, MULTICAST_GROUP

TRANSPORTS = ("unicast", "multicast")
UNICAST_TO = ("endpoint", "data_port", "both")
MAX_RATE = 10_000.0
"""[Hz], our choice."""
FREQUENCIES = (10_000_000, 3_312_787)
"""Ticks per second of servers that were seen: newer Windows, an older one."""


@dataclass(frozen=True)
class Settings:
    """Parameters of the emulated Motive.

    Args:
        version: newest bitstream that it speaks.
        rate: frames per second [Hz].
        transport: "unicast" or "multicast".
        unicast_to: where a client's frames go: "endpoint" that it connected from, its "data_port", or "both"; clients differ.
        ip: address to listen on.
        command_port: where requests arrive; 0: any that is free (tests).
        data_port: where a client listens for frames.
        group: multicast group.
        latency: from the middle of the exposure to the sending of the frame [s].
        jitter: added to the latency, from 0 to this, seeded [s].
        loss: share of frames that are not sent, 0 to 1, seeded.
        drift: how much faster the server's clock runs, in parts per million.
        epoch: what the server's clock shows at the start of the stream [s].
        frequency: ticks per second of its clock [Hz].
        exposure_known: whether frames tell the middle of the exposure.
        client_timeout: silence after which a unicast client gets nothing more [s]; 0: never.
        seed: of jitter and loss.
    """

    version: Version = (4, 1)
    rate: float = 240.0
    transport: str = "multicast"
    unicast_to: str = "endpoint"
    ip: str = "127.0.0.1"
    command_port: int = COMMAND_PORT
    data_port: int = DATA_PORT
    group: str = MULTICAST_GROUP
    latency: float = 0.0055
    jitter: float = 0.0
    loss: float = 0.0
    drift: float = 0.0
    epoch: float = 4000.0
    frequency: int = FREQUENCIES[0]
    exposure_known: bool = True
    client_timeout: float = 10.0
    seed: int = 0

    def __post_init__(self) -> None:
        layout(self.version)
        for name, valid in (("transport", TRANSPORTS), ("unicast_to", UNICAST_TO)):
            if getattr(self, name) not in valid:
                raise ParameterError(f"{name} is {getattr(self, name)!r}; valid: {', '.join(valid)}")
        for name, low, high in (
            ("rate", 1e-3, MAX_RATE),
            ("latency", 0.0, 10.0),
            ("jitter", 0.0, 10.0),
            ("loss", 0.0, 1.0),
            ("drift", -1e5, 1e5),
            ("epoch", 0.0, 1e9),
            ("frequency", 1, 10**10),
            ("client_timeout", 0.0, 1e9),
            ("command_port", 0, 65535),
            ("data_port", 1, 65535),
            ("seed", 0, 2**62),
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise ParameterError(f"{name} is {value}; valid: {low:g} to {high:g}")
        self._check_addresses()

    def _check_addresses(self) -> None:
        for name in ("ip", "group"):
            try:
                address = ipaddress.IPv4Address(getattr(self, name))
            except ValueError:
                raise ParameterError(f"{name} is {getattr(self, name)!r}; valid: an IPv4 address") from None
            if name == "group" and not address.is_multicast:
                raise ParameterError(f"group is {self.group}; valid: a multicast address, 224.0.0.0 to 239.255.255.255")

    @property
    def period(self) -> float:
        """Between frames [s]."""
        return 1.0 / self.rate

    def ticks(self, time: float) -> int:
        """What the server's clock shows at a time of the stream [s]."""
        return round((self.epoch + time * (1.0 + 1e-6 * self.drift)) * self.frequency)
