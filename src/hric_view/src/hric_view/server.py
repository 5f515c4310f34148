"""Server of the windows: pages by HTTP, and a WebSocket that carries the scene and its frames to each viewer.

Both require the token in the address that the server prints, and refuse requests by another name of this host, which
protects against DNS rebinding; the WebSocket also refuses pages of other origins. A viewer gets the newest frame as
soon as the previous one has been sent: a slow viewer gets fewer frames, and does not delay others. A window accepts
messages of viewers only if it has a receiver; the connection of a viewer that sends anything else is closed.
"""

import contextlib
import hmac
import http
import json
import math
import os
import secrets
import socket
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol
from urllib.parse import parse_qs, urlencode, urlsplit

from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.protocol import State
from websockets.sync.server import Server, ServerConnection, serve
from websockets.typing import Origin

from hric_core.errors import FailureError, HricError

LOOPBACK = "127.0.0.1"
PORT = 8090
"""TCP port of a window that is started with port 0, if this port is free; project default."""
MAX_MESSAGE = 4096
"""Largest message that a viewer may send [bytes]."""
MAX_VIEWERS = 20
"""Largest number of viewers at a time; project default, unconfirmed."""
CLOSED_BY_POLICY = 1008
"""Code of RFC 6455 for a message that breaks the rules of the server."""
PATIENCE = 1.0
"""Longest wait for the request of a new connection, and for the response when one is closed [s]; project default."""
IDLE = 0.5
"""Longest wait for a frame until a viewer is looked after again [s]."""


HTML = "text/html"


class WebPage(NamedTuple):
    """Content of the response to an HTTP request, with its media type."""

    kind: str
    body: bytes


@dataclass(frozen=True)
class Visit:
    """Request of a browser whose token is right.

    Attributes:
        path: path of the address.
        query: values of the query by name, without the token; if a name is repeated, its last value.
        socket: address of the WebSocket, without path and query.
        token: token of the server.
    """

    path: str
    query: Mapping[str, str]
    socket: str
    token: str = field(repr=False)

    def link(self, path: str, **query: str) -> str:
        """Return the relative address of another page of this server, with the token and the values of a query."""
        return f"{path}?{urlencode({**query, 'token': self.token})}"


class ForeignMessageError(HricError):
    """Error of a message that no page of this project sends; the server closes the connection of its sender."""


class Viewer:
    """Browser that is connected by a WebSocket.

    Attributes:
        name: address and port of the viewer.

    Raises:
        OSError: the browser has disconnected.
    """

    def __init__(self, connection: ServerConnection) -> None:
        self._connection = connection
        self.name = ":".join(map(str, connection.remote_address[:2]))

    def tell(self, message: Mapping[str, object]) -> None:
        """Send a message, as JSON, to this viewer; do nothing if it has disconnected."""
        self.send(json.dumps(message, allow_nan=False))

    def send(self, text: str) -> None:
        """Send a message that is already JSON to this viewer; do nothing if it has disconnected."""
        with contextlib.suppress(ConnectionClosed):
            self._connection.send(text)


class WindowContents(Protocol):
    """Interface to the contents of a window: its pages and the first messages of its WebSocket."""

    def page(self, visit: Visit) -> WebPage | None:
        """Return the page at an address; None: the window has no page there.

        Raises:
            HricError: the page cannot be made, e.g. the run does not exist; the browser shows the message.
        """

    def scene(self, visit: Visit) -> str:
        """Return the first message for a viewer who connects to the WebSocket, as JSON.

        Raises:
            HricError: the message cannot be made, e.g. the run does not exist; the page shows the reason.
        """


class Receiver(Protocol):
    """Interface to the receiver of viewers' messages; both methods are called in a thread for each viewer."""

    def receive(self, viewer: Viewer, message: Mapping[str, Any]) -> None:
        """Execute the request in a message.

        Raises:
            ForeignMessageError: no page sends such a message; the connection is closed.
            HricError: the request is refused; the page shows the reason.
        """

    def leave(self, viewer: Viewer) -> None:
        """Release what a viewer holds, such as control of the robot, since they have disconnected."""


