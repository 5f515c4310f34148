"""The server of a rospy node: it takes the connections of a recorder that wants all of its topics at once, is not held
up by peers that send no header, and ends quietly."""

import socket
import struct
import subprocess
import sys
from contextlib import ExitStack, suppress

import pytest
import rospy
from rospy.impl import tcpros_base
from std_msgs.msg import String

from hric_core.ros import inbound

pytestmark = pytest.mark.alone

LONGEST_QUEUE = 28
"""Offset of tcpi_sacked in struct tcp_info, where Linux gives the backlog of a listening socket."""


@pytest.mark.rostest
def test_more_connections_may_wait_than_rospy_lets(ros: str) -> None:
    inbound.widen()
    listening = tcpros_base._tcpros_server.tcp_ros_server.server_sock
    (longest,) = struct.unpack_from("I", listening.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 104), LONGEST_QUEUE)
    assert longest == inbound.BACKLOG


def test_a_node_that_ends_before_its_server_has_run_says_nothing() -> None:
    program = (
        "import threading; from unittest import mock; from rospy.impl.tcpros_base import TCPServer; "
        "from hric_core.ros import process; "
        "server = TCPServer(None); "
        "mock.patch('rospy.signal_shutdown', lambda _: server.shutdown()).start(); process.shut_down('test'); "
        "late = threading.Thread(target=server.run); late.start(); late.join(10.0)"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert ended.stderr == ""


def server_of_a_node() -> socket.socket:
    inbound.widen()
    return socket.create_connection(tcpros_base._tcpros_server.tcp_ros_server.server_sock.getsockname(), 5.0)


def subscribe(connection: socket.socket, topic: bytes) -> bytes:
    """Send the header of a subscriber; return the answer."""
    fields = [b"callerid=/test", b"topic=" + topic, b"md5sum=*", b"type=*"]
    header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
    connection.sendall(struct.pack("<I", len(header)))
    connection.sendall(header)
    return connection.recv(4096)


def is_served(connection: socket.socket) -> bool:
    """Return True if a subscriber of a topic that the node does not publish gets an answer."""
    return b"error=" in subscribe(connection, b"/nothing")


@pytest.mark.rostest
def test_of_two_connections_of_a_subscriber_the_newer_stays_whichever_header_comes_first(ros: str) -> None:
    publisher = rospy.Publisher("/twice", String, queue_size=1, latch=True)
    publisher.publish("heard")
    with server_of_a_node() as older, socket.create_connection(older.getpeername(), 5.0) as newer:
        heard = subscribe(newer, b"/twice")
        while b"heard" not in heard:  # the latched message, after the answer
            heard += newer.recv(4096)
        with pytest.raises(ConnectionResetError):  # rospy's subscriber has left it, too
            subscribe(older, b"/twice")
        publisher.publish("still")
        assert b"still" in newer.recv(4096)
    publisher.unregister()


@pytest.mark.rostest
def test_peers_that_send_no_header_keep_nobody_out(ros: str) -> None:
    with ExitStack() as stack:
        for number in range(3 * inbound.MAX_WAITING):
            silent = stack.enter_context(server_of_a_node())
            silent.sendall(bytes(number % 4))
        with server_of_a_node() as client:
            assert is_served(client)


@pytest.mark.rostest
@pytest.mark.parametrize("begin", [b"GET / HTTP/1.1\r\n", b"\xff" * 8, b""])
def test_a_peer_without_a_valid_header_is_disconnected(ros: str, begin: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inbound, "HEADER_TIME", 0.2)
    with server_of_a_node() as peer:
        peer.sendall(begin)
        with suppress(ConnectionResetError):
            assert peer.recv(64) == b""
