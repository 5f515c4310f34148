"""A topic of the publishing process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hric_control.publish_process import PublishProcess


class RemotePublisher:
    """Advertised by the process, built and sent there.

    Args:
        process: the publishing process.
        topic: absolute name.
        message_type: message class.
        latch: give the last message to subscribers that come later.
        report: takes one line when a message could not be built or sent; from another thread.

    Raises:
        HricError: the topic cannot be advertised.
    """

    __slots__ = ("_number", "_open", "process")

    def __init__(self, process: PublishProcess, topic: str, message_type: type, latch: bool, report: Callable[[str], None]) -> None:
        self.process, self._open = process, True
        self._number = process.advertise(topic, message_type, latch, report)

    def send(self, build: Callable[..., Any], args: tuple[Any, ...]) -> None:
        """Hand `build` and its arguments over; once unregistered, nothing is sent."""
        if self._open:
            self.process.publish(self._number, build, args)

    def subscribers(self) -> int:
        """Number of listeners, a twentieth of a second old."""
        return self.process.listeners(self._number)

    def unregister(self) -> None:
        """Stop advertising, after all that was handed over; a second call does nothing."""
        if self._open:
            self._open = False
            self.process.unregister(self._number)