class ViewServer:
    """HTTP and WebSocket server of a window; it listens from its construction on.

    Args:
        window: pages and scenes.
        host: address of this machine on which it listens.
        port: TCP port; 0: PORT, or a free one if another program listens there.
        receiver: receiver of the viewers' messages; None: the connection of a viewer that sends one is closed.

    Attributes:
        address: address of the first page, with the token.

    Raises:
        FailureError: the port is taken, or the host is not an address of this machine.
    """

    def __init__(
        self, window: WindowContents, host: str = LOOPBACK, port: int = 0, receiver: Receiver | None = None
    ) -> None:
        if host in ("", "0.0.0.0", "::"):
            raise FailureError(
                f"the window does not listen on {host!r}, all addresses of this machine; valid: one of them"
            )
        self._socket = _listening(host, port)
        self._token, self._window, self._receiver = secrets.token_urlsafe(16), window, receiver
        name = f"{host}:{self._socket.getsockname()[1]}"
        self._names = {name, name.replace(LOOPBACK, "localhost")}
        self.address = f"http://{name}/?token={self._token}"
        self._frame, self._number, self._new = "", 0, threading.Condition()
        self._viewers: set[ServerConnection] = set()
        self._ended = False
        self._server: Server = serve(
            self._serve,
            sock=self._socket,
            origins=[Origin(f"http://{name}") for name in self._names],
            process_request=self._respond,
            max_size=MAX_MESSAGE,
            compression=None,
            open_timeout=PATIENCE,
            close_timeout=PATIENCE,
            server_header=None,
        )
        self._thread = threading.Thread(target=self._server.serve_forever, name="window", daemon=True)
        self._thread.start()

    @property
    def viewers(self) -> int:
        """Number of viewers."""
        return len(self._viewers)

    def link(self, path: str, query: str = "") -> str:
        """Return the full address of a page, with the token.

        Args:
            path: path of the page, which begins with "/".
            query: pairs "NAME=VALUE" joined by "&".
        """
        begin, _, token = self.address.partition("/?")
        return f"{begin}{path}?{query}{'&' * bool(query)}{token}"

    def send(self, frame: str) -> None:
        """Hand a frame to all viewers; never blocks on one."""
        with self._new:
            self._frame, self._number = frame, self._number + 1
            self._new.notify_all()

    def close(self) -> None:
        """Close all connections and stop listening."""
        with self._new:
            self._ended = True
            self._new.notify_all()
        self._server.shutdown()
        self._thread.join()

    def _respond(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the page, or a refusal; None: go on with the handshake of a WebSocket."""
        address = urlsplit(request.path)
        token = parse_qs(address.query).get("token", [""])[0]
        if request.headers.get("Host", "") not in self._names:
            return _text(
                http.HTTPStatus.FORBIDDEN,
                "this name of the host is refused; open the address that the program printed\n",
            )
        if not hmac.compare_digest(token.encode(), self._token.encode()):
            return _text(
                http.HTTPStatus.FORBIDDEN, "wrong or missing token; open the address that the program printed\n"
            )
        if address.path == "/socket":
            full = self.viewers >= MAX_VIEWERS
            return (
                _text(http.HTTPStatus.SERVICE_UNAVAILABLE, f"{MAX_VIEWERS} viewers are connected; close another page\n")
                if full
                else None
            )
        try:
            page = self._window.page(self._visit(request))
        except HricError as error:
            return _text(http.HTTPStatus.NOT_FOUND, f"{error}\n")
        if page is None:
            return _text(
                http.HTTPStatus.NOT_FOUND, "there is no such page; open the address that the program printed\n"
            )
        return _response(http.HTTPStatus.OK, *page)

    def _visit(self, request: Request) -> Visit:
        address = urlsplit(request.path)
        query = {name: values[-1] for name, values in parse_qs(address.query).items() if name != "token"}
        return Visit(address.path, query, f"ws://{request.headers['Host']}", self._token)

    def _serve(self, connection: ServerConnection) -> None:
        """Send scene and frames to one viewer until it leaves."""
        assert connection.request is not None
        try:
            viewer = Viewer(connection)
        except OSError:  # they have left already
            return
        self._viewers.add(connection)
        threading.Thread(target=self._listen, args=(connection, viewer), daemon=True).start()
        try:
            connection.send(self._window.scene(self._visit(connection.request)))
            number = 0
            while not self._ended and connection.protocol.state is State.OPEN:
                before, (frame, number) = number, self._after(number)
                if number != before:
                    connection.send(frame)
        except ConnectionClosed:
            pass
        except HricError as error:
            viewer.tell({"type": "refused", "text": str(error)})
        finally:
            self._viewers.discard(connection)

    def _after(self, number: int) -> tuple[str, int]:
        """Return the newest frame and its number, as soon as it is not that number, or after IDLE at the latest."""
        with self._new:
            self._new.wait_for(lambda: self._number != number or self._ended, IDLE)
            return self._frame, self._number

    def _listen(self, connection: ServerConnection, viewer: Viewer) -> None:
        """Pass the messages of a viewer to the receiver; close the connection at a message that no page sends."""
        try:
            while self._obeyed(viewer, connection.recv()):
                pass
            connection.close(CLOSED_BY_POLICY, "not a message of this window")
        except ConnectionClosed:
            pass
        finally:
            if self._receiver is not None:
                self._receiver.leave(viewer)

    def _obeyed(self, viewer: Viewer, text: str | bytes) -> bool:
        """Execute a message of a viewer; return False if it is one that no page sends."""
        if self._receiver is None:
            return False
        try:
            self._receiver.receive(viewer, from_text(text))
        except ForeignMessageError:
            return False
        except HricError as error:
            viewer.tell({"type": "refused", "text": str(error)})
        return True


def from_text(text: str | bytes) -> dict[str, Any]:
    """Return the object in a JSON text that a viewer has sent.

    Raises:
        ForeignMessageError: the text is no JSON object, or has NaN, infinities or repeated keys.
    """

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(dict(items)) < len(items):
            raise ValueError("a key is repeated")
        return dict(items)

    def number(text: str) -> float:
        if not math.isfinite(value := float(text)):
            raise ValueError(text)
        return value

    try:
        message = json.loads(text, object_pairs_hook=pairs, parse_constant=number, parse_float=number)
    except (ValueError, RecursionError) as error:  # RecursionError: nested too deeply
        raise ForeignMessageError(str(error)) from error
    if not isinstance(message, dict):
        raise ForeignMessageError("the message is not a JSON object")
    return message


def _listening(host: str, port: int) -> socket.socket:
    """Return a listening socket; see ViewServer for port 0 and for the errors."""
    if port == 0:
        with contextlib.suppress(OSError):
            return socket.create_server((host, PORT))
    try:
        return socket.create_server((host, port))
    except OSError as error:
        code = error.errno or 0
        why = os.strerror(code) if code > 0 else error.strerror  # no address of that name: below 0
        raise FailureError(
            f"the window cannot listen on {host}, port {port}: {why}; valid: an address of this machine and a free "
            "port, or port 0 for any"
        ) from error


def _text(status: http.HTTPStatus, text: str) -> Response:
    return _response(status, "text/plain", text.encode())


def _response(status: http.HTTPStatus, kind: str, body: bytes) -> Response:
    headers = {
        "Content-Type": f"{kind}; charset=utf-8",
        "Content-Length": str(len(body)),
        "Cache-Control": "no-store",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
        "Connection": "close",
    }
    return Response(status.value, status.phrase, Headers(headers), body)
