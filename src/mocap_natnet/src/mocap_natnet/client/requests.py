"""Requests to the server, one at a time: the protocol gives answers no number."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass, field

from hric_control.errors import CommandError
from mocap_natnet.codec.packets import Message, packet

RETRY_PERIOD = 100_000_000
"""Between attempts [ns] (our choice; the vendor's library waits for 20 ms)."""
ATTEMPTS = 10
"""As the vendor's library."""


@dataclass
class _Request:
    words: str
    done: threading.Event = field(default_factory=threading.Event)
    answer: bytes | None = None
    failure: str = ""
    attempts: int = 0
    due: int = 0


class Requests:
    """`ask` belongs to other threads, the rest to the thread of the session."""

    def __init__(self) -> None:
        self._waiting: deque[_Request] = deque()

    def ask(self, words: str, timeout: float = 2.0) -> bytes:
        """Send a request and wait for its answer.

        Args:
            words: e.g. "StartRecording".
            timeout: [s].

        Returns:
            the payload of the answer.

        Raises:
            CommandError: the server does not know the request or does not answer.
        """
        if "\0" in words or len(words.encode()) > 1000:
            raise CommandError(f"request {words[:40]!r}: it holds a NUL or is longer than 1000 bytes")
        request = _Request(words)
        self._waiting.append(request)
        if not request.done.wait(timeout):
            request.attempts = ATTEMPTS  # the session drops it
            request.failure = f"the server does not answer the request {words!r} within {timeout:g} s"
        if request.failure or request.answer is None:
            raise CommandError(request.failure)
        return request.answer

    def poll(self, now: int) -> list[bytes]:
        """What is to be sent now [ns]."""
        while self._waiting:
            request = self._waiting[0]
            if now < request.due:
                return []
            if request.attempts < ATTEMPTS:
                request.attempts, request.due = request.attempts + 1, now + RETRY_PERIOD
                return [packet(Message.REQUEST, request.words.encode() + b"\0")]
            self._end(f"the server does not answer the request {request.words!r}")
        return []

    def answered(self, payload: bytes | None) -> None:
        """An answer came; None: the server does not know the request."""
        if not self._waiting or not self._waiting[0].attempts:
            return
        request = self._waiting[0]
        request.answer = payload
        self._end("" if payload is not None else f"the server does not know the request {request.words!r}")

    def _end(self, failure: str) -> None:
        request = self._waiting.popleft()
        request.failure = failure
        request.done.set()
