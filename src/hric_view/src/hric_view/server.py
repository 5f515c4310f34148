"""Server of the windows: pages by HTTP, and a WebSocket that carries the scene and its frames to each viewer.

Both require the token in the address that the server prints; the WebSocket also refuses pages of other origins, and
both refuse other names of this host, which guards against DNS rebinding. A viewer gets the newest frame whenever the
one before has left; a slow one gets fewer, and delays nobody. Messages of a viewer are accepted only by a window with a
receiver; the connection of a viewer that sends anything else is closed.
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
from websockets.sync.server import Server, ServerConnection, serve
from websockets.typing import Origin

from hric_core.errors import FailureError, HricError

LOOPBACK = "127.0.0.1"
PORT = 8090
"""TCP port of the window if it is free; project default."""
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
    """Response to a request by HTTP: the media type and the content."""

    kind: str
    body: bytes


@dataclass(frozen=True)
class Visit:
    """Request of a viewer with the right token.

    Attributes:
        path: path of the address.
        query: values of the query by name, without the token; of a name that is repeated the last value.
        socket: address of the WebSocket, without path and query.
        token: token of the server.
    """

    path: str
    query: Mapping[str, str]
    socket: str
    token: str = field(repr=False)

    def link(self, path: str, **query: str) -> str:
        """Return a relative address on this server, with the token."""
        return f"{path}?{urlencode({**query, 'token': self.token})}"


class ForeignMessageError(HricError):
    """Message that no page of this project sends; the connection of its sender is closed."""


class Viewer:
    """Connected viewer.

    Attributes:
        name: address and port of the viewer.

    Raises:
        OSError: the viewer has left.
    """

    def __init__(self, connection: ServerConnection) -> None:
        self._connection = connection
        self.name = ":".join(map(str, connection.remote_address[:2]))

    def tell(self, message: Mapping[str, object]) -> None:
        """Send a message to this viewer; do nothing if it has left."""
        self.send(json.dumps(message, allow_nan=False))

    def send(self, text: str) -> None:
        """Send a message, as JSON, to this viewer; do nothing if it has left."""
        with contextlib.suppress(ConnectionClosed):
            self._connection.send(text)


class WindowContents(Protocol):
    """Contents of a window."""

    def page(self, visit: Visit) -> WebPage | None:
        """Return the page at an address; None: there is none.

        Raises:
            HricError: there is no such page; the message becomes the response.
        """

    def scene(self, visit: Visit) -> str:
        """Return the first message of a viewer who connects to the WebSocket.

        Raises:
            HricError: there is no such scene; the viewer gets the message.
        """


class Receiver(Protocol):
    """Receiver of the messages of viewers; both methods are called in the thread of the viewer."""

    def receive(self, viewer: Viewer, message: Mapping[str, Any]) -> None:
        """Execute a message.

        Raises:
            ForeignMessageError: the message is none that a page sends; the connection is closed.
            HricError: the request is refused; the viewer gets the reason.
        """

    def leave(self, viewer: Viewer) -> None:
        """End what a viewer has begun: they have left."""


class ViewServer:
    """Server of a window, which listens from its construction on.

    Args:
        window: pages and scenes.
        host: address of this machine on which it listens.
        port: TCP port; 0: PORT, or a free one if another program listens there.
        receiver: receiver of the messages of viewers; None: the window takes none.

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
                f"the window cannot listen on {host!r}, all addresses; valid: one address of this machine"
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
        """Return the address of a page, with the token; query: "NAME=VALUE" pairs joined by "&"."""
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
            return _text(http.HTTPStatus.FORBIDDEN, "another name of this host; valid: the address that was printed\n")
        if not hmac.compare_digest(token.encode(), self._token.encode()):
            return _text(http.HTTPStatus.FORBIDDEN, "wrong or missing token; valid: the address that was printed\n")
        if address.path == "/socket":
            full = self.viewers >= MAX_VIEWERS
            return (
                _text(http.HTTPStatus.SERVICE_UNAVAILABLE, f"{MAX_VIEWERS} viewers are connected\n") if full else None
            )
        try:
            page = self._window.page(self._visit(request))
        except HricError as error:
            return _text(http.HTTPStatus.NOT_FOUND, f"{error}\n")
        if page is None:
            return _text(http.HTTPStatus.NOT_FOUND, "nothing here; valid: the address that was printed\n")
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
            while not self._ended and not connection.protocol.close_expected():
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
        """Hand the messages of a viewer to the receiver; close the connection at one that no page sends."""
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
        """Execute a message of a viewer; return False if no page sends it."""
        if self._receiver is None:
            return False
        try:
            message = from_text(text)
            self._receiver.receive(viewer, message)
        except ForeignMessageError:
            return False
        except HricError as error:
            viewer.tell({"type": "refused", "text": str(error)})
        return True


def from_text(text: str | bytes) -> dict[str, Any]:
    """Return a message of a viewer: a JSON object without NaN, infinities and repeated keys.

    Raises:
        ForeignMessageError: the text is none.
    """

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(dict(items)) < len(items):
            raise ValueError("repeated key")
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
        raise ForeignMessageError("not an object")
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
