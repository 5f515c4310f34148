"""Service of the control box: listens on one TCP port, does the handshake, and serves one client.

Further connections and invalid data do not disturb it.
"""

import logging
import selectors
import socket
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from franka_sim.fci.complaints import LOG, Complaints
from franka_sim.fci.connection import BadMessageError, FciConnection, FciMessage, PeerClosedError
from franka_sim.fci.faults import DatagramLink, NetworkFaults, make_link
from franka_sim.fci.wire import CONNECT, CONNECT_PAYLOAD, VERSION, Framing
from hric_core.errors import FailureError

HANDSHAKE_TIME = 1.0
"""Time after which a connection without a handshake is closed [s]: project default, unconfirmed."""
MAX_WAITING = 64
"""Maximum number of connections in the handshake (project default, unconfirmed).

Beyond it, the oldest connection of the address with the most connections is closed.
"""
ACCEPTED = 16
"""Maximum number of connections accepted in a row; then other sockets get a turn (project default, unconfirmed)."""
INCOMPATIBLE = 1
"""Status in the response to Connect for a client with another protocol version."""

READ, WRITE = selectors.EVENT_READ, selectors.EVENT_WRITE


@dataclass
class Client:
    """Client with a completed handshake; `since`: time of the handshake (time.monotonic) [s]."""

    connection: FciConnection
    link: DatagramLink
    name: str
    since: float


