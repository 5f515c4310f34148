"""Settings of the NatNet client's connection: address of the server, and transport."""

import ipaddress
from dataclasses import dataclass
from typing import Any

from hric_core.parameters import Settings as Base
from hric_core.parameters import choice, either, listing, number, text, whole
from mocap_natnet.codec.layout import Version, layout, parse
from mocap_natnet.codec.packets import COMMAND_PORT, DATA_PORT

BROADCAST = "255.255.255.255"
TRANSPORTS = ("auto", "unicast", "multicast")


def _address(value: str) -> str:
    return str(ipaddress.IPv4Address(value)) if value else value


def _group(value: str) -> str:
    if value and not ipaddress.IPv4Address(value).is_multicast:
        raise ValueError
    return value


def _version(value: str | Version) -> Version | None:
    version = parse(value) if isinstance(value, str) and value else value or None
    if version is not None:
        layout(version)
    return version


def address(default: str, description: str, empty: bool = True) -> Any:
    """Return the declaration of a parameter that is an IPv4 address."""
    valid = "an IPv4 address" + ", or nothing" * empty
    return text(default, valid=valid, empty=empty, made=_address, text=description)


def group(default: str, description: str, empty: bool = True) -> Any:
    """Return the declaration of a parameter that is the address of a multicast group."""
    valid = "a multicast address, 224.0.0.0 to 239.255.255.255" + ", or nothing" * empty
    return text(default, valid=valid, empty=empty, made=_group, text=description)


def bitstream(default: Version | None, description: str, name: str) -> Any:
    """Return the declaration of a parameter that is a bitstream (protocol version): text such as 4.1, or numbers."""
    kinds = either(text(figures=True), listing(whole(), 2), default=default, made=_version, name=name, text=description)
    kinds.kind, kinds.accepts = "string", "major.minor, e.g. 4.1"
    return kinds


@dataclass(frozen=True)
class ClientSettings(Base):
    """Parameters of the NatNet client's connection."""

    server: str = address("127.0.0.1", "address of Motive's machine; empty: the first one that responds to a discovery")
    discovery: str = address(BROADCAST, "address to which discovery messages are sent")
    local: str = address("", "address of the network card that faces Motive; empty: the one by which Motive is reached")
    command_port: int = whole(COMMAND_PORT, minimum=1, maximum=65535, text="UDP port of Motive's commands")
    data_port: int = whole(0, minimum=0, maximum=65535, text="UDP port of frames; 0: as Motive reports it")
    group: str = group("", "multicast group of frames; empty: as Motive reports it")
    transport: str = choice(*TRANSPORTS, text="transport of frames; `auto`: as Motive reports it")
    bitstream: Version | None = bitstream(
        None, "requested of a unicast server, e.g. `4.1`; empty: its newest. 2.5 to 4.5 are read", "bitstream"
    )
    nominal_latency: float = number(
        0.0055,
        minimum=0.0,
        maximum=10.0,
        unit="s",
        text="time from exposure to arrival, if the server does not report it",
    )


@dataclass(frozen=True)
class Route:
    """Addresses on which frames are expected.

    Args:
        multicast, unicast: True if frames may come by this transport.
        group: address of the multicast group.
        port: UDP port of both transports.
    """

    multicast: bool
    unicast: bool
    group: str
    port: int = DATA_PORT
