"""Table of all network ports that programs of the workspace open.

It lists for each port the listening program, the address, the permitted peers, the data queued for a slow peer, and
what an attacker could do who reaches the port. A page of the manual is generated from this table, and a test compares
it with the ports of a running system. The module needs only the standard library.
"""

import socket
from collections.abc import Iterator
from dataclasses import dataclass
from ipaddress import ip_address

ANY = (1024, 65535)
"""Range for a port that the system chooses."""
BACKLOG = (
    "4 MiB for each subscriber, then its oldest messages are dropped; closed after 10 minutes without reading "
    "(`hric_core/listeners.py`)"
)
ROS_ADDRESS = "loopback, unless the user sets `ROS_IP` or `ROS_HOSTNAME`"


@dataclass(frozen=True)
class Wire:
    """Row of the table: network ports of one kind.

    Args:
        who: listening programs.
        programs: file names by which a listening process is recognised on its command line; empty: any node.
        protocol: protocol on the port.
        transport: "tcp" or "udp".
        ports: first and last possible port.
        port_text: the ports in words.
        address: address to which the port is bound, and the setting that opens it to other machines.
        address_argument: True if an argument can set the address to which the port is bound.
        speaks: peers that may use the port.
        queue: data queued for a slow peer.
        stranger: possible actions of an attacker who reaches the port.
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
"""Multicast group of NatNet; a socket bound to this address receives nothing but multicast frames."""

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
        "list the processes; register a running process",
    ),
    Wire(
        "every node, also `bag_recorder`, `rosout` and other programs on roscpp that the bring-up starts",
        (),
        "XML-RPC and TCPROS",
        "tcp",
        ANY,
        "any, two for each node",
        f"{ROS_ADDRESS}. `rosout` of a `roscore` started by hand: XML-RPC on all interfaces",
        "everybody who reaches it. Python nodes close a connection that sends no header within 5 s, and the "
        "oldest one if more than 64 wait",
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
        "the same as their XML-RPC",
        "nobody: no topic of the workspace uses UDP",
        "none: datagrams",
        "nothing",
    ),
    Wire(
        "`natnet_client`, `force_plate` in Motive's stream",
        ("natnet_client", "force_plate", "calibrate"),
        "NatNet, requests and unicast frames",
        "udp",
        ANY,
        "any, and the data port that the server gives (1511)",
        "the local address on the route to the server: loopback if `server` is a loopback address",
        "the server that responded: its address, its command port, one port for frames. Packets from others are "
        "dropped, counted (diagnostics) and logged once with their address",
        "4 MiB in the kernel, then frames in the process",
        "nothing, unless it forges the server's address and ports",
        address_argument=True,
    ),
    Wire(
        "`emulated_motive`, `emulated_human`",
        ("emulated_motive", "emulated_human"),
        "NatNet",
        "udp",
        ANY,
        "1510, and any port to send frames from",
        "loopback, unless `ip` is set (in a bring-up: `mocap_server`)",
        "everybody who reaches it; by unicast, 32 clients",
        "none: datagrams, 100 requests between two frames",
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
        "loopback, unless `session` is empty: then the network",
        "programs with the same `session`",
        "30 s for each reader, then its oldest samples are dropped",
        "read the samples",
    ),
    Wire(
        "all programs with LSL: `emulated_emg`, `emulated_plate`, `emg`, `force_plate`",
        ("emulated_emg", "emulated_plate", "emg", "force_plate"),
        "LSL, discovery and clocks",
        "udp",
        (16571, 65535),
        "16571 to 16603, and any free port",
        "loopback, unless `session` is empty: then the network",
        "programs with the same `session`",
        "none: datagrams",
        "list the streams; offer a stream with the name of a device's stream",
    ),
    Wire(
        "`emulated_emg` as a Trigno server",
        ("emulated_emg",),
        "Trigno",
        "tcp",
        ANY,
        "50040 and 50043",
        "loopback, unless `ip` is set",
        "everybody who reaches it, 16 on each port; the end of the connection that started the samples stops them",
        "the socket's buffer, then the client is disconnected",
        "read the samples, start and stop them",
        address_argument=True,
    ),
    Wire(
        "`window`, `hric view` and `hric try`: windows in a browser",
        ("window", "view", "try"),
        "HTTP and WebSocket",
        "tcp",
        ANY,
        "8090, or `port`",
        "loopback; `host` opens it",
        "who knows the token of the printed address, from a page of this server, 20 at a time",
        "one frame; a slow viewer gets fewer",
        "nothing without the token; with it look on, and with `control:=true` command the robot while nobody else does",
        address_argument=True,
    ),
    Wire(
        "`ur_controller`",
        ("ur_controller",),
        "RTDE, control script and dashboard of Universal Robots",
        "tcp",
        (29999, 30004),
        "29999, 30003 and 30004",
        "loopback, unless `--ip` is set",
        "everybody who reaches it; an input register has one writer. Up to 64 connections; beyond that, the oldest one "
        "that has sent nothing is closed",
        "one state, and 64 KiB of responses, then the client is disconnected",
        "move the emulated arm",
        address_argument=True,
    ),
    Wire(
        "`control_box`, `emulated_arm`",
        ("control_box", "emulated_arm"),
        "FCI, requests",
        "tcp",
        (1337, 1339),
        "1337; with a hand also 1338, with a vacuum gripper 1339",
        "loopback (in a bring-up 127.0.0.1), unless `ip` is set",
        "the first client that completes the handshake within 1 s, until it disconnects. Up to 64 connections may be "
        "in the handshake; beyond that, the oldest one from the address with the most connections is closed",
        "1 MiB of responses, then the client is disconnected",
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
        "the same as for its requests",
        "only the client's address and port (connected socket)",
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
        "loopback if `robot_ip` is a loopback address; else all interfaces, as libfranka opens it",
        "anybody: libfranka accepts the first packet that arrives; keep the arm's network separate",
        "none: datagrams",
        "if it is open: forge states of the arm",
    ),
    Wire(
        "`scripts/scheduler`, `sweep --dask local`",
        ("dask", "sweep", "benchmark"),
        "Dask",
        "tcp",
        ANY,
        "8786, or `--port`; its web pages: any",
        "loopback, unless `--host` or `--interface` is given, with a certificate or `--insecure`. Its web pages: "
        "loopback",
        "with certificates, their owners; else everybody who reaches it",
        "Dask's own, in memory",
        "with `--insecure`: run programs as you",
    ),
    Wire(
        "`scripts/worker`",
        ("dask", "--multiprocessing-fork"),  # the second word is on the command line of Dask's child processes
        "Dask",
        "tcp",
        ANY,
        "any",
        "loopback if the scheduler is on loopback; else only with a certificate or `--insecure`",
        "with certificates, their owners; else everybody who reaches it",
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
"""All listening ports. Other programs, such as the Trigno client and sweeps, only connect to ports."""
COLUMNS = (
    "who listens",
    "protocol",
    "ports",
    "address, and what opens it",
    "permitted peers",
    "queue for each peer",
    "an attacker who reaches it can",
)


def is_local(host: str) -> bool:
    """Return True if all addresses of a host name are loopback addresses. Raises ValueError if it has no address."""
    try:
        addresses = {str(info[4][0]) for info in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError) as error:
        raise ValueError(f"{host} is not an address or a known host: {error}") from None
    parsed = [ip_address(address.partition("%")[0]) for address in addresses]
    return all((getattr(address, "ipv4_mapped", None) or address).is_loopback for address in parsed)


def host_of(text: str) -> str:
    """Return the host of an address, with or without a scheme, brackets and port; "" means all interfaces."""
    rest = text.rpartition("://")[2]
    if rest.startswith("["):
        return rest[1:].partition("]")[0]
    return rest if rest.count(":") > 1 else rest.partition(":")[0]


def reached_by_others(what: str, certificate: str) -> str:
    """Return the error text for a Dask port that other machines could reach without a certificate.

    Args:
        what: address, or option that opens the port.
        certificate: option that sets a certificate.
    """
    return (
        f"{what} can be reached from other machines, and whoever reaches it can run programs as you; valid: a "
        f"certificate ({certificate}), an address on loopback, or --insecure"
    )


def page() -> str:
    """Return the manual's page on network ports, as Markdown."""
    return "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    yield "# Who listens where\n"
    yield (
        "All network ports that programs of this workspace open. No port is open to other machines unless an argument "
        "opens it. This page is generated from the module `hric_core.wires`. A test compares the table with the ports "
        "of a running system in a separate network, in which another machine attacks them.\n"
    )
    yield f"| {' | '.join(COLUMNS)} |"
    yield "|---" * len(COLUMNS) + "|"
    for wire in WIRES:
        protocol = f"{wire.protocol} ({wire.transport.upper()})"
        cells = (wire.who, protocol, wire.port_text, wire.address, wire.speaks, wire.queue, wire.stranger)
        yield f"| {' | '.join(cells)} |"
