"""Calls from other threads, carried out by the control loop between two cycles: libfranka is used by one thread only."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from hric_control.errors import HricError


@dataclass
class _Call:
    function: Callable[[], None]
    done: threading.Event = field(default_factory=threading.Event)
    error: BaseException | None = None


class LoopCalls:
    """Hands calls to the loop while it runs; otherwise, and from its own thread, they are made at once."""

    def __init__(self) -> None:
        self._calls: deque[_Call] = deque()
        self._state = threading.RLock()
        self._thread: int | None = None

    def open(self) -> None:
        """The calling thread is the loop from now on."""
        with self._state:
            self._thread = threading.get_ident()

    def close(self) -> None:
        """The loop has ended; calls that still wait fail."""
        with self._state:
            self._thread = None
            while self._calls:
                call = self._calls.popleft()
                call.error = HricError("the control loop has ended")
                call.done.set()

    def request(self, function: Callable[[], None]) -> None:
        """Make the call in the loop and wait for it; its error is raised here."""
        with self._state:
            if self._thread is None or self._thread == threading.get_ident():
                function()
                return
            call = _Call(function)
            self._calls.append(call)
        call.done.wait()
        if call.error is not None:
            raise call.error

    def serve(self) -> bool:
        """Make the calls that wait; from the loop. Answers whether there were any."""
        if not self._calls:
            return False
        while self._calls:
            call = self._calls.popleft()
            try:
                call.function()
            except Exception as error:  # handed to the thread that asked
                call.error = error
            call.done.set()
        return True
