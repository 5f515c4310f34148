"""Table of all ports that programs of the workspace open.

It says who listens where, who may speak, what waits for a slow peer, and what an attacker can do who reaches the port.
The manual's page is made from this table, and a test compares it with the ports of a running system. Standard library
only.
"""

import socket
from collections.abc import Iterator
from dataclasses import dataclass
from ipaddress import ip_address

ANY = (1024, 65535)
"""Range of any free port."""
BACKLOG = (
    "4 MiB for each listener, its oldest messages go; 10 minutes without reading: closed (`hric_core/listeners.py`)"
)
ROS_ADDRESS = "loopback; `ROS_IP` or `ROS_HOSTNAME` of the user opens it"


@dataclass(frozen=True)
class Wire:
    """Ports of one kind.

    Args:
        who: listening programs.
        programs: file names, one of which is on its command line; empty: any node.
        protocol: protocol spoken.
        transport: "tcp" or "udp".
        ports: first and last.
        port_text: the ports in words.
        address: address to which it is bound, and what opens it to others.
        address_argument: True if an argument can set the address to which it is bound.
        speaks: peers that may use the port.
        queue: data that waits for a slow peer.
        stranger: actions open to an attacker who reaches the port.
    """

    who: str
    programs: tuple[str, ...]
    protocol: str
    transport: str
    ports: tuple[int, int]
    port_text: str
    address: str
    speaks: str
    queue: str
    stranger: str
    address_argument: bool = False


GROUP = "239.255.42.99"
"""Multicast group of NatNet; a socket bound to it receives nothing else."""

WIRES = (
    Wire(
        "ROS master (`roscore`, `scripts/bringup`)",
        ("rosmaster",),
        "XML-RPC",
        "tcp",
        ANY,
        "11311, or that of `ROS_MASTER_URI`",
        ROS_ADDRESS,
        "everybody who reaches it",
        "none: one response for each request",
        "all that ROS can: read, publish, call services, end nodes",
    ),
    Wire(
        "`scripts/bringup` and `roslaunch`",
        ("bringup.py", "roslaunch"),
        "XML-RPC",
        "tcp",
        ANY,
        "any",
        ROS_ADDRESS,
        "everybody who reaches it",
        "none: one response for each request",
        "list the processes; add one that runs already",
    ),
    Wire(
        "every node, also `bag_recorder`, `rosout` and other programs on roscpp that the bring-up starts",
        (),
        "XML-RPC and TCPROS",
        "tcp",
        ANY,
        "any, two for each node",
        f"{ROS_ADDRESS}. `rosout` of a `roscore` by hand: XML-RPC on all interfaces",
        "everybody who reaches it",
        BACKLOG,
        "read and publish topics, call services, end the node",
    ),
    Wire(
        "nodes on roscpp: `bag_recorder`, `rosout`, `robot_state_publisher`",
        (),
        "UDPROS",
        "udp",
        ANY,
        "any",
        "as their XML-RPC",
        "nobody: no topic of the workspace asks for UDP",
        "none: datagrams",
        "nothing",
    ),
    Wire(
        "`natnet_client`, `force_plate` in Motive's stream",
        ("natnet_client", "force_plate", "calibrate"),
        "NatNet, requests and unicast frames",
        "udp",
        ANY,
        "any, and 1511 as the server says",
        "the address that faces the server: loopback where `server` is on it",
        "the server that responded: its address, its command port, one port for frames. Others are dropped, counted "
        "(diagnostics) and logged once with their address",
        "4 MiB of the kernel; frames wait in the process then",
        "nothing, unless it forges the server's address and ports",
        address_argument=True,
    ),
    Wire(
        "`emulated_motive`, `emulated_human`",
        ("emulated_motive", "emulated_human"),
        "NatNet",
        "udp",
        ANY,
        "1510, and any to send frames from",
        "loopback; `ip` (of a bring-up: `mocap_server`) opens it",
        "everybody who reaches it",
        "none: datagrams",
        "receive the frames, start and stop takes",
        address_argument=True,
    ),
    Wire(
        "`emulated_emg`, `emulated_plate`: LSL outlets",
        ("emulated_emg", "emulated_plate"),
        "LSL",
        "tcp",
        (16572, 16603),
        "16572 to 16603",
        "loopback; `session` empty opens it to the network",
        "programs that give the same session",
        "30 s for each reader, its oldest samples go",
        "read the samples",
    ),
    Wire(
        "all with LSL: `emulated_emg`, `emulated_plate`, `emg`, `force_plate`",
        ("emulated_emg", "emulated_plate", "emg", "force_plate"),
        "LSL, discovery and clocks",
        "udp",
        (16571, 65535),
        "16571 to 16603, and any that is free",
        "loopback; `session` empty opens it to the network",
        "programs that give the same session",
        "none: datagrams",
        "list the streams; offer one of the same name in place of a device's",
    ),
    Wire(
        "`emulated_emg` as a Trigno server",
        ("emulated_emg",),
        "Trigno",
        "tcp",
        ANY,
        "50040 and 50043",
        "loopback; `ip` opens it",
        "everybody who reaches it",
        "what the socket takes",
        "read the samples, start and stop them",
        address_argument=True,
    ),
    Wire(
        "`view`, the window in a browser",
        ("view",),
        "HTTP and WebSocket",
        "tcp",
        ANY,
        "8090, or `port`",
        "loopback; `host` opens it",
        "who knows the token of the printed address, from a page of this server, 20 at a time",
        "one frame; a slow viewer gets fewer",
        "nothing without the token; with it look on, no command is taken",
        address_argument=True,
    ),
    Wire(
        "`control_box`, `emulated_arm`",
        ("control_box", "emulated_arm"),
        "FCI, requests",
        "tcp",
        (1337, 1338),
        "1337, with a hand 1338",
        "loopback (of a bring-up 127.0.0.1); `ip` opens it",
        "the first client that shakes hands within 1 s, until it goes; 64 may be at it, then the oldest of the address "
        "that has most of them goes",
        "1 MiB of responses, then the client is let go",
        "move the emulated arm while nobody else is connected",
        address_argument=True,
    ),
    Wire(
        "`control_box`, `emulated_arm`",
        ("control_box", "emulated_arm"),
        "FCI, commands",
        "udp",
        ANY,
        "any, while a client is connected",
        "as its requests",
        "the client's address and port alone (connected socket)",
        "none: datagrams",
        "nothing, unless it forges the client's address and port",
        address_argument=True,
    ),
    Wire(
        "`robot` and `gripper` with libfranka",
        ("robot", "franka_gripper", "gripper"),
        "FCI, states",
        "udp",
        ANY,
        "any",
        "loopback where `robot_ip` is on it; else all interfaces, by libfranka",
        "libfranka takes what comes first: keep the arm's network apart",
        "none: datagrams",
        "where it is open: forge states of the arm",
    ),
    Wire(
        "`scripts/scheduler`, `sweep --dask local`",
        ("dask", "sweep", "benchmark"),
        "Dask",
        "tcp",
        ANY,
        "8786, or `--port`; its pages: any",
        "loopback; `--host` or `--interface` opens it, with a certificate or `--insecure`. Its pages: loopback",
        "with a certificate those who have one, else everybody who reaches it",
        "Dask's own, in memory",
        "with `--insecure`: run programs as you",
    ),
    Wire(
        "`scripts/worker`",
        ("dask", "--multiprocessing-fork"),  # the second is for its child processes, started by Python
        "Dask",
        "tcp",
        ANY,
        "any",
        "loopback where the scheduler is there; else with a certificate or `--insecure` only",
        "with a certificate those who have one, else everybody who reaches it",
        "Dask's own, in memory",
        "with `--insecure`: run programs as you",
    ),
    Wire(
        "`scripts/docs --serve`",
        ("mkdocs",),
        "HTTP",
        "tcp",
        ANY,
        "8000",
        "loopback",
        "everybody who reaches it",
        "none: one response for each request",
        "read the manual",
    ),
)
"""Every listening port. Other programs only connect, such as the Trigno client and sweeps."""
COLUMNS = (
    "who listens",
    "protocol",
    "ports",
    "where, and what opens it",
    "who may speak",
    "queue for each peer",
    "a stranger who reaches it can",
)


