"""Server of the window: one page by HTTP, and a WebSocket that carries the scene and its frames to each viewer.

Both require the token in the address that the server prints; the WebSocket also refuses pages of other origins, and
both refuse other names of this host, which guards against DNS rebinding. A viewer gets the newest frame whenever the
one before has left; a slow one gets fewer, and delays nobody.
"""

import hmac
import http
import os
import secrets
import socket
import threading
from collections.abc import Callable
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync.server import Server, ServerConnection, serve
from websockets.typing import Origin

from hric_core.errors import FailureError

LOOPBACK = "127.0.0.1"
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


class ViewServer:
    """Server of one window, which listens from its construction on.

    Args:
        page: returns the page, for the address of the WebSocket.
        scene: returns the first message of each viewer.
        host: address of this machine on which it listens.
        port: TCP port; 0: a free one.

    Attributes:
        address: address of the page, with the token.

    Raises:
        FailureError: the port is taken, or the host is no address of this machine.
    """

    def __init__(
        self, page: Callable[[str], str], scene: Callable[[], str], host: str = LOOPBACK, port: int = 0
    ) -> None:
        if host in ("", "0.0.0.0", "::"):
            raise FailureError(
                f"the window cannot listen on {host!r}, all addresses; valid: one address of this machine"
            )
        try:
            self._socket = socket.create_server((host, port))
        except OSError as error:
            code = error.errno or 0
            why = os.strerror(code) if code > 0 else error.strerror  # no address of that name: below 0
            raise FailureError(
                f"the window cannot listen on {host}, port {port}: {why}; valid: an address of this machine and a free "
                "port, or port 0 for any"
            ) from error
        self._token, self._scene = secrets.token_urlsafe(16), scene
        name = f"{host}:{self._socket.getsockname()[1]}"
        self._names = {name, name.replace(LOOPBACK, "localhost")}
        self.address = f"http://{name}/?token={self._token}"
        self._page = page(f"ws://{name}").encode()
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
        if address.path == "/":
            return _response(http.HTTPStatus.OK, "text/html", self._page)
        return _text(http.HTTPStatus.NOT_FOUND, "nothing here; valid: the address that was printed\n")

    def _serve(self, connection: ServerConnection) -> None:
        """Send scene and frames to one viewer until it leaves."""
        self._viewers.add(connection)
        threading.Thread(target=self._listen, args=(connection,), daemon=True).start()
        try:
            connection.send(self._scene())
            number = 0
            while not self._ended and not connection.protocol.close_expected():
                before, (frame, number) = number, self._after(number)
                if number != before:
                    connection.send(frame)
        except ConnectionClosed:
            pass
        finally:
            self._viewers.discard(connection)

    def _after(self, number: int) -> tuple[str, int]:
        """Return the newest frame and its number, as soon as it is not that number, or after IDLE at the latest."""
        with self._new:
            self._new.wait_for(lambda: self._number != number or self._ended, IDLE)
            return self._frame, self._number

    def _listen(self, connection: ServerConnection) -> None:
        """Close the connection of a viewer that sends anything: this window cannot be used for control."""
        try:
            connection.recv()
            connection.close(CLOSED_BY_POLICY, "this window takes no commands")
        except ConnectionClosed:
            pass


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
