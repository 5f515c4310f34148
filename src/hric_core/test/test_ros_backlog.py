"""The server of a rospy node: it takes the connections of a recorder that wants all of its topics at once, and ends
quietly."""

import socket
import struct
import subprocess
import sys

import pytest
from rospy.impl import tcpros_base

from hric_core.ros import process as ros_backlog

pytestmark = pytest.mark.alone

LONGEST_QUEUE = 28
"""Offset of tcpi_sacked in struct tcp_info, where Linux gives the backlog of a listening socket."""


@pytest.mark.rostest
def test_more_connections_may_wait_than_rospy_lets(ros: str) -> None:
    ros_backlog.widen()
    listening = tcpros_base._tcpros_server.tcp_ros_server.server_sock
    (longest,) = struct.unpack_from("I", listening.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 104), LONGEST_QUEUE)
    assert longest == ros_backlog.BACKLOG


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
