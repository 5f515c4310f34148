"""How the client looks for its server."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

from hric_control.errors import ParameterError
from mocap_natnet.codec.layout import Version, layout
from mocap_natnet.codec.packets import COMMAND_PORT, DATA_PORT

TRANSPORTS = ("auto", "unicast", "multicast")
BROADCAST = "255.255.255.255"


@dataclass(frozen=True)
class Settings:
    """Parameters of the client.

    Args:
        server: address of the server; "": the first one that answers a discovery.
        discovery: address that a discovery is sent to.
        local: address of the network card that faces the server; "": the one by which this machine reaches it.
        command_port: of the server.
        data_port: where frames arrive; 0: as the server says.
        group: multicast group; "": as the server says.
        transport: "auto": as the server says.
        bitstream: wanted from a unicast server; None: its newest.
        nominal_latency: from the middle of the exposure to the arrival, where the server does not tell [s].
    """

    server: str = "127.0.0.1"
    discovery: str = BROADCAST
    local: str = ""
    command_port: int = COMMAND_PORT
    data_port: int = 0
    group: str = ""
    transport: str = "auto"
    bitstream: Version | None = None
    nominal_latency: float = 0.0055

    def __post_init__(self) -> None:
        for name in ("server", "discovery", "local", "group"):
            value = getattr(self, name)
            try:
                address = ipaddress.IPv4Address(value or "239.0.0.1")
            except ValueError:
                raise ParameterError(f"{name} is {value!r}; valid: an IPv4 address, or nothing") from None
            if name == "group" and not address.is_multicast:
                raise ParameterError(f"group is {value}; valid: a multicast address, 224.0.0.0 to 239.255.255.255")
        if self.transport not in TRANSPORTS:
            raise ParameterError(f"transport is {self.transport!r}; valid: {', '.join(TRANSPORTS)}")
        for name, low in (("command_port", 1), ("data_port", 0)):
            if not low <= getattr(self, name) <= 65535:
                raise ParameterError(f"{name} is {getattr(self, name)}; valid: {low} to 65535")
        if self.bitstream is not None:
            layout(self.bitstream)
        if not 0 <= self.nominal_latency < 10:
            raise ParameterError(f"nominal_latency is {self.nominal_latency}; valid: 0 to 10 [s]")


@dataclass(frozen=True)
class Route:
    """Where frames come from.

    Args:
        multicast, unicast: whether to listen there.
        group: of the multicast.
        port: of both.
    """

    multicast: bool
    unicast: bool
    group: str
    port: int = DATA_PORT
