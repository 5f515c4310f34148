"""Requests to a NatNet server, sent one at a time, because responses have no sequence number."""

import threading
from collections import deque
from dataclasses import dataclass, field

from hric_core.errors import CommandError
from mocap_natnet.codec.packets import NatNetMessage, packet

RETRY_PERIOD = 100_000_000
"""Time between attempts of one request [ns] (project default, unconfirmed; the vendor's library waits for 20 ms)."""
ATTEMPTS = 10
"""Number of attempts of one request, as in the vendor's library."""


@dataclass
class _Request:
    words: str
    done: threading.Event = field(default_factory=threading.Event)
    response: bytes | None = None
    failure: str = ""
    attempts: int = 0
    due: int = 0


class Requests:
    """Queue of requests to the server; `send` is called by other threads, the rest by the session's thread."""

    def __init__(self) -> None:
        self._waiting: deque[_Request] = deque()

    def send(self, words: str, timeout: float = 2.0) -> bytes:
        """Send a request and wait for its response.

        Args:
            words: text of the request, e.g. "StartRecording".
            timeout: time-out [s].

        Returns:
            the payload of the response.

        Raises:
            CommandError: the server does not know the request or does not respond.
        """
        if "\0" in words or len(words.encode()) > 1000:
            raise CommandError(f"request {words[:40]!r}: it contains a NUL or is longer than 1000 bytes")
        request = _Request(words)
        self._waiting.append(request)
        if not request.done.wait(timeout):
            request.attempts = ATTEMPTS  # so that `poll` removes it
            request.failure = f"the server does not respond to the request {words!r} within {timeout:g} s"
        if request.failure or request.response is None:
            raise CommandError(request.failure)
        return request.response

    def poll(self, now: int) -> list[bytes]:
        """Return the datagrams to be sent at a time of the monotonic clock [ns]."""
        while self._waiting:
            request = self._waiting[0]
            if now < request.due:
                return []
            if request.attempts < ATTEMPTS:
                request.attempts, request.due = request.attempts + 1, now + RETRY_PERIOD
                return [packet(NatNetMessage.REQUEST, request.words.encode() + b"\0")]
            self._end(f"the server does not respond to the request {request.words!r}")
        return []

    def respond(self, payload: bytes | None) -> None:
        """Process the payload of a response to the oldest request; None: the server does not know that request."""
        if not self._waiting or not self._waiting[0].attempts:
            return
        request = self._waiting[0]
        request.response = payload
        self._end("" if payload is not None else f"the server does not know the request {request.words!r}")

    def _end(self, failure: str) -> None:
        request = self._waiting.popleft()
        request.failure = failure
        request.done.set()
