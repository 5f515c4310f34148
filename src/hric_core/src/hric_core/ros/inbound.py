"""Connections of subscribers and service clients to this process: many at once, and none holds up the others.

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
HEADER_TIME, MAX_HEADER, MAX_WAITING = 5.0, 1 << 16, 64
"""Time for a header [s], its largest size [bytes], and the largest number of connections without one; beyond it, the
oldest is closed (project defaults, unconfirmed)."""


def widen() -> None:
    """Allow many subscribers to connect to this process at once. To be called after `rospy.init_node`.

    rospy lets only 5 connections wait. If a recorder connects to all topics of a node within a millisecond, the kernel
    refuses the rest, and they try again a second later. Until then the recorder receives nothing on these topics.
    """
    tcpros_base.start_tcpros_server()
    server = tcpros_base._tcpros_server.tcp_ros_server
    server.server_sock.listen(BACKLOG)
    server.inbound_handler = _awaiting_headers(server.inbound_handler)


def _awaiting_headers(handle: Callable[..., object]) -> Callable[..., None]:
    """Return a handler of connections that waits for each header in a thread, and then calls rospy's `handle`.

    Of two connections of a subscriber to one topic, rospy keeps the newer at both ends. Here they may be handled in
    another order, so an older one is closed if the newer has been handled.
    """
    waiting, handling = dict[socket.socket, set[bytes]](), threading.Lock()

    def receive(connected: socket.socket, address: tuple[str, int]) -> None:
        header, fault = _header(connected)
        with handling:
            order = list(waiting)
            if header in waiting.pop(connected):
                fault = "the subscriber has a newer one"
            if not fault:
                for older in order[: order.index(connected)] if b"topic=" in header else ():
                    waiting[older].add(header)
                handle(connected, address)
                return
        LOG.info("the connection from %s:%d is closed: %s", *address, fault)
        connected.close()

    def accept(connected: socket.socket, address: tuple[str, int]) -> None:
        waiting[connected] = set()
        if len(waiting) > MAX_WAITING:
            with suppress(OSError, StopIteration, RuntimeError):
                next(iter(waiting)).shutdown(socket.SHUT_RDWR)  # its thread wakes up and closes it
        threading.Thread(target=receive, args=(connected, address), name="inbound", daemon=True).start()

    return accept


def _header(connected: socket.socket) -> tuple[bytes, str]:
    """Wait for the whole header of a connection, which is not consumed; return it, and why it did not come, or ""."""
    deadline, ready = time.monotonic() + HEADER_TIME, select.poll()
    ready.register(connected, select.POLLIN)
    while (left := deadline - time.monotonic()) > 0.0 and ready.poll(1e3 * left):
        try:
            seen = connected.recv(MAX_HEADER, socket.MSG_PEEK)
        except OSError as error:
            return b"", str(error.strerror)
        size = 4 + int.from_bytes(seen[:4], "little")
        if not seen or size > MAX_HEADER:
            fault = f"a header of {size} bytes; valid: up to {MAX_HEADER}" if seen else "it ended before its header"
            return b"", fault
        if len(seen) >= max(size, 4):
            return seen[:size], ""
        time.sleep(0.01)
    return b"", f"no complete header within {HEADER_TIME:g} s"
