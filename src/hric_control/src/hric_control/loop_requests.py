"""Calls from other threads into that of a loop."""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any, TypeVar

from hric_core.errors import HricError

T = TypeVar("T")


class LoopRequests:
    """Calls that the thread of a loop executes between two cycles; at once without a running loop, and in its thread.

    Args:
        wake: callback after each call that waits.

    Attributes:
        waiting: calls that the loop has not executed yet, with the futures of their results.
        lock: held while a call is executed at once, and while a loop begins or ends.
        thread: identifier of the running loop's thread, or None.
    """

    def __init__(self, wake: Callable[[], object] = lambda: None) -> None:
        self.waiting: deque[tuple[Future[Any], Callable[[], Any]]] = deque()
        self.lock = threading.RLock()
        self.thread: int | None = None
        self._wake = wake

    def request(self, function: Callable[[], T]) -> T:
        """Execute a call in the loop, and return its result or raise its error here."""
        with self.lock:
            if self.thread is None or self.thread == threading.get_ident():
                return function()
            future: Future[T] = Future()
            self.waiting.append((future, function))
        self._wake()
        return future.result()

    @contextmanager
    def served_here(self) -> Iterator[None]:
        """Let the calls wait for this thread until the block ends; those that then wait get a HricError."""
        with self.lock:
            self.thread = threading.get_ident()
        try:
            yield
        finally:
            with self.lock:
                self.thread = None
                while self.waiting:
                    self.waiting.popleft()[0].set_exception(HricError("the control loop has ended"))

    def serve(self) -> None:
        """Execute the waiting calls; called by the loop."""
        while self.waiting:
            future, function = self.waiting.popleft()
            try:
                future.set_result(function())
            except BaseException as error:  # raised in the requesting thread
                future.set_exception(error)
                if not isinstance(error, Exception):
                    raise
