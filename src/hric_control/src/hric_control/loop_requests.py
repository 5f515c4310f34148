"""Function calls that other threads request from the thread of a loop."""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any, TypeVar

from hric_core.errors import HricError

T = TypeVar("T")


class LoopRequests:
    """Queue of function calls that the thread of a loop executes between two cycles.

    If no loop is running, or the request comes from the loop's thread, the call is executed at once.

    Args:
        wake: callback after a call was queued.

    Attributes:
        waiting: queued calls, with the futures of their results.
        lock: lock held while a call is executed at once, and while a loop begins or ends.
        thread: identifier of the running loop's thread, or None.
    """

    def __init__(self, wake: Callable[[], object] = lambda: None) -> None:
        self.waiting: deque[tuple[Future[Any], Callable[[], Any]]] = deque()
        self.lock = threading.RLock()
        self.thread: int | None = None
        self._wake = wake

    def request(self, function: Callable[[], T]) -> T:
        """Let the loop call a function; wait, and return its result or raise its error in the calling thread."""
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
        """Execute the queued calls; called by the loop between two cycles."""
        while self.waiting:
            future, function = self.waiting.popleft()
            try:
                future.set_result(function())
            except BaseException as error:  # raised in the requesting thread
                future.set_exception(error)
                if not isinstance(error, Exception):
                    raise
