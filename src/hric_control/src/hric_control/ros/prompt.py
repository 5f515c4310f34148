"""Topics of a rospy node send in the thread that publishes, as long as the network takes what is sent."""

import contextlib
import socket
import threading
from collections import deque
from typing import Any

import rospy.topics


def send_promptly() -> None:
    """Let all topics of this process send through a `PromptConnection` where they have a queue. After
    `rospy.init_node`.

    rospy wakes a thread for each message to each listener, which costs several times what sending does.
    """
    rospy.topics.QueuedConnection = PromptConnection


class PromptConnection:
    """A listener's connection in place of rospy's QueuedConnection: it never waits for the listener either, and one who
    does not keep up loses the oldest messages of his queue. The queue begins where the network takes no more, and a
    thread lives as long as the queue.

    Args:
        connection: rospy's own.
        queue_size: messages that may wait; 0: any number.
    """

    def __init__(self, connection: Any, queue_size: int) -> None:
        self._connection, self._lock = connection, threading.Lock()
        self._queue: deque[bytes | bytearray] = deque(maxlen=queue_size or None)
        self._behind = False
        # A socket of Python that has a time-out waits for that long in each call, whatever its flags.
        self._patience: float | None = connection.socket.gettimeout()
        connection.socket.settimeout(None)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def write_data(self, data: bytes | bytearray) -> bool:
        """Send, or queue. Raises as rospy's connections do where this one is broken."""
        connection = self._connection
        with self._lock:
            if self._behind:
                self._queue.append(data)
                return True
            try:
                sent = connection.socket.send(data, socket.MSG_DONTWAIT)
            except BlockingIOError:
                sent = 0
            except (OSError, AttributeError):  # broken or closed: rospy's own connection raises it once more
                connection.write_data(data)
                return True
            connection.stat_bytes += sent
            if sent == len(data):
                connection.stat_num_msg += 1
                return True
            self._behind = True
        threading.Thread(target=self._catch_up, args=(data[sent:],), name="slow listener", daemon=True).start()
        return True

    def _catch_up(self, data: bytes | bytearray) -> None:
        """Send it and then the queue, waiting for the listener as long as rospy would."""
        connection = self._connection
        self._wait_for(self._patience)
        while True:
            try:
                connection.write_data(data)
            except Exception:  # whatever rospy raises: half a message may be out, so that nothing can follow it
                connection.close()
            with self._lock:
                if connection.done or not self._queue:
                    self._queue.clear()
                    self._wait_for(None)
                    self._behind = False
                    return
                data = self._queue.popleft()

    def _wait_for(self, seconds: float | None) -> None:
        with contextlib.suppress(OSError, AttributeError):  # closed
            self._connection.socket.settimeout(seconds)
