"""NatNet client on UDP: sockets and a thread around a `Session`."""

import contextlib
import logging
import select
import socket
import threading
import time
from collections.abc import Callable
from typing import NamedTuple

from mocap_natnet.client.received import Received
from mocap_natnet.client.session import CONNECT_PERIOD, NAME, Session
from mocap_natnet.client.settings import ClientSettings, Route
from mocap_natnet.codec import CodecError, text
from mocap_natnet.codec.descriptions import ServerModel
from mocap_natnet.codec.packets import HEADER, MAX_PAYLOAD, NAME_SIZE, NatNetMessage, packet, split

LOG = logging.getLogger("hric.mocap_natnet")
OK, WARN, ERROR = 0, 1, 2
"""Levels as in diagnostic_msgs/DiagnosticStatus."""
POLL = 0.02
"""Longest time that the client's thread waits for datagrams [s]."""
SEND_PERIOD = 10_000_000
"""Minimum time between checks for messages to send [ns] (project default, unconfirmed)."""
RECEIVE_BUFFER = 1 << 22
"""Requested size of the kernel's receive buffer [bytes]; enough for seconds of frames. The kernel may give less."""
STRANGERS = 16
"""Largest number of unknown senders named in the log, once each (project default, unconfirmed).

Datagrams of further ones are only counted.
"""
STRANGER = "stranger"
_FRAME = HEADER.pack(NatNetMessage.FRAMEOFDATA, 0)[:2]


def datagram_socket() -> socket.socket:
    """Return a UDP socket without time-out.

    rospy sets a time-out of 60 s for all new sockets of its process (`socket.setdefaulttimeout`); with one, Python
    waits for a datagram even with MSG_DONTWAIT.
    """
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.settimeout(None)
    return made


class ClientHealth(NamedTuple):
    """Health of the connection to a NatNet server, for diagnostics: level and text."""

    level: int
    text: str


def health(session: Session, server: str, now: int, trouble: str = "") -> ClientHealth:
    """Return the health of a NatNet session.

    Args:
        session: session of the client.
        server: address of the server, "" while it is searched for.
        now: monotonic clock [ns].
        trouble: error of the sockets, or "".
    """
    command_silent, data_silent = session.silent(now)
    if trouble and (command_silent or data_silent):
        return ClientHealth(ERROR, trouble)
    if session.complaint:
        return ClientHealth(ERROR, session.complaint)
    if session.info is None or command_silent:
        return ClientHealth(WARN if not data_silent else ERROR, _no_response(session, server))
    if data_silent:
        return ClientHealth(ERROR, _no_frames(session))
    echo = session.clock.echo
    if echo is not None and not echo.synchronised:
        return ClientHealth(
            WARN, "frames arrive, but the server does not respond to clock echoes: times of exposure are estimates"
        )
    return ClientHealth(
        OK, f"{session.statistics.rate(now):.0f} frames per second arrive in bitstream {text(session.info.version)}"
    )


def _no_response(session: Session, server: str) -> str:
    port = session.settings.command_port
    if not server:
        return (
            "command channel silent: no server responds to the discovery sent to "
            f"{session.settings.discovery}:{port}; set the parameter server to Motive's address"
        )
    return (
        f"command channel silent: {server}:{port} does not respond; check that this is Motive's address, that its "
        f"streaming is on, and that no firewall blocks UDP port {port}"
    )


def _no_frames(session: Session) -> str:
    route, info, refused = session.route, session.info, session.statistics.refused.copy()
    assert route is not None and info is not None
    parts = ["data channel silent: the server responds, but no frame arrives"]
    if info.multicast and not route.multicast:
        parts.append("it streams to a group while unicast is requested: set transport to auto")
    elif info.multicast is False and not route.unicast:
        parts.append("it streams by unicast while multicast is requested: set transport to auto")
    elif route.multicast and info.group and route.group != info.group:
        parts.append(
            f"it streams to group {info.group}, this client listens to {route.group}: correct or leave out the group"
        )
    elif info.data_port and route.port != info.data_port:
        parts.append(
            f"it streams to port {info.data_port}, this client listens to {route.port}: correct or leave out the "
            "data port"
        )
    elif route.multicast:
        parts.append(
            f"group {route.group}:{route.port}: check that `local` is the address of the network card that faces the "
            "server, and that Motive is in live mode"
        )
    else:
        parts.append("check that Motive is in live mode, and that no firewall blocks UDP from the server")
    if refused:
        counts = ", ".join(f"{reason} {count}" for reason, count in sorted(refused.items()))
        parts.append(f"datagrams refused so far: {counts}")
    return "; ".join(parts)


