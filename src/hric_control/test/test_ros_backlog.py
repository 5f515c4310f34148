"""A rospy node takes the connections of a recorder that wants all of its topics at once."""

import socket
import struct

import pytest
from rospy.impl import tcpros_base

from hric_control.ros import process as ros_backlog
from hric_control.testing import ros, roscore  # noqa: F401

pytestmark = pytest.mark.alone

LONGEST_QUEUE = 28
"""Where Linux tells, of a socket that listens, how many connections may wait: tcpi_sacked of struct tcp_info."""


@pytest.mark.rostest
def test_more_connections_may_wait_than_rospy_lets(ros: str) -> None:  # noqa: F811
    ros_backlog.widen()
    listening = tcpros_base._tcpros_server.tcp_ros_server.server_sock
    (longest,) = struct.unpack_from("I", listening.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 104), LONGEST_QUEUE)
    assert longest == ros_backlog.BACKLOG