class Service(ABC):
    """Service at one TCP port of the emulated control box: of the arm or of the hand.

    Args:
        selector: selector of the server; the data of each key is a callback with the events as argument.
        name: name for the log, e.g. "arm".
        framing: layout of header and status of the messages.
        version: protocol version.
        address: (ip, port) to listen on.
        faults: faults of the UDP link.

    Raises:
        HricError: the address is not available.
    """

    def __init__(
        self,
        selector: selectors.BaseSelector,
        name: str,
        framing: Framing,
        version: int,
        address: tuple[str, int],
        faults: NetworkFaults,
    ) -> None:
        self._selector, self.name, self._framing, self._version, self._address, self._faults = (
            selector,
            name,
            framing,
            version,
            address,
            faults,
        )
        self.complaints = Complaints(f"{name} {address[0]}")
        self._brief = Complaints(f"{name} {address[0]}")  # for clients that leave within HANDSHAKE_TIME
        self.client: Client | None = None
        self._waiting: dict[FciConnection, tuple[str, float]] = {}
        self._listener = listen(address, name)
        selector.register(self._listener, READ, self._on_listener)

    @abstractmethod
    def size_of(self, command: int) -> int | None:
        """Return the payload size of a request [bytes], None if there is no request with this id."""

    @abstractmethod
    def handle(self, message: FciMessage) -> None:
        """Handle a request of the connected client."""

    @abstractmethod
    def on_client(self) -> None:
        """Handle a new client."""

    @abstractmethod
    def on_client_lost(self) -> None:
        """Handle the end of a client's connection."""

    @abstractmethod
    def on_datagrams(self) -> None:
        """Read the client's datagrams that wait in its link."""

    def respond(self, message: FciMessage, status: int, tail: bytes = b"") -> None:
        """Respond to the connected client, if any."""
        if self.client is not None:
            connection = self.client.connection
            self._guarded(connection, lambda: connection.respond(message.command, message.command_id, status, tail))
            self._watch(connection)

    def housekeeping(self, now: float) -> None:
        """Close connections that did not complete the handshake in time. now: time.monotonic [s]."""
        for connection, (peer, since) in list(self._waiting.items()):
            if now - since > HANDSHAKE_TIME:
                self._drop(connection, f"{peer} is disconnected: no handshake within {HANDSHAKE_TIME:g} s")

    def close(self) -> None:
        """Close all connections and the port."""
        for connection in list(self._waiting):
            self._drop(connection, "")
        if self.client is not None:
            self._end_client("is disconnected: the control box shuts down")
        self._selector.unregister(self._listener)
        self._listener.close()

    # -- connections ---------------------------------------------------------------------------------------------------

    def _on_listener(self, _: int) -> None:
        for _ in range(ACCEPTED):
            try:
                connected, (host, port) = self._listener.accept()
            except OSError:
                return
            self._greet(connected, f"{host}:{port}")

    def _greet(self, connected: socket.socket, peer: str) -> None:
        if self.client is not None:
            self._on_connection(self.client.connection, READ)  # it may just have disconnected
        if self.client is not None:
            self.complaints.warn_of(_host(peer), f"{peer} is refused: another client, {self.client.name}, is connected")
            connected.close()
            return
        connection = FciConnection(connected, self._framing, self.size_of)
        self._waiting[connection] = peer, time.monotonic()
        self._selector.register(connected, READ, lambda events: self._on_connection(connection, events))
        self._on_connection(connection, READ)
        if len(self._waiting) > MAX_WAITING:
            self._make_room()

    def _make_room(self) -> None:
        """Close the oldest connection in the handshake, of the address with the most of them."""
        hosts = {connection: _host(peer) for connection, (peer, _) in self._waiting.items()}
        crowd = Counter(hosts.values()).most_common(1)[0][0]
        oldest = next(connection for connection, host in hosts.items() if host == crowd)
        self._on_connection(oldest, READ)  # its handshake may just have arrived
        if oldest in self._waiting:
            peer = self._waiting[oldest][0]
            self._drop(oldest, f"{peer} is refused: more than {MAX_WAITING} connections wait for a handshake")

    def _on_connection(self, connection: FciConnection, events: int) -> None:
        if events & WRITE:
            self._guarded(connection, connection.flush)
            self._watch(connection)
        if events & READ and self._known(connection):
            self._guarded(connection, lambda: self._receive(connection))

    def _receive(self, connection: FciConnection) -> None:
        for message in connection.receive():
            if self.client is not None and connection is self.client.connection:
                if message.command == CONNECT:
                    raise BadMessageError("the client sent Connect a second time")
                self.handle(message)
            elif connection in self._waiting:
                self._shake_hands(connection, message)

    def _shake_hands(self, connection: FciConnection, message: FciMessage) -> None:
        if message.command != CONNECT:
            raise BadMessageError(f"the client sent request {message.command} before Connect")
        version, udp_port = CONNECT_PAYLOAD.unpack(message.payload)
        if version != self._version:
            connection.respond(CONNECT, message.command_id, INCOMPATIBLE, VERSION.pack(self._version))
            raise BadMessageError(
                f"the client has protocol version {version}, this control box {self._version}; valid: another "
                "libfranka, or another --robot"
            )
        peer, _ = self._waiting[connection]
        if self.client is not None:
            raise BadMessageError(f"another client, {self.client.name}, is connected")
        if udp_port == 0:
            raise BadMessageError("the client sent UDP port 0")
        try:
            link = make_link(self._address[0], (_host(peer), udp_port), self._faults)
        except OSError as error:
            raise BadMessageError(f"UDP port {udp_port} of the client cannot be reached: {error}") from None
        del self._waiting[connection]
        self.client = Client(connection, link, peer, time.monotonic())
        self._selector.register(link.socket, READ, lambda _: self.on_datagrams())
        if not self._brief.counts(_host(peer)):
            LOG.info("%s %s: %s is connected", self.name, self._address[0], peer)
        connection.respond(CONNECT, message.command_id, 0, VERSION.pack(self._version))
        self.on_client()

    # -- ends ----------------------------------------------------------------------------------------------------------

    def _known(self, connection: FciConnection) -> bool:
        return connection in self._waiting or (self.client is not None and connection is self.client.connection)

    def _guarded(self, connection: FciConnection, action: Callable[[], None]) -> None:
        try:
            action()
        except (BadMessageError, PeerClosedError) as error:
            bad = isinstance(error, BadMessageError)
            if self.client is not None and connection is self.client.connection:
                self._end_client(f"is disconnected: {error}" if bad else f"has left: {error}")
            elif connection in self._waiting:
                self._drop(connection, f"{self._waiting[connection][0]} is refused: {error}" if bad else "")

    def _watch(self, connection: FciConnection) -> None:
        with suppress(KeyError, ValueError):  # closed in the meantime
            key = self._selector.get_key(connection.socket)
            events = READ | WRITE if connection.unsent else READ
            if key.events != events:
                self._selector.modify(connection.socket, events, key.data)

    def _drop(self, connection: FciConnection, text: str) -> None:
        if text:
            self.complaints.warn_of(_host(self._waiting[connection][0]), text)
        del self._waiting[connection]
        self._selector.unregister(connection.socket)
        connection.close()

    def _end_client(self, text: str) -> None:
        client, self.client = self.client, None
        assert client is not None
        if time.monotonic() - client.since < HANDSHAKE_TIME:
            self._brief.warn_of(_host(client.name), f"{client.name}, connected for less than 1 s, {text}", logging.INFO)
        else:
            LOG.info("%s %s: %s %s", self.name, self._address[0], client.name, text)
        self._selector.unregister(client.connection.socket)
        self._selector.unregister(client.link.socket)
        client.connection.close()
        client.link.close()
        self.on_client_lost()


def _host(peer: str) -> str:
    return peer.rpartition(":")[0]


def listen(address: tuple[str, int], name: str) -> socket.socket:
    """Return a non-blocking socket that listens at an (ip, port); name: service, for the error message.

    Raises:
        HricError: the address does not belong to this machine, or is in use.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setblocking(False)
        listener.bind(address)
        listener.listen(MAX_WAITING)
    except OSError as error:
        listener.close()
        raise FailureError(
            f"the {name} service cannot listen on {address[0]}:{address[1]}: {error.strerror or error}"
        ) from None
    return listener