class NatNetClient:
    """NatNet client in a separate thread. Use as a context, or `start()` and `close()`.

    The callbacks run in that thread and must be quick: while one runs, frames wait in the kernel.

    Args:
        settings: settings of the connection.
        on_frame: callback for each frame that is newer than those before.
        on_model: callback for each description of the server's bodies.
        on_restart: callback when the stream restarts or is another one.
        work: function that does one piece of additional work in that thread, after the arrived datagrams were
            processed; it returns True if work is left.
    """

    def __init__(
        self,
        settings: ClientSettings,
        on_frame: Callable[[Received], None] = lambda frame: None,
        on_model: Callable[[ServerModel], None] = lambda model: None,
        on_restart: Callable[[], None] = lambda: None,
        work: Callable[[], bool] = lambda: False,
    ) -> None:
        self.settings, self._work = settings, work
        self.session = Session(settings, on_frame, on_model, on_restart)
        self._server = settings.server
        self._command = datagram_socket()
        self._command.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._command.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._command.bind((self._facing(settings.server or settings.discovery), 0))
        self._frames_from = 0
        self._strangers: set[str] = set()
        self._data: list[socket.socket] = []
        self._route: Route | None = None
        self._trouble = self._send_trouble = ""
        self._next_discovery = self._next_route = 0
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def server(self) -> str:
        """Address of the server, "" while it is searched for."""
        return self._server

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._run, name="natnet client", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Disconnect and stop the thread; no callback runs afterwards."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        with contextlib.suppress(OSError):
            if self._server:
                self._command.sendto(packet(NatNetMessage.DISCONNECT), (self._server, self.settings.command_port))
        for sock in (self._command, *self._data):
            sock.close()

    def __enter__(self) -> "NatNetClient":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def request(self, words: str, timeout: float = 2.0) -> bytes:
        """Send a request, wait for its response and return it; not from a callback. Raises CommandError."""
        return self.session.requests.send(words, timeout)

    def health(self) -> ClientHealth:
        """Return the health of the connection to the server."""
        return health(self.session, self._server, time.monotonic_ns(), self._trouble or self._send_trouble)

    def _run(self) -> None:
        left, due = False, 0
        while not self._stop.is_set():
            now = time.monotonic_ns()
            if now >= due:
                due = now + SEND_PERIOD
                self._send(now)
                self._listen()
            ready, _, _ = select.select([self._command, *self._data], [], [], 0.0 if left else POLL)
            for sock in ready:
                self._drain(sock)
            left = self._work()

    def _drain(self, sock: socket.socket) -> None:
        """Process the arrived datagrams, at most as many as fit between two polls."""
        for _ in range(200):
            try:
                datagram, sender = sock.recvfrom(MAX_PAYLOAD + 5, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except OSError:  # the network reports that nobody listens on a port
                continue
            now = time.monotonic_ns()
            if refusal := self._refusal(sock, datagram, sender, now):
                self.session.statistics.refused[refusal] += 1
            else:
                self.session.receive(datagram, now)

    def _refusal(self, sock: socket.socket, datagram: bytes, sender: tuple[str, int], now: int) -> str:
        """Return the reason why a datagram that arrived at `now` [ns] is refused; empty: it is accepted.

        If no server is set, the first sender of server information becomes the server. Frames are accepted from one of
        its ports, and from another one when these frames have stopped; all other messages only from its command port.
        """
        (address, port), frame = sender, datagram.startswith(_FRAME)
        if not self._server and port == self.settings.command_port:
            with contextlib.suppress(CodecError):
                if split(datagram)[0] == NatNetMessage.SERVERINFO:
                    self._server = address
        believed = address == self._server
        if frame and believed and port != self._frames_from:
            believed = not self._frames_from or self.session.silent(now)[1]
            self._frames_from = port if believed else self._frames_from
        elif not frame:
            believed = believed and (sock is not self._command or port == self.settings.command_port)
        if believed:
            return "" if frame or sock is self._command else "no frame on the data channel"
        if address not in self._strangers and len(self._strangers) < STRANGERS:
            self._strangers.add(address)
            server = f"{self._server}:{self.settings.command_port}" if self._server else "a server that responds"
            LOG.warning("packets of %s:%d are refused: only %s is accepted (reported once)", address, port, server)
        return STRANGER

    def _send(self, now: int) -> None:
        if self._server:
            datagrams, where = self.session.poll(now), self._server
        elif now >= self._next_discovery:
            self._next_discovery = now + CONNECT_PERIOD
            datagrams, where = (
                [packet(NatNetMessage.DISCOVERY, NAME.encode().ljust(NAME_SIZE + 8, b"\0"))],
                self.settings.discovery,
            )
        else:
            return
        for datagram in datagrams:
            try:
                self._command.sendto(datagram, (where, self.settings.command_port))
                self._send_trouble = ""
            except OSError as error:
                self._send_trouble = f"command channel: cannot send to {where}: {error.strerror or error}"

    def _listen(self) -> None:
        """Open the sockets on which frames are expected, whenever these change; try again after an error."""
        route = self.session.route
        now = time.monotonic_ns()
        if route is None or (route == self._route and (not self._trouble or now < self._next_route)):
            return
        for sock in self._data:
            sock.close()
        self._data, self._route, self._trouble, self._next_route = [], route, "", now + CONNECT_PERIOD
        if route.multicast:
            self._open(route.group, route.port, route.group)
        if route.unicast:
            self._open(self._facing(self._server), route.port, "")

    def _open(self, address: str, port: int, group: str) -> None:
        sock = datagram_socket()
        try:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            sock.bind((address, port))
            if group:
                sock.setsockopt(
                    socket.IPPROTO_IP,
                    socket.IP_ADD_MEMBERSHIP,
                    socket.inet_aton(group) + socket.inet_aton(self._local()),
                )
        except OSError as error:
            sock.close()
            if group:  # unicast frames may also arrive on the command socket
                self._trouble = (
                    f"data channel: cannot join group {group}:{port} on {self._local()}: "
                    f"{error.strerror or error}; set `local` to the address of the card that faces the server"
                )
            return
        self._data.append(sock)

    def _local(self) -> str:
        """Return the address of the network card that faces the server, as set or as found."""
        return self.settings.local or self._facing(self._server)

    def _facing(self, peer: str) -> str:
        """Return the address of this machine by which `peer` is reached; 0.0.0.0 if that is unknown."""
        with datagram_socket() as probe:
            try:
                probe.connect((peer, self.settings.command_port))
            except OSError:
                return "0.0.0.0"
            return str(probe.getsockname()[0])