def is_local(host: str) -> bool:
    """Return True if every address of `host` is on loopback, however it is spelled. Raises ValueError: it has none."""
    try:
        addresses = {str(info[4][0]) for info in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError) as error:
        raise ValueError(f"{host} is no address: {error}") from None
    parsed = [ip_address(address.partition("%")[0]) for address in addresses]
    return all((getattr(address, "ipv4_mapped", None) or address).is_loopback for address in parsed)


def host_of(text: str) -> str:
    """Return the host of an address, with or without a scheme, brackets and port; "" means all interfaces."""
    rest = text.rpartition("://")[2]
    if rest.startswith("["):
        return rest[1:].partition("]")[0]
    return rest if rest.count(":") > 1 else rest.partition(":")[0]


def reached_by_others(what: str, certificate: str) -> str:
    """Return the refusal of a port without certificates that other machines reach.

    Args:
        what: the address, or the option that opens it.
        certificate: option for a certificate.
    """
    return (
        f"{what} is reached from other machines, and whoever reaches it runs programs as you; valid: a certificate "
        f"({certificate}), an address on loopback, or --insecure"
    )


def page() -> str:
    """Return the page of the manual."""
    return "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    yield "# Who listens where\n"
    yield (
        "Every port that a program of this workspace opens. Nothing is open to other machines unless an argument says "
        "so. This page is made from `hric_core.wires`, which a test compares with the ports of a bring-up in "
        "a network of its own, attacked by a neighbour.\n"
    )
    yield f"| {' | '.join(COLUMNS)} |"
    yield "|---" * len(COLUMNS) + "|"
    for wire in WIRES:
        protocol = f"{wire.protocol} ({wire.transport.upper()})"
        cells = (wire.who, protocol, wire.port_text, wire.address, wire.speaks, wire.queue, wire.stranger)
        yield f"| {' | '.join(cells)} |"
