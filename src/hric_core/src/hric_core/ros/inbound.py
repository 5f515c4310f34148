"""Incoming connections of subscribers and service clients, each of which waits for its header in its own thread.

rospy reads the header of each connection in the thread that accepts them, so that a peer which connects and sends
nothing keeps all subscribers and service clients out of the node.
"""

import logging
import select
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from rospy.impl import tcpros_base

LOG = logging.getLogger("hric.control.inbound")
BACKLOG = 128
"""Number of TCP connections that may wait to be accepted (project default, unconfirmed).

It is above the number of topics of any node of the workspace."""
HEADER_TIME = 5.0
"""Time after which a connection without a complete header is closed [s] (project default, unconfirmed)."""
MAX_HEADER = 1 << 16
"""Largest header [bytes], several times the longest message definition (project default, unconfirmed)."""
MAX_WAITING = 64
"""Largest number of connections without a complete header; beyond it, the oldest one is closed (project default,
unconfirmed)."""
AGAIN = 0.01
"""Polling period of an incomplete header [s]."""

Handle = Callable[[socket.socket, tuple[str, int]], None]


def widen() -> None:
    """Allow many subscribers to connect to this process at once. To be called after `rospy.init_node`.

    rospy lets only 5 connections wait. If a recorder connects to all topics of a node within a millisecond, the kernel
    refuses the rest, and they try again a second later. Until then the recorder receives nothing on these topics.
    """
    tcpros_base.start_tcpros_server()
    server = tcpros_base._tcpros_server.tcp_ros_server
    server.server_sock.listen(BACKLOG)
    if not isinstance(server.inbound_handler, Doorkeeper):
        server.inbound_handler = Doorkeeper(server.inbound_handler)


class Doorkeeper:
    """Handler of new connections that waits for each header in a thread; calls of `handle` do not overlap.

    handle: rospy's handler, which reads the header and blocks until it is complete.
    """

    def __init__(self, handle: Handle) -> None:
        self._handle = handle
        self._handling, self._lock = threading.Lock(), threading.Lock()
        self._waiting: list[socket.socket] = []

    def __call__(self, connected: socket.socket, address: tuple[str, int]) -> None:
        """Handle a connection; returns at once."""
        with self._lock:
            self._waiting.append(connected)
            oldest = self._waiting[0] if len(self._waiting) > MAX_WAITING else None
        if oldest is not None:
            with suppress(OSError):
                oldest.shutdown(socket.SHUT_RDWR)  # its thread wakes up and closes it
        threading.Thread(target=self._receive, args=(connected, address), name="inbound", daemon=True).start()

    def _receive(self, connected: socket.socket, address: tuple[str, int]) -> None:
        try:
            fault = missing(connected)
        except OSError as error:
            fault = str(error.strerror or error)
        with self._lock:
            self._waiting.remove(connected)
        if not fault:
            with self._handling:
                return self._handle(connected, address)
        LOG.info("the connection from %s:%d is closed: %s", *address, fault)
        connected.close()


def missing(connected: socket.socket) -> str:
    """Wait until a connection has sent its header, without consuming it. Return the fault, or ""."""
    deadline, ready = time.monotonic() + HEADER_TIME, select.poll()
    ready.register(connected, select.POLLIN)
    while (left := deadline - time.monotonic()) > 0.0 and ready.poll(1e3 * left):
        seen = connected.recv(MAX_HEADER, socket.MSG_PEEK)
        size = 4 + int.from_bytes(seen[:4], "little")
        if not seen:
            return "closed before its header was complete"
        if size > MAX_HEADER:
            return f"a header of {size} bytes; valid: up to {MAX_HEADER}"
        if len(seen) >= size and len(seen) >= 4:
            return ""
        time.sleep(AGAIN)
    return f"no complete header within {HEADER_TIME:g} s"
